# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer's boxes and the bars of an arm as objects of the Flexible Collision Library."""

from collections.abc import Callable
import functools
import math
from typing import ClassVar

import fcl
import numpy as np
from rrth_planner.collision.bar_pairs import BarPair
from rrth_planner.model.arm import ArmModel, bars_of, Capsule, mount_bars
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


class PlacedBar:
    """One bar of an arm as a capsule, placed by each distance query."""

    _spare: ClassVar[list[_Shape]] = []

    def __init__(self, arm: ArmModel, k: int, ray_length: float) -> None:
        self._capsule = _taken(self._spare, lambda: fcl.Capsule(THINNEST, 1.0))
        bar = (*bars_of(arm), *mount_bars(arm))[k]
        self.k, self.name, self.radius = k, bar.name, bar.radius
        self._mount = arm.T_base_mount
        self._slide: int | None = None
        # A capsule of the library lies along its own z, centred.
        self._turn: Array | None = None
        if isinstance(bar.source, Capsule):
            begin, end = bar.source.ends
            self._frame = bar.source.link - 1
            self._offset = float(np.linalg.norm(end - begin))
            self._middle = 0.5 * (begin + end)
            if self._offset > 0.0:
                self._turn = _turn_to((end - begin) / self._offset)
        else:
            row, kind = bar.source
            is_a, is_ray = kind == 'a', kind == 'd' and row == arm.dof
            # `a` leads along x of the frame before; `d` ends at its frame's origin, but the ray
            # begins there.
            self._frame = row - 1 if is_a else row
            self._offset = ray_length if is_ray else float(arm.dh[row, 1 if is_a else 3])
            self._middle = np.zeros(3)
            if is_a:
                self._turn = np.eye(3)[:, [1, 2, 0]]
                self._middle[0] = 0.5 * self._offset
            else:
                self._middle[2] = 0.5 * self._offset if is_ray else -0.5 * self._offset
            if kind == 'd' and not is_ray and arm.is_prismatic[row]:
                self._slide = row
        self._stretch(self._offset)

    def __del__(self) -> None:
        self._spare.append(self._capsule)

    def place(self, q: Array, poses: Array) -> fcl.CollisionObject:
        """Return the object at q (dof,), with the frames of the arm there, (dof + 1, 4, 4)."""
        pose = poses[self._frame] if self._frame >= 0 else self._mount
        middle = self._middle
        if self._slide is not None:
            offset = self._offset + float(q[self._slide])
            self._stretch(offset)
            middle = np.array([0.0, 0.0, -0.5 * offset])
        rotation = pose[:3, :3]
        item = self._capsule.item
        item.setRotation(rotation if self._turn is None else rotation @ self._turn)
        item.setTranslation(pose[:3, 3] + rotation @ middle)
        return item

    def nearest(self, boxes: Boxes, bounds: Array, q: Array, poses: Array) -> tuple[float, str]:
        """
        Return the distance from the nearest box [m], and its name; bounds as for the boxes.

        q (dof,): a configuration; poses (dof + 1, 4, 4): the frames of the arm there.
        """
        distance, j = boxes.nearest(self.place(q, poses), bounds)
        return distance + THINNEST - self.radius, boxes.names[j] if j >= 0 else ''

    def _stretch(self, offset: float) -> None:
        self._capsule.geometry.lz = abs(offset)
        self._capsule.geometry.computeLocalAABB()


class PlacedPair:
    """Two bars of an arm that must not collide."""

    def __init__(self, arm: ArmModel, pair: BarPair, k: int, ray_length: float) -> None:
        self.k = k
        self._inner = PlacedBar(arm, pair.inner, ray_length)
        self._outer = PlacedBar(arm, pair.outer, ray_length)
        self.name = self._inner.name

    def nearest(self, boxes: Boxes, bounds: Array, q: Array, poses: Array) -> tuple[float, str]:
        """Return the distance of the two bars [m], and the name of the outer one."""
        one, other = self._inner.place(q, poses), self._outer.place(q, poses)
        distance = fcl.distance(one, other, _REQUEST, _RESULT)
        radii = self._inner.radius + self._outer.radius
        return distance + 2.0 * THINNEST - radii, self._outer.name


def _turn_to(z: Array) -> Array:
    """Return a rotation whose z axis is a unit vector."""
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
