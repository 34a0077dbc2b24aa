# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An independent check of an arm beside a wearer who moves; shares nothing with the planner."""

from collections.abc import Sequence
from dataclasses import dataclass
import itertools

import numpy as np
from rrth_planner.collision.motion_inspection import REST, UnsafeMotionError
from rrth_planner.collision.reference_checker import (
    fast_distances,
    separation_violations,
    SeparationViolation,
)
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import seen_body, SeparationRules, speed_bound
from rrth_planner.model.trajectory import part_of, Trajectory

# A commitment is judged at its points and so often [s].
CHECK_PERIOD = 0.01
# A planner may have known no newer body than one that is so old, where there are newer ones [s].
OLDEST_BODY = 0.2
# A part that was faster than assumed excuses what happens for so long [s].
EXCUSED_TIME = 2.0
# Bodies that come so many periods after each other: there may have been one between them that was
# not received here.
GAP_PERIODS = 1.5
_CORNERS = 0.5 * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


@dataclass(frozen=True, slots=True, eq=False)
class Sights(Frozen):
    """A wearer as he was published: when each body was measured, (n,) [s], and its boxes."""

    times: Array
    scenes: tuple[Scene, ...]

    def between(self, begin: float, end: float) -> range:
        """Return the indices of those that were measured from a time to another one [s]."""
        return range(
            int(np.searchsorted(self.times, begin, side='left')),
            int(np.searchsorted(self.times, end, side='right')),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationInspection:
    """
    The figures of an arm that kept separate from its wearer.

    Parameters
    ----------
    n_commitments, n_unknown, n_excused : int
        All of them; those near which a body may be missing here, so that nothing is known of them;
        those that are near parts of the wearer that had been faster than assumed.
    n_instants, n_contacts : int
        States of the arm, and those of them with a contact: only with parts of the wearer that had
        been faster than assumed.
    n_frames, n_faster : int
        Bodies after another one, and those by which a part had been faster than assumed.

    """

    n_commitments: int
    n_unknown: int
    n_excused: int
    n_instants: int
    n_contacts: int
    n_frames: int
    n_faster: int


def inspect_separation(
    arm: ArmModel,
    rules: SeparationRules,
    margin: float,
    sights: Sights,
    commitments: Sequence[tuple[float, float, Trajectory]],
    times: Array,
    q: Array,
    v: Array,
) -> SeparationInspection:
    """
    Return the figures of an arm beside a wearer who moves, as all of it was published.

    Parameters
    ----------
    margin : float
        [m].
    commitments : sequence of (float, float, Trajectory)
        What the controller was given: when it was published, when it begins [s].
    times, q, v : ndarray, shape (n,), (n, dof) twice
        When the arm was where, and how fast [s, rad, rad/s].

    Raises
    ------
    UnsafeMotionError
        A commitment that does not end at rest, or violates the separation from the wearer as he
        was published until then; or a part of the arm faster than the contact speed in a box.
        Not where the part of the wearer had been faster than assumed.

    """
    n_unknown = n_excused = 0
    for published, begin, trajectory in commitments:
        speed = float(np.abs(trajectory.velocities[-1]).max())
        if not speed <= REST:
            raise UnsafeMotionError(f'a commitment ends at {speed:.2e}, expected rest [rad/s]')
        found = _violations(arm, rules, margin, sights, published, begin, trajectory)
        if not found:
            continue
        boxes = {one.box for one in found}
        if all(_was_faster(sights, name, published, rules) for name in boxes):
            n_excused += 1
        elif _has_gap(sights, published):
            n_unknown += 1
        else:
            worst = max(found, key=lambda one: one.depth)
            raise UnsafeMotionError(
                f'a commitment has bar {worst.bar} of the arm {1e3 * worst.depth:.1f} mm too near '
                f'to {worst.box} {worst.time:.3f} s after it is published'
            )
    n_contacts = 0
    newest = np.searchsorted(sights.times, times, side='right') - 1
    for k in np.unique(newest[newest >= 0]):
        scene, rows = sights.scenes[k], np.flatnonzero(newest == k)
        near = np.zeros((len(rows), len(scene.boxes)))
        distances = fast_distances(arm, scene, q[rows], v[rows], rules.contact_speed, near)
        for i, bar, box in np.argwhere(distances <= 0.0):
            name, time = scene.boxes[box].name, float(times[rows[i]])
            if not _was_faster(sights, name, time, rules):
                raise UnsafeMotionError(
                    f'bar {bar} of the arm was faster than {rules.contact_speed:g} m/s in contact '
                    f'with {name}, which was no faster than assumed'
                )
        n_contacts += int((distances <= 0.0).any(axis=(1, 2)).sum())
    n_faster = sum(
        any(_is_faster(sights, box.name, range(k, k + 2), rules) for box in scene.boxes)
        for k, scene in enumerate(sights.scenes[:-1])
    )
    return SeparationInspection(
        n_commitments=len(commitments),
        n_unknown=n_unknown,
        n_excused=n_excused,
        n_instants=int((newest >= 0).sum()),
        n_contacts=n_contacts,
        n_frames=len(sights.times) - 1,
        n_faster=n_faster,
    )


def _violations(
    arm: ArmModel,
    rules: SeparationRules,
    margin: float,
    sights: Sights,
    published: float,
    begin: float,
    trajectory: Trajectory,
) -> list[SeparationViolation]:
    """
    Return the violations of a commitment by the newest body; none if there are none by another.

    The newest ones may have been on their way to the planner still. What it repeats from before
    its publication belongs to the commitment before it.
    """
    found: list[list[SeparationViolation]] = []
    own = part_of(trajectory, min(published - begin, trajectory.duration), trajectory.duration)
    for k in reversed(_known(sights, published)):
        body = seen_body(sights.scenes[k], published - float(sights.times[k]), rules)
        found.append(separation_violations(arm, body, own, rules, margin, period=CHECK_PERIOD))
        if not found[-1]:
            return []
    return found[0]


def _known(sights: Sights, time: float) -> range:
    """Return which bodies a planner may have known as its newest one at a time [s]."""
    end = sights.between(-np.inf, time).stop
    if end == 0:
        raise UnsafeMotionError('a commitment is published before there is a body, expected one')
    return range(min(sights.between(time - OLDEST_BODY, time).start, end - 1), end)


def _has_gap(sights: Sights, time: float) -> bool:
    """Return whether a body may be missing that was published shortly before a time [s]."""
    some = _known(sights, time)
    period = float(np.median(np.diff(sights.times)))
    return bool(np.diff([*sights.times[some], time]).max() > GAP_PERIODS * period)


def _was_faster(sights: Sights, name: str, time: float, rules: SeparationRules) -> bool:
    """Return whether a part had been faster than assumed shortly before a time [s]."""
    return _is_faster(sights, name, sights.between(time - EXCUSED_TIME, time), rules)


def _is_faster(sights: Sights, name: str, some: range, rules: SeparationRules) -> bool:
    """Return whether a part was faster between any two of some sights than assumed."""
    known = [
        (sights.times[k], _corners(box))
        for k in some
        for box in sights.scenes[k].boxes
        if box.name == name
    ]
    if len(known) < 2:
        return False
    times, corners = (np.array(column) for column in zip(*known, strict=True))
    ways = np.linalg.norm(corners[:, None] - corners[None], axis=-1).max(axis=-1)
    spans = np.abs(times[:, None] - times[None])
    return bool((ways > speed_bound(rules, name) * spans + 2.0 * rules.body_error).any())


def _corners(box: Box) -> Array:
    corners: Array = box.center + (_CORNERS * box.size) @ box.rotation.T
    return corners
