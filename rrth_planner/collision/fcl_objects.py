# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer's boxes and the bars of an arm as objects of the Flexible Collision Library."""

from collections.abc import Callable
import functools
import math
from typing import ClassVar

import fcl
import numpy as np
from rrth_planner.model.arm import ArmModel, bar_ends, bar_names
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene

# Bars become capsules this thin, and their radius is taken off the distance: of thick ones the
# library overestimates it by up to half a millimetre. Then it is good to a few micrometres, rarely
# worse; this bound covers it [m].
THINNEST, DOUBT = 1e-6, 1e-3


class _Shape:
    """
    A shape and its object, pooled for reuse.

    python-fcl 0.7 does not free an object wholly: the counter of its shared pointer stays.
    """

    def __init__(self, geometry: fcl.CollisionGeometry) -> None:
        self.geometry, self.item = geometry, fcl.CollisionObject(geometry)


def _taken(spare: list[_Shape], make: Callable[[], fcl.CollisionGeometry]) -> _Shape:
    """Return a spare shape, or a new one; append and pop are atomic for all threads."""
    try:
        return spare.pop()
    except IndexError:
        return _Shape(make())


class Boxes:
    """The boxes of a scene as objects of the library."""

    _spare: ClassVar[list[_Shape]] = []

    def __init__(self, scene: Scene) -> None:
        self._shapes: list[_Shape] = []
        self.names = [box.name for box in scene.boxes]
        for box in scene.boxes:
            shape = _taken(self._spare, lambda: fcl.Box(1.0, 1.0, 1.0))
            self._shapes.append(shape)
            shape.geometry.side = box.size
            shape.geometry.computeLocalAABB()
            shape.item.setTransform(fcl.Transform(box.rotation, box.center))

    def __del__(self) -> None:
        self._spare.extend(self._shapes)

    def nearest(self, item: fcl.CollisionObject, bounds: Array) -> tuple[float, int]:
        """
        Return the distance of an object from the nearest box [m], and the index of that box.

        bounds (m,): lower bounds of the distances [m]; replaced by the distance of each box that
        is checked.
        """
        least, nearest = math.inf, -1
        for j in np.argsort(bounds).tolist():
            if bounds[j] - DOUBT >= least:
                break
            bounds[j] = distance = fcl.distance(item, self._shapes[j].item, _REQUEST, _RESULT)
            if distance < least:
                least, nearest = distance, j
        return least, nearest


# No distance is less than this result, so the library does not spend time filling it in.
_REQUEST, _RESULT = fcl.DistanceRequest(), fcl.DistanceResult(-math.inf)
# A wearer who holds still is the same scene from plan to plan; nothing moves its objects.
boxes_of = functools.lru_cache(maxsize=8)(Boxes)


class Bar:
    """One bar of an arm as a capsule, placed by each distance query."""

    _spare: ClassVar[list[_Shape]] = []

    def __init__(self, arm: ArmModel, k: int, ray_length: float) -> None:
        self._capsule = _taken(self._spare, lambda: fcl.Capsule(THINNEST, 1.0))
        self.k, self.name = k, bar_names(arm)[k]
        row, end = bar_ends(arm)[k]
        self._is_a, self._is_ray = end == 'a', end == 'd' and row == arm.dof
        # `a` leads along x of the frame before; `d` ends at its frame's origin, but the ray
        # begins there.
        self._frame = row - 1 if self._is_a else row
        self._offset = ray_length if self._is_ray else float(arm.dh[row, 1 if self._is_a else 3])
        is_sliding = end == 'd' and not self._is_ray and arm.is_prismatic[row]
        self._slide = row if is_sliding else None
        self._radius = float(arm.radii[row])
        self._stretch(self._offset)

    def __del__(self) -> None:
        self._spare.append(self._capsule)

    def nearest(self, boxes: Boxes, bounds: Array, q: Array, poses: Array) -> tuple[float, int]:
        """
        Return the distance from the nearest box [m], and its index; bounds as for the boxes.

        q (dof,): a configuration; poses (dof + 1, 4, 4): the frames of the arm there.
        """
        pose = poses[self._frame]
        offset = self._offset
        if self._slide is not None:
            offset += float(q[self._slide])
            self._stretch(offset)
        # A capsule lies along its own z, centred.
        rotation = pose[:3, [1, 2, 0]] if self._is_a else pose[:3, :3]
        ahead = 0.5 * offset if self._is_a or self._is_ray else -0.5 * offset
        item = self._capsule.item
        item.setRotation(rotation)
        item.setTranslation(pose[:3, 3] + ahead * rotation[:, 2])
        distance, box = boxes.nearest(item, bounds)
        return distance + THINNEST - self._radius, box

    def _stretch(self, offset: float) -> None:
        self._capsule.geometry.lz = abs(offset)
        self._capsule.geometry.computeLocalAABB()
