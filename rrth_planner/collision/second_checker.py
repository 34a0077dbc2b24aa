# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The independent check of a trajectory, by a library of distances: python-fcl or coal."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace
import functools
from itertools import islice, pairwise
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.bar_pairs import pairs_of
from rrth_planner.collision.distance_library import DOUBT
from rrth_planner.collision.distance_objects import (
    boxes_of,
    PlacedBar,
    PlacedPair,
    PlacedPart,
    placements,
)
from rrth_planner.collision.violation import Violation
from rrth_planner.model.arm import ArmModel, bars_of, is_called
from rrth_planner.model.arrays import Array
from rrth_planner.model.reach import reach_table
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import part_of, piece_coefficients, positions_at, Trajectory

# Spacing of the grid of instants that may be sampled [s].
GRID_PERIOD = 0.001
# Distances this much below the margin are rounding of the library, not violations [m].
TOLERANCE = 3e-6
# During an escape this distance is demanded from boxes that much smaller: the library does not
# report the penetration depth of a contact. Where nothing is left of such a box, the arm is too
# near to its middle for a side to escape to [m].
ESCAPE_DISTANCE = 1e-3
# Samples taken at once within a gap: of many, some may turn out to be needless.
MAX_SAMPLES = 8
# Intervals that each piece is cut into, and the powers of u that q'(u) has at their ends.
INTERVALS = 8
_CUTS = np.linspace(0.0, 1.0, INTERVALS + 1)
_FIRST = np.arange(1, 6) * _CUTS[:, None] ** np.arange(5)
# Bernstein coefficients of the third derivatives of u^3, u^4 and u^5, which bound them, and how
# far a function can be from its chord over an interval for each unit of its second derivative.
_THIRD = np.array([[6.0, 0.0, 0.0], [6.0, 12.0, 0.0], [6.0, 24.0, 60.0]])
_CHORD = 0.125 / INTERVALS**2


def nearest(required: RequiredClearance, scene: Scene, q: Array) -> Violation:
    """Return the part of the arm and the box that are closest at q, shape (dof,)."""
    arm, boxes = required.arm, boxes_of(scene, required.library)
    bars = _bars(required)
    placed = placements(arm, bars, q[None], [0] * len(bars))
    none = [0.0] * len(scene.boxes)
    found = [
        (bar.nearest(boxes, _unknown(arm, scene, bar.name), none, placed, q), bar) for bar in bars
    ]
    (distance, box), bar = min(found, key=lambda one: one[0][0])
    return Violation(0.0, distance, bar.name if box else '', box)


def displacements(arm: ArmModel, trajectory: Trajectory, times: Array, ray_length: float) -> Array:
    """
    Return upper bounds of the path length of the points of each bar since the start.

    Between any two of the instants (n,) [s], which do not decrease, no point of the bar moves
    further than the difference. (n_bars + n_pairs, n), bars as in `arm.bars_of`, then pairs as in
    `bar_pairs.pairs_of`, whose bars move no further to each other [m].
    """
    reaches = _reaches(arm, ray_length)
    if len(trajectory.times) == 1:
        return np.zeros((len(reaches), len(times)))
    c = piece_coefficients(trajectory)
    speeds = np.abs(_FIRST @ c[:, 1:])
    curvature = np.abs(_THIRD @ c[:, 3:]).max(axis=1)
    top = np.maximum(speeds[:, :-1], speeds[:, 1:]) + _CHORD * curvature[:, None]
    steps = (top / INTERVALS).reshape(-1, arm.dof) @ reaches.T
    grid = trajectory.times[:-1, None] + np.diff(trajectory.times)[:, None] * _CUTS[:-1]
    grid = np.append(grid, trajectory.times[-1])
    bounds = np.zeros((len(reaches), len(grid)))
    np.cumsum(steps.T, axis=1, out=bounds[:, 1:])
    return np.array([np.interp(times, grid, bound) for bound in bounds])


@functools.lru_cache(maxsize=16)
def _reaches(arm: ArmModel, ray_length: float) -> Array:
    """Return how far each joint moves a point of each bar, and two bars to each other, at most."""
    # Both ends of a bar bound the speed of all its points.
    every = reach_table(arm, ray_length).max(axis=1)
    rows = [*every[: len(bars_of(arm))]]
    for pair in pairs_of(arm):
        rows.append((every[pair.inner] + every[pair.outer]) * (np.arange(arm.dof) >= pair.body))
    reaches = np.array(rows)
    reaches.setflags(write=False)
    return reaches


def _bars(required: RequiredClearance) -> list[PlacedBar]:
    arm, ray, library = required.arm, required.ray_guard_length, required.library
    return [PlacedBar(arm, k, ray, library) for k in range(len(bars_of(arm)))]


class _Sample(NamedTuple):
    """
    The distances of a bar at an instant, given by its index.

    `displacement`: upper bound of how far the bar has moved until then; `free`: how far it may
    move before and after without violating a margin; `bounds` (m,): lower bounds of the distances
    of the boxes beyond their margins [m].
    """

    instant: int
    displacement: float
    free: float
    bounds: list[float]


def _unknown(arm: ArmModel, scene: Scene, bar: str) -> list[float]:
    """Return what is known of the distances of a bar from boxes: it may meet some, (m,) [m]."""
    allowed = [name for part, name in arm.allowed if part == bar]
    return [
        math.inf if any(is_called(box.name, name) for name in allowed) else -math.inf
        for box in scene.boxes
    ]


# A bar, or a pair, and two samples of it; whether it is free between them is open.
_Gap = tuple[PlacedPart, _Sample, _Sample]


class _Advancement:
    """
    Conservative advancement along a trajectory, and the first violation found.

    margins (m,): to be kept from each box [m]. The distance of a violation is beyond that margin.
    """

    def __init__(
        self,
        required: RequiredClearance,
        scene: Scene,
        trajectory: Trajectory,
        margins: Sequence[float],
    ) -> None:
        arm, ray_length, library = required.arm, required.ray_guard_length, required.library
        self._arm, self._trajectory, self._margins = arm, trajectory, margins
        self._library, self._boxes = library, boxes_of(scene, library)
        self.last = max(1, math.ceil(trajectory.duration / GRID_PERIOD))
        self._times = np.linspace(0.0, trajectory.duration, self.last + 1)
        self.displacements = displacements(arm, trajectory, self._times, ray_length)
        self.bars = _bars(required)
        self.parts: list[PlacedPart] = [*self.bars]
        self.parts += [
            PlacedPair(arm, pair, len(self.bars) + n, ray_length, library)
            for n, pair in enumerate(pairs_of(arm))
        ]
        # The boxes do not matter to a pair.
        self._unknown = np.array([_unknown(arm, scene, part.name) for part in self.parts])
        self.violation: Violation | None = None

    def take(self, wanted: Sequence[tuple[PlacedPart, int, tuple[_Sample, ...]]]) -> list[_Sample]:
        """Return samples of bars at some instants; others: samples whose bounds carry over."""
        parts, indices, others = zip(*wanted, strict=True)
        instants = sorted(set(indices))
        q = positions_at(self._trajectory, self._times[instants])
        place_of = {index: place for place, index in enumerate(instants)}
        places = [place_of[index] for index in indices]
        placed = placements(self._arm, parts, q, places)
        ks = [part.k for part in parts]
        moved, bounds = self.displacements[ks, indices], self._unknown[ks]
        for side in zip(*others, strict=True):
            since = np.abs(moved - [other.displacement for other in side])
            bounds = np.maximum(
                bounds, np.array([other.bounds for other in side]) - since[:, None]
            )
        samples = []
        for part, index, place, way, known in zip(
            parts, indices, places, moved.tolist(), bounds.tolist(), strict=True
        ):
            distance, box = part.nearest(self._boxes, known, self._margins, placed, q[place])
            if distance < -TOLERANCE and (self.violation is None or index < self.last):
                # Later instants need not be checked any more.
                self.last = index
                self.violation = Violation(
                    float(self._times[index]), distance, part.name, box, part.k >= len(self.bars)
                )
            samples.append(_Sample(index, way, max(0.0, distance - DOUBT), known))
        return samples

    def parts_at_end(self, reach: float) -> list[PlacedPart]:
        """Return the pointing ray as far as the target [m], and its pairs: for the end alone."""
        ray = self.bars[-1].k
        return [
            PlacedBar(self._arm, ray, reach, self._library),
            *(
                PlacedPair(self._arm, pair, len(self.bars) + n, reach, self._library)
                for n, pair in enumerate(pairs_of(self._arm))
                if pair.outer == ray
            ),
        ]

    def next_samples(self, gap: _Gap) -> list[int]:
        """Return where to sample next in a gap; nowhere when its ends prove it free."""
        bar, before, after = gap
        begin, end = before.displacement + before.free, after.displacement - after.free
        room = after.instant - before.instant - 1
        if begin >= end or room == 0 or before.instant >= self.last:
            return []
        # As many samples as are needed if the bar keeps its distance from the boxes.
        n = math.ceil(min(MAX_SAMPLES, room, (end - begin) / (before.free + after.free + 1e-9)))
        step = (end - begin) / n
        moved, low, high = self.displacements[bar.k], before.instant + 1, after.instant - 1
        return sorted({bisect_left(moved, begin + (j + 0.5) * step, low, high) for j in range(n)})


def first_violation(
    required: RequiredClearance, scene: Scene, trajectory: Trajectory, reach: float
) -> Violation | None:
    """
    Return the first clearance violation of a trajectory, or None.

    Conservative advancement to both sides: a sample proves a bar free, before and after, for as
    long as no point of it moves further than its distance. What two samples leave open between
    them is sampled again, at intervals of `GRID_PERIOD` at least: each instant of that grid is
    checked or proven free.

    The scene is in the base frame. reach: how much of the ray must be clear at the end [m].
    """
    violation = _first(required, scene, trajectory, [required.margin] * len(scene.boxes), reach)
    return None if violation is None else _from_body(violation, required.margin)


def _from_body(violation: Violation, margin: float) -> Violation:
    """Return a violation with its distance from the body, not from the margin round it [m]."""
    # Of itself the arm only has to be clear.
    if violation.is_of_arm:
        return violation
    return replace(violation, distance=violation.distance + margin)


def _first(
    required: RequiredClearance,
    scene: Scene,
    trajectory: Trajectory,
    margins: Sequence[float],
    reach: float,
) -> Violation | None:
    """Return `first_violation` for a margin of each box, its distance beyond the margin [m]."""
    advancement = _Advancement(required, scene, trajectory, margins)
    end = advancement.last
    starts = sorted({0, end // 2, end})
    at_end = advancement.parts_at_end(reach) if reach > required.ray_guard_length else []
    # All samples of a round are taken at once: the kinematics of one instant take as long as those
    # of a dozen.
    samples = iter(
        advancement.take(
            [(part, index, ()) for part in advancement.parts for index in starts]
            + [(part, end, ()) for part in at_end]
        )
    )
    gaps: list[_Gap] = []
    for part in advancement.parts:
        gaps += [(part, *pair) for pair in pairwise(list(islice(samples, len(starts))))]
    while inner := [(gap, places) for gap in gaps if (places := advancement.next_samples(gap))]:
        samples = iter(
            advancement.take([(gap[0], i, gap[1:]) for gap, places in inner for i in places])
        )
        gaps = []
        for (bar, before, after), places in inner:
            chain = (before, *islice(samples, len(places)), after)
            gaps += [(bar, *pair) for pair in pairwise(chain)]
    return advancement.violation


def first_escape_violation(
    required: RequiredClearance,
    scene: Scene,
    depths: Array,
    trajectory: Trajectory,
    escape_time: float,
) -> Violation | None:
    """
    Return the first violation of a motion that escapes from boxes, or None.

    depths (2, m): penetration depths at the start in each box, grown by the margin, of the bars
    without the pointing ray and of the ray: by how much the box would have to shrink on every
    side for them to be clear [m]; < 0: clear. No motion may exceed them, except in a box that the
    ray is in itself, without the margin, or not `ESCAPE_DISTANCE` from the middle of: that counts
    for the other bars alone, which may never be so deep. escape_time: when the escape ends; 0:
    there is none [s]. All else as for `first_violation`.
    """
    if escape_time == 0.0:
        return None
    escape = part_of(trajectory, 0.0, escape_time)
    is_void, margin = _entered(required, scene, trajectory.positions[0]), required.margin
    violations = []
    for ray, depth in ((0.0, depths[0]), (required.ray_guard_length, depths.max(axis=0))):
        boxes: list[Box] = []
        margins: list[float] = []
        kept: dict[str, float] = {}
        for i, box in enumerate(scene.boxes):
            if is_void[i] and ray > 0.0:
                continue
            by, apart = margin - max(float(depth[i]), 0.0), ESCAPE_DISTANCE
            size = box.size + 2.0 * (by - ESCAPE_DISTANCE)
            if (size > 0.0).all():
                box = Box(box.name, box.center, size, box.rotation)
            elif depth[i] <= 0.0:
                apart = margin
            elif ray > 0.0:
                continue
            else:
                return Violation(0.0, by, 'the arm', box.name)
            boxes.append(box)
            margins.append(apart)
            kept[box.name] = max(by, kept.get(box.name, by))
        judged = replace(required, ray_guard_length=ray)
        violation = _first(judged, Scene(tuple(boxes)), escape, margins, 0.0)
        if violation is not None:
            violations.append(_from_body(violation, kept.get(violation.box, 0.0)))
    return min(violations, key=lambda violation: violation.time, default=None)


def _entered(required: RequiredClearance, scene: Scene, q: Array) -> NDArray[np.bool_]:
    """Return which boxes the pointing ray is in at q, shape (dof,)."""
    # As in the separating axes, its radius grows the boxes.
    arm, library = required.arm, required.library
    radius = float(arm.radii[-1])
    grown = [
        Box(box.name, box.center, box.size + 2.0 * radius, box.rotation) for box in scene.boxes
    ]
    distances = [-math.inf] * len(grown)
    ray = PlacedBar(arm, len(bars_of(arm)) - 1, required.ray_guard_length, library)
    boxes = boxes_of(Scene(tuple(grown)), library)
    ray.nearest(boxes, distances, [0.0] * len(grown), placements(arm, [ray], q[None], [0]), q)
    return np.array(distances) <= DOUBT
