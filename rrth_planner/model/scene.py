# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as boxes."""

from dataclasses import dataclass, field
from typing import Any, TYPE_CHECKING

import numpy as np
from rrth_planner.kernels.layout import MAX_BOXES, NUMBERS, ORTHOGONAL, ROTATION, SIZE
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import check_type, printable, SceneError
from rrth_planner.model.frozen import Frozen


@dataclass(frozen=True, slots=True, eq=False)
class Box(Frozen):
    """
    One part of the wearer.

    Parameters
    ----------
    center, size : array_like, shape (3,)
        Its centre in the base frame, and full edge lengths along its own axes, all > 0 [m].
    rotation : array_like, shape (3, 3)
        Its axes as columns, in the base frame.

    Attributes
    ----------
    numbers : ndarray, shape (15,)
        Centre, size and rotation, as in `kernels.layout`.

    Raises
    ------
    SceneError
        A size that is not positive, a rotation that is none, a number that is not finite or
        beyond 1e4, a name that is not printable.

    """

    name: str
    center: Array
    size: Array
    rotation: Array
    numbers: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Validate and freeze."""
        label = f'box "{printable(self.name, "name of a box", SceneError)}"'
        parts = [
            frozen_array(
                getattr(self, name),
                shape,
                f'{label}: {name}',
                '-' if name == 'rotation' else 'm',
                SceneError,
                FARTHEST,
            ).ravel()
            for name, shape in (('center', (3,)), ('size', (3,)), ('rotation', (3, 3)))
        ]
        numbers = np.concatenate(parts)
        numbers.setflags(write=False)
        _fill(self, self.name, numbers)
        if not (self.size > 0.0).all():
            raise SceneError(f'{label}: size {self.size.tolist()}, expected three lengths > 0 [m]')
        r = self.rotation
        if np.abs(r @ r.T - np.eye(3)).max() > ORTHOGONAL or np.linalg.det(r) < 0.0:
            raise SceneError(f'{label}: rotation {r.tolist()}, expected a rotation matrix [-]')

    @classmethod
    def of_row(cls, name: str, row: Array) -> 'Box':
        """Return a box of numbers, (15,), that are known to be one and may not be changed."""
        box: Box = object.__new__(cls)
        _put(box, 'name', name)
        _put(box, 'numbers', row)
        return box

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Array:
            """Return a part of the numbers, of a box of which nobody has asked for it before."""
            if name not in ('center', 'size', 'rotation'):
                raise AttributeError(f'a box has no {name}')
            _fill(self, self.name, self.numbers)
            return getattr(self, name)


_put = object.__setattr__


def _fill(box: Box, name: str, row: Array) -> None:
    """Write the fields of a box, all of them parts of one array."""
    _put(box, 'name', name)
    _put(box, 'numbers', row)
    _put(box, 'center', row[:SIZE])
    _put(box, 'size', row[SIZE:ROTATION])
    _put(box, 'rotation', row[ROTATION:].reshape(3, 3))


@dataclass(frozen=True, slots=True)
class Scene:
    """
    The wearer: boxes in the base frame, their `names`, and `numbers` as an array, (n, 15).

    Raises
    ------
    SceneError
        More boxes than kernels have room for.

    """

    boxes: tuple[Box, ...]
    names: tuple[str, ...] = field(init=False, repr=False, compare=False)
    numbers: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Validate and freeze the collection."""
        boxes = tuple(self.boxes)
        for box in boxes:
            if type(box) is not Box:
                check_type(box, Box, 'boxes', SceneError)
        if len(boxes) > MAX_BOXES:
            raise SceneError(f'boxes: {len(boxes)}, expected at most {MAX_BOXES}')
        numbers = np.array([box.numbers for box in boxes]).reshape(len(boxes), NUMBERS)
        numbers.setflags(write=False)
        _put(self, 'boxes', boxes)
        _put(self, 'names', tuple([box.name for box in boxes]))
        _put(self, 'numbers', numbers)

    def __reduce__(self) -> tuple[Any, ...]:
        """Be sent as names and one array, in a quarter of the time that the boxes take."""
        return scene_of_bytes, (self.names, self.numbers.tobytes())


def scene_of_rows(names: tuple[str, ...], numbers: Array) -> Scene:
    """
    Return the scene of boxes of numbers, (n, 15), that are known to be boxes.

    Nobody else may change these any more. Raise SceneError for more boxes than kernels take.
    """
    if len(names) > MAX_BOXES:
        raise SceneError(f'boxes: {len(names)}, expected at most {MAX_BOXES}')
    numbers.setflags(write=False)
    scene: Scene = object.__new__(Scene)
    _put(scene, 'boxes', tuple(map(Box.of_row, names, numbers)))
    _put(scene, 'names', names)
    _put(scene, 'numbers', numbers)
    return scene


def scene_of_bytes(names: tuple[str, ...], rows: bytes) -> Scene:
    """Return the scene that was sent in this way; it is not checked again."""
    return scene_of_rows(names, np.frombuffer(rows).reshape(len(names), NUMBERS))
