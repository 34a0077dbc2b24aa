# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The second opinion: the same trajectory judged by the Flexible Collision Library."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
import math

import numpy as np
from rrth_planner.collision.displacement_bounds import travelled
from rrth_planner.collision.fcl_objects import Bar, boxes_of, DOUBT
from rrth_planner.collision.violation import Violation
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array
from rrth_planner.model.reach import bar_ends
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import part_of, positions_at, Trajectory

# Longest time between two instants that may be looked at [s].
PERIOD = 0.001
# Distances this much below the margin are rounding of the library [m].
TOLERANCE = 3e-6
# On the way out of boxes this distance is asked for, of boxes that much smaller: of what touches
# the library does not say how deep [m].
APART = 1e-3
# Looks into a gap at once: where they are many, some may turn out to be needless.
MOST_LOOKS = 8


def nearest(arm: ArmModel, scene: Scene, q: Array, ray_length: float) -> Violation:
    """Return the part of the arm and the box that are closest at q, shape (dof,)."""
    boxes, poses = boxes_of(scene), forward_kinematics(arm, q)
    least, where = math.inf, ('', '')
    for k in range(len(bar_ends(arm))):
        bar = Bar(arm, k, ray_length)
        distance, j = bar.nearest(boxes, np.full(len(boxes.names), -math.inf), q, poses)
        if distance < least:
            least, where = distance, (bar.name, boxes.names[j])
    return Violation(0.0, least, *where)


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """
    What was seen of a bar at an instant.

    Parameters
    ----------
    index : int
        Of the instant.
    way : float
        Which the bar has moved until then, at most [m].
    free : float
        Which it may move before and after without coming nearer than the margin [m].
    bounds : ndarray, shape (m,)
        The boxes are no nearer than this [m].

    """

    index: int
    way: float
    free: float
    bounds: Array

    def bounds_at(self, way: float) -> Array:
        """Return bounds of the distances of the boxes where the bar has moved so far [m]."""
        return self.bounds - abs(way - self.way)


# A bar and two looks at it: whether it is free between them is asked.
_Gap = tuple[Bar, _Look, _Look]


class _Watch:
    """The looks at a trajectory, and the first touch that they have seen."""

    def __init__(
        self,
        arm: ArmModel,
        scene: Scene,
        trajectory: Trajectory,
        margin: float,
        ray_length: float,
    ) -> None:
        self._arm, self._trajectory, self._margin = arm, trajectory, margin
        self._boxes = boxes_of(scene)
        self.last = max(1, math.ceil(trajectory.duration / PERIOD))
        self._times = np.linspace(0.0, trajectory.duration, self.last + 1)
        self.ways = travelled(arm, trajectory, self._times, ray_length)
        self.bars = [Bar(arm, k, ray_length) for k in range(len(self.ways))]
        self._unknown = np.full(len(scene.boxes), -math.inf)
        self.touch: Violation | None = None

    def look(self, wanted: Sequence[tuple[Bar, int, tuple[_Look, ...]]]) -> list[_Look]:
        """Return looks at bars at some instants, each with what others have seen of the bar."""
        q = positions_at(self._trajectory, self._times[[index for _, index, _ in wanted]])
        poses = forward_kinematics(self._arm, q)
        looks = []
        for (bar, index, others), one_q, one_poses in zip(wanted, q, poses, strict=True):
            way = float(self.ways[bar.k, index])
            bounds = self._unknown
            for other in others:
                bounds = np.maximum(bounds, other.bounds_at(way))
            bounds = bounds.copy()
            distance, j = bar.nearest(self._boxes, bounds, one_q, one_poses)
            if distance < self._margin - TOLERANCE and (self.touch is None or index < self.last):
                # What comes later need not be looked at any more.
                self.last = index
                box = self._boxes.names[j]
                self.touch = Violation(float(self._times[index]), distance, bar.name, box)
            looks.append(_Look(index, way, max(0.0, distance - self._margin - DOUBT), bounds))
        return looks

    def between(self, gap: _Gap) -> list[int]:
        """Return where to look next in a gap; nowhere when the looks at its ends prove it free."""
        bar, before, after = gap
        begin, end = before.way + before.free, after.way - after.free
        room = after.index - before.index - 1
        if begin >= end or room == 0 or before.index >= self.last:
            return []
        # As many looks as are needed where the bar stays as far from the boxes as it is here.
        n = math.ceil(min(MOST_LOOKS, room, (end - begin) / (before.free + after.free + 1e-9)))
        step = (end - begin) / n
        way, low, high = self.ways[bar.k], before.index + 1, after.index - 1
        return sorted({bisect_left(way, begin + (j + 0.5) * step, low, high) for j in range(n)})


def first_violation(
    arm: ArmModel,
    scene: Scene,
    trajectory: Trajectory,
    margin: float,
    ray_guard_length: float,
    reach: float,
) -> Violation | None:
    """
    Return where a trajectory first comes nearer than the margin, or None.

    Conservative advancement to both sides: a look proves a bar free, before and after, for as long
    as no point of it moves further than the distance seen. What the proofs of two looks leave
    between them is looked at again, but where the arm passes close no more often than every
    `PERIOD`: each such instant is looked at or proven free.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    trajectory : Trajectory
    margin : float
        Distance to keep from every box [m].
    ray_guard_length : float
        How much of the ray is guarded in motion [m].
    reach : float
        How much of it must be clear at the end [m].

    """
    watch = _Watch(arm, scene, trajectory, margin, ray_guard_length)
    end = watch.last
    starts = sorted({0, end // 2, end})
    looks = iter(watch.look([(bar, index, ()) for bar in watch.bars for index in starts]))
    gaps: list[_Gap] = []
    for bar in watch.bars:
        gaps += [(bar, *pair) for pair in pairwise(list(islice(looks, len(starts))))]
    # All looks of a round are taken in one go: the kinematics of one instant take as long as those
    # of a dozen.
    while inner := [(gap, places) for gap in gaps if (places := watch.between(gap))]:
        looks = iter(watch.look([(gap[0], i, gap[1:]) for gap, places in inner for i in places]))
        gaps = []
        for (bar, before, after), places in inner:
            chain = (before, *islice(looks, len(places)), after)
            gaps += [(bar, *pair) for pair in pairwise(chain)]
    if watch.touch is None and reach > ray_guard_length:
        watch.look([(Bar(arm, watch.bars[-1].k, reach), end, ())])
    return watch.touch


def touch_on_way_out(
    arm: ArmModel,
    scene: Scene,
    depths: Array,
    trajectory: Trajectory,
    escape_time: float,
    margin: float,
    ray_guard_length: float,
) -> Violation | None:
    """
    Return where a motion that leads out of boxes first comes nearer than it may, or None.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    depths : ndarray, shape (m,)
        By how much each box, grown by the margin, would have to be smaller on every side for the
        arm to be clear of it at the start [m]; it may come no deeper. < 0: it is clear.
    trajectory : Trajectory
    escape_time : float
        When the arm is out; 0: it was not in [s].
    margin, ray_guard_length : float
        [m].

    """
    if escape_time == 0.0:
        return None
    boxes, kept = [], margin - np.maximum(depths, 0.0)
    for box, by in zip(scene.boxes, kept.tolist(), strict=True):
        size = box.size + 2.0 * (by - APART)
        if not (size > 0.0).all():
            return Violation(0.0, by, 'the arm', box.name)
        boxes.append(Box(box.name, box.center, size, box.rotation))
    way = part_of(trajectory, 0.0, escape_time)
    touch = first_violation(arm, Scene(tuple(boxes)), way, APART, ray_guard_length, 0.0)
    if touch is None:
        return None
    by = max(by for box, by in zip(boxes, kept.tolist(), strict=True) if box.name == touch.box)
    return replace(touch, distance=touch.distance - APART + by)
