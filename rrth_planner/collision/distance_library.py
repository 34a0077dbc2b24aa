# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Libraries of distances between boxes and capsules: python-fcl and coal, whichever is chosen."""

from collections.abc import Callable
import functools
from importlib import import_module
from importlib.util import find_spec
import math
from typing import Any, NamedTuple

from rrth_planner.model.errors import ModelError
from rrth_planner.model.scene import Box

# Module and package of each, by the name of the choice.
LIBRARIES = {'fcl': 'python-fcl', 'coal': 'coal'}
# Bars become capsules this thin, and their radius is taken off the distance: of thick ones fcl
# overestimates it by up to half a millimetre. Then coal is good to a micrometre, and fcl to a few;
# this bound covers it. But fcl at times stops searching too early where things lie symmetrically
# or a box is thin: beside boxes under 5 mm one distance in 250 is more than that too great, by up
# to 0.1 m [m].
THINNEST, DOUBT = 1e-6, 1e-3
# Objects that meet are this far apart at most, by rounding of coal [m].
MET = 5e-7


class Shape(NamedTuple):
    """A geometry of a library and its object, pooled for reuse."""

    geometry: Any
    item: Any


class DistanceLibrary:
    """
    Boxes and thin capsules of one library, and the distances between them.

    `query`, of two objects, `request` and `result`, returns their distance [m], 0 or less where
    they meet: without a method between, since it is asked a hundred times a motion.

    Shapes are pooled: python-fcl 0.7 does not free an object wholly, since the counter of its
    shared pointer stays. Append and pop are atomic for all threads.
    """

    def __init__(self, name: str) -> None:
        """Load the library of that name, which is installed."""
        self._module = import_module(name)
        self._boxes: list[Shape] = []
        self._capsules: list[Shape] = []
        if name == 'fcl':
            # No distance is less than this result, so fcl spends no time filling it in.
            result = self._module.DistanceResult(-math.inf)
            self.query = self._module.distance
            self.request, self.result = self._module.DistanceRequest(), result
        else:
            self.query = _coal_distance(self._module)
            self.request, self.result = self._module.DistanceRequest(), None
            # Nobody asks how deep a contact is.
            self.request.enable_signed_distance = False
        self._is_fcl = name == 'fcl'

    def placed_box(self, box: Box) -> Shape:
        """Return a shape of a box where it is."""
        shape = self._taken(self._boxes, lambda: self._module.Box(1.0, 1.0, 1.0))
        if self._is_fcl:
            shape.geometry.side = box.size
        else:
            shape.geometry.halfSide = 0.5 * box.size
        shape.geometry.computeLocalAABB()
        shape.item.setRotation(box.rotation)
        shape.item.setTranslation(box.center)
        return shape

    def capsule(self, length: float) -> Shape:
        """Return a shape of a thin capsule along its own z, centred."""
        shape = self._taken(self._capsules, lambda: self._module.Capsule(THINNEST, 1.0))
        self.stretch(shape, length)
        return shape

    def stretch(self, capsule: Shape, length: float) -> None:
        """Give a capsule a length [m]."""
        if self._is_fcl:
            capsule.geometry.lz = length
        else:
            capsule.geometry.halfLength = 0.5 * length
        capsule.geometry.computeLocalAABB()

    def release(self, shapes: list[Shape], *, are_boxes: bool) -> None:
        """Take shapes back that nobody uses any more."""
        (self._boxes if are_boxes else self._capsules).extend(shapes)

    def _taken(self, spare: list[Shape], make: Callable[[], Any]) -> Shape:
        try:
            return spare.pop()
        except IndexError:
            geometry = make()
            return Shape(geometry, self._module.CollisionObject(geometry))


def require_library(name: str) -> None:
    """Raise ModelError where a library of distances is unknown or not installed."""
    if name not in LIBRARIES:
        raise ModelError(f'second_checker: "{name}", expected {" or ".join(LIBRARIES)}')
    if find_spec(name) is None:
        package = LIBRARIES[name]
        raise ModelError(
            f'second_checker: {package} is not installed, expected for the second check of every '
            f'motion (pip install {package})'
        )


@functools.lru_cache
def library_of(name: str) -> DistanceLibrary:
    """Return the library of a name, or raise ModelError where it is unknown or not installed."""
    require_library(name)
    return DistanceLibrary(name)


def _coal_distance(coal: Any) -> Callable[..., float]:
    """
    Return coal's distance of two objects [m], with a result of its own for each query.

    Of objects that meet it is -1, as that of fcl: coal's own is 0 to rounding, which would be
    within the tolerance of a margin of 0.
    """

    def distance(one: Any, other: Any, request: Any, _: None) -> float:
        found: float = coal.distance(one, other, request, coal.DistanceResult())
        return found if found > MET else -1.0

    return distance
