# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as boxes."""

from dataclasses import dataclass, field
from typing import Any

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
        _fill(box, name, row)
        return box


def _fill(box: Box, name: str, row: Array) -> None:
    """Write the fields of a box, all of them parts of one array."""
    put = object.__setattr__
    put(box, 'name', name)
    put(box, 'numbers', row)
    put(box, 'center', row[:SIZE])
    put(box, 'size', row[SIZE:ROTATION])
    put(box, 'rotation', row[ROTATION:].reshape(3, 3))


@dataclass(frozen=True, slots=True)
class Scene:
    """
    The wearer: boxes in the base frame, and their `numbers` as an array, (n, 15).

    Raises
    ------
    SceneError
        More boxes than kernels have room for.

    """

    boxes: tuple[Box, ...]
    numbers: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Validate and freeze the collection."""
        boxes = tuple(self.boxes)
        for box in boxes:
            check_type(box, Box, 'boxes', SceneError)
        if len(boxes) > MAX_BOXES:
            raise SceneError(f'boxes: {len(boxes)}, expected at most {MAX_BOXES}')
        object.__setattr__(self, 'boxes', boxes)
        numbers = np.array([box.numbers for box in boxes]).reshape(len(boxes), NUMBERS)
        numbers.setflags(write=False)
        object.__setattr__(self, 'numbers', numbers)

    def __reduce__(self) -> tuple[Any, ...]:
        """Be sent as names and one array, in a quarter of the time that the boxes take."""
        return scene_of_bytes, (tuple(box.name for box in self.boxes), self.numbers.tobytes())


def scene_of_bytes(names: tuple[str, ...], rows: bytes) -> Scene:
    """Return the scene that was sent in this way; it is not checked again."""
    # An array over bytes is read-only.
    numbers = np.frombuffer(rows).reshape(len(names), NUMBERS)
    return Scene(tuple(map(Box.of_row, names, numbers)))
