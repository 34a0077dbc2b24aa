# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An independent check of an arm beside a wearer who moves; shares nothing with the planner."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.motion_inspection import REST, UnsafeMotionError
from rrth_planner.collision.reference_checker import (
    fast_distances,
    protrusions,
    separation_violations,
    SeparationViolation,
)
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import reach_at, reach_of, seen_body, SeparationRules
from rrth_planner.model.trajectory import part_of, Trajectory

# A commitment is judged at its points and so often [s].
CHECK_PERIOD = 0.01
# A planner may have known no newer body than one that is so old, where there are newer ones [s].
OLDEST_BODY = 0.2
# A part that got further than assumed excuses what happens for so long [s].
EXCUSED_TIME = 2.0
# Bodies that are further apart are not compared to count them: few motions are given to a
# controller for longer than that [s].
COMPARED = 1.0
# Bodies that come so many periods after each other: there may have been one between them that was
# not received here.
GAP_PERIODS = 1.5


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
        those that are near parts of the wearer that had got further than assumed.
    n_instants, n_contacts : int
        States of the arm, and those of them with a contact: only with parts of the wearer that had
        got further than assumed.
    n_frames, n_further : int
        Bodies after another one, and those by which a part had got further than assumed since any
        body of the last second.

    """

    n_commitments: int
    n_unknown: int
    n_excused: int
    n_instants: int
    n_contacts: int
    n_frames: int
    n_further: int


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
        Not where the part of the wearer had got further than assumed.

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
        if all(_was_further(sights, name, published, rules) for name in boxes):
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
            if not _was_further(sights, name, time, rules):
                raise UnsafeMotionError(
                    f'bar {bar} of the arm was faster than {rules.contact_speed:g} m/s in contact '
                    f'with {name}, which got no further than assumed'
                )
        n_contacts += int((distances <= 0.0).any(axis=(1, 2)).sum())
    return SeparationInspection(
        n_commitments=len(commitments),
        n_unknown=n_unknown,
        n_excused=n_excused,
        n_instants=int((newest >= 0).sum()),
        n_contacts=n_contacts,
        n_frames=len(sights.times) - 1,
        n_further=_further_frames(sights, rules),
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


def _was_further(sights: Sights, name: str, time: float, rules: SeparationRules) -> bool:
    """Return whether a part had got further than assumed shortly before a time [s]."""
    some = sights.between(time - EXCUSED_TIME, time)
    return any(is_out.any() for _, is_out in _compared(sights, name, some, rules, EXCUSED_TIME))


def _further_frames(sights: Sights, rules: SeparationRules) -> int:
    """Return by how many bodies a part had got further than assumed."""
    found, every = np.zeros(len(sights.times), np.bool_), range(len(sights.times))
    for name in {name for scene in sights.scenes for name in scene.names}:
        for later, is_out in _compared(sights, name, every, rules, COMPARED):
            found[later[is_out]] = True
    return int(found.sum())


def _compared(
    sights: Sights, name: str, some: range, rules: SeparationRules, longest: float
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.bool_]]]:
    """
    Yield which of some sights of a part are compared with which earlier ones, and which are out.

    All that are up to `longest` apart [s]; a part is out where it got further than its reach and
    two errors explain.
    """
    known = [
        (k, sights.times[k], box.numbers)
        for k in some
        for box in sights.scenes[k].boxes
        if box.name == name
    ]
    if not known:
        return
    which, times, rows = (np.array(column) for column in zip(*known, strict=True))
    reach = reach_of((name,), rules)
    balls = 0.5 * np.linalg.norm(rows[:, SIZE:ROTATION], axis=1)
    for step in range(1, len(which)):
        spans = times[step:] - times[:-step]
        if spans.min() > longest:
            return
        bounds = reach_at(reach, np.maximum(spans, 0.0)[:, None])[:, 0] + 2.0 * rules.body_error
        ways = np.linalg.norm(rows[step:, :SIZE] - rows[:-step, :SIZE], axis=1)
        # Nearer than that none of it can be out.
        far = np.flatnonzero((ways + balls[step:] > bounds) & (spans <= longest))
        yield which[step:][far], protrusions(rows[far], rows[far + step]) > bounds[far]
