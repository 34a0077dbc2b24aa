# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer's boxes and the bars of an arm as objects of a library of distances."""

import functools
import math
from typing import Any

import numpy as np
from rrth_planner.collision.bar_pairs import BarPair
from rrth_planner.collision.distance_library import DOUBT, library_of, THINNEST
from rrth_planner.model.arm import ArmModel, bars_of, Capsule, mount_bars
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

    def nearest(self, item: Any, bounds: Array) -> tuple[float, int]:
        """
        Return the distance of an object from the nearest box [m], and the index of that box.

        bounds (m,): lower bounds of the distances [m]; replaced by the distance of each box that
        is checked.
        """
        least, nearest, library = math.inf, -1, self._library
        query, request, result = library.query, library.request, library.result
        # Of a few boxes numpy's own sort and elements take longer.
        known = bounds.tolist()
        for j in sorted(range(len(known)), key=known.__getitem__):
            if known[j] - DOUBT >= least:
                break
            known[j] = distance = query(item, self._shapes[j].item, request, result)
            if distance < least:
                least, nearest = distance, j
        bounds[:] = known
        return least, nearest


# A wearer who holds still is the same scene from plan to plan; nothing moves its objects.
boxes_of = functools.lru_cache(maxsize=8)(Boxes)


class PlacedBar:
    """One bar of an arm as a capsule, placed by each distance query."""

    def __init__(self, arm: ArmModel, k: int, ray_length: float, library: str) -> None:
        self._library = library_of(library)
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
                self._turn = turned_to((end - begin) / self._offset)
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
        self._capsule = self._library.capsule(abs(self._offset))

    def __del__(self) -> None:
        self._library.release([self._capsule], are_boxes=False)

    def place(self, q: Array, poses: Array) -> Any:
        """Return the object at q (dof,), with the frames of the arm there, (dof + 1, 4, 4)."""
        pose = poses[self._frame] if self._frame >= 0 else self._mount
        middle = self._middle
        if self._slide is not None:
            offset = self._offset + float(q[self._slide])
            self._library.stretch(self._capsule, abs(offset))
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


class PlacedPair:
    """Two bars of an arm that must not collide."""

    def __init__(
        self, arm: ArmModel, pair: BarPair, k: int, ray_length: float, library: str
    ) -> None:
        self.k, self._library = k, library_of(library)
        self._inner = PlacedBar(arm, pair.inner, ray_length, library)
        self._outer = PlacedBar(arm, pair.outer, ray_length, library)
        self.name = self._inner.name

    def nearest(self, boxes: Boxes, bounds: Array, q: Array, poses: Array) -> tuple[float, str]:
        """Return the distance of the two bars [m], and the name of the outer one."""
        one, other = self._inner.place(q, poses), self._outer.place(q, poses)
        library = self._library
        distance = library.query(one, other, library.request, library.result)
        radii = self._inner.radius + self._outer.radius
        return distance + 2.0 * THINNEST - radii, self._outer.name
