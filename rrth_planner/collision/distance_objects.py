# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer's boxes and the bars of an arm as objects of a library of distances."""

from collections.abc import Iterator, Sequence
import functools
import math
from typing import Any, NamedTuple

import numpy as np
from rrth_planner.collision.bar_pairs import BarPair
from rrth_planner.collision.distance_library import DOUBT, library_of, THINNEST
from rrth_planner.model.arm import ArmModel, Bar, bars_of, Capsule, forward_kinematics, mount_bars
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import turned_to
from rrth_planner.model.scene import Scene


class Boxes:
    """The boxes of a scene as objects of a library, by its name."""

    def __init__(self, scene: Scene, library: str) -> None:
        self._library = library_of(library)
        self.names = [box.name for box in scene.boxes]
        self._shapes = [self._library.placed_box(box) for box in scene.boxes]

    def __del__(self) -> None:
        self._library.release(self._shapes, are_boxes=True)

    def nearest(
        self, item: Any, known: list[float], margins: Sequence[float]
    ) -> tuple[float, int]:
        """
        Return how far an object is beyond the margin of the nearest box, and the box's index.

        margins (m,): a distance for each box [m]; known (m,): lower bounds of the distances beyond
        them [m], replaced by that of each box that is checked.
        """
        least, nearest, library = math.inf, -1, self._library
        query, request, result = library.query, library.request, library.result
        for j in sorted(range(len(known)), key=known.__getitem__):
            if known[j] - DOUBT >= least:
                break
            distance = query(item, self._shapes[j].item, request, result) - margins[j]
            known[j] = distance
            if distance < least:
                least, nearest = distance, j
        return least, nearest


# A wearer who holds still is the same scene from plan to plan; nothing moves its objects.
boxes_of = functools.lru_cache(maxsize=8)(Boxes)


# A rotation (3, 3) and a translation (3,) [m].
Placement = tuple[Array, Array]


class CapsuleFrame(NamedTuple):
    """
    A bar of an arm, and where it is as a capsule.

    pose (4, 4): of the capsule, in frame number `frame`: 0 is the mount's, i that of link i;
    offset: its length, with the sign that the arm gives it [m]; slide: the joint that adds to it,
    if any.
    """

    bar: Bar
    frame: int
    pose: Array
    offset: float
    slide: int | None


@functools.lru_cache(maxsize=256)
def capsule_frame(arm: ArmModel, k: int, ray_length: float) -> CapsuleFrame:
    """Return where bar k of an arm is, with a pointing ray of this length [m]."""
    bar = (*bars_of(arm), *mount_bars(arm))[k]
    # A capsule of the library lies along its own z, centred.
    pose, slide = np.eye(4), None
    if isinstance(bar.source, Capsule):
        begin, end = bar.source.ends
        frame = bar.source.link
        offset = float(np.linalg.norm(end - begin))
        pose[:3, 3] = 0.5 * (begin + end)
        if offset > 0.0:
            pose[:3, :3] = turned_to((end - begin) / offset)
    else:
        row, kind = bar.source
        is_a, is_ray = kind == 'a', kind == 'd' and row == arm.dof
        # `a` leads along x of the frame before; `d` ends at its frame's origin, but the ray
        # begins there.
        frame = row if is_a else row + 1
        offset = ray_length if is_ray else float(arm.dh[row, 1 if is_a else 3])
        if is_a:
            pose[:3, :3] = np.eye(3)[:, [1, 2, 0]]
            pose[0, 3] = 0.5 * offset
        else:
            pose[2, 3] = 0.5 * offset if is_ray else -0.5 * offset
        if kind == 'd' and not is_ray and arm.is_prismatic[row]:
            slide = row
    pose.setflags(write=False)
    return CapsuleFrame(bar, frame, pose, offset, slide)


class PlacedBar:
    """One bar of an arm as a capsule, placed by each distance query."""

    def __init__(self, arm: ArmModel, k: int, ray_length: float, library: str) -> None:
        self._library = library_of(library)
        bar, self.frame, self.pose, self._offset, self._slide = capsule_frame(arm, k, ray_length)
        self.k, self.name, self.radius = k, bar.name, bar.radius
        self._capsule = self._library.capsule(abs(self._offset))

    def __del__(self) -> None:
        self._library.release([self._capsule], are_boxes=False)

    @property
    def bars(self) -> tuple['PlacedBar']:
        """The bars whose placements `nearest` takes."""
        return (self,)

    def place(self, placement: Placement, q: Array) -> Any:
        """Return the object at q (dof,); the placement of one that slides is that at 0."""
        (turn, middle), item = placement, self._capsule.item
        if self._slide is not None:
            slid = float(q[self._slide])
            self._library.stretch(self._capsule, abs(self._offset + slid))
            middle = middle - 0.5 * slid * turn[:, 2]
        item.setRotation(turn)
        item.setTranslation(middle)
        return item

    def nearest(
        self,
        boxes: Boxes,
        known: list[float],
        margins: Sequence[float],
        placements: Iterator[Placement],
        q: Array,
    ) -> tuple[float, str]:
        """Return how far it is beyond the margin of the nearest box, by name; as for boxes [m]."""
        distance, j = boxes.nearest(self.place(next(placements), q), known, margins)
        return distance + THINNEST - self.radius, boxes.names[j] if j >= 0 else ''


class PlacedPair:
    """Two bars of an arm that must not collide."""

    def __init__(
        self, arm: ArmModel, pair: BarPair, k: int, ray_length: float, library: str
    ) -> None:
        self.k, self._library = k, library_of(library)
        self._inner = PlacedBar(arm, pair.inner, ray_length, library)
        self._outer = PlacedBar(arm, pair.outer, ray_length, library)
        self.name, self.bars = self._inner.name, (self._inner, self._outer)

    def nearest(
        self,
        boxes: Boxes,
        known: list[float],
        margins: Sequence[float],
        placements: Iterator[Placement],
        q: Array,
    ) -> tuple[float, str]:
        """Return the distance of the two bars [m], and the name of the outer one."""
        one, other = [bar.place(next(placements), q) for bar in self.bars]
        library = self._library
        distance = library.query(one, other, library.request, library.result)
        radii = self._inner.radius + self._outer.radius
        return distance + 2.0 * THINNEST - radii, self._outer.name


PlacedPart = PlacedBar | PlacedPair


def placements(
    arm: ArmModel, parts: Sequence[PlacedPart], q: Array, places: Sequence[int]
) -> Iterator[Placement]:
    """
    Yield where the bars of some parts are, each part at one of the configurations q (n, dof).

    places: for each part, the index of its configuration.
    """
    bars = [(bar, place) for part, place in zip(parts, places, strict=True) for bar in part.bars]
    frames = np.empty((len(q), arm.dof + 2, 4, 4))
    frames[:, 0] = arm.T_base_mount
    frames[:, 1:] = forward_kinematics(arm, q)
    at = frames[[place for _, place in bars], [bar.frame for bar, _ in bars]]
    poses = at @ np.array([bar.pose for bar, _ in bars])
    return zip(poses[:, :3, :3], poses[:, :3, 3], strict=True)
