# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as boxes."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from rrth_planner.arrays import Array, frozen_array
from rrth_planner.errors import SceneError
from rrth_planner.kernels import boxes as kernels

# Further out the slack of the certificates would no longer cover rounding.
FARTHEST = 1e4


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """
    One part of the wearer.

    Parameters
    ----------
    name : str
        How messages call it.
    center : array_like, shape (3,)
        Its centre in the base frame [m].
    size : array_like, shape (3,)
        Its full edge lengths along its own axes [m], all > 0.
    rotation : array_like, shape (3, 3)
        Its axes as columns, in the base frame.

    Attributes
    ----------
    numbers : ndarray, shape (15,)
        Centre, size and rotation, as in `kernels.boxes`.

    Raises
    ------
    SceneError
        A size that is not positive, a rotation that is none, a number that is not finite.

    """

    name: str
    center: Array
    size: Array
    rotation: Array
    numbers: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Validate and freeze."""
        label = f'box "{self.name}"'
        parts = [
            frozen_array(
                getattr(self, name),
                shape,
                f'{label}: {name}',
                '-' if name == 'rotation' else 'm',
                SceneError,
            ).ravel()
            for name, shape in (('center', (3,)), ('size', (3,)), ('rotation', (3, 3)))
        ]
        _fill(self, self.name, _frozen(np.concatenate(parts)))
        if first_bad(self.numbers[None]) < 0:
            return
        if not (self.size > 0.0).all():
            raise SceneError(f'{label}: size {self.size.tolist()}, expected three lengths > 0 [m]')
        if max(np.abs(self.center).max(), self.size.max()) > FARTHEST:
            raise SceneError(
                f'{label}: center {self.center.tolist()}, size {self.size.tolist()}, expected '
                f'lengths up to {FARTHEST:g} [m]'
            )
        raise SceneError(
            f'{label}: rotation {self.rotation.tolist()}, expected a rotation matrix [-]'
        )


def boxes_of(names: Sequence[str], numbers: Array) -> tuple[Box, ...]:
    """
    Return boxes from their names and numbers, shape (n, 15), which are frozen by this.

    Raises
    ------
    SceneError
        Of the first that is no box.

    """
    rows = list(_frozen(numbers))
    bad = first_bad(numbers)
    if bad >= 0:
        row = rows[bad]
        Box(names[bad], row[: kernels.SIZE], row[kernels.SIZE : kernels.ROTATION], _rotation(row))
    boxes = tuple(object.__new__(Box) for _ in rows)
    for box, name, row in zip(boxes, names, rows, strict=True):
        _fill(box, name, row)
    return boxes


def first_bad(numbers: Array) -> int:
    """Return which of some numbers, shape (n, 15), are the first that are no box; -1: none."""
    return int(kernels.first_bad(numbers, FARTHEST))


def _frozen(numbers: Array) -> Array:
    numbers.setflags(write=False)
    return numbers


def _rotation(row: Array) -> Array:
    return row[kernels.ROTATION :].reshape(3, 3)


def _fill(box: Box, name: str, row: Array) -> None:
    """Write the fields of a box, all of them parts of one array."""
    put = object.__setattr__
    put(box, 'name', name)
    put(box, 'numbers', row)
    put(box, 'center', row[: kernels.SIZE])
    put(box, 'size', row[kernels.SIZE : kernels.ROTATION])
    put(box, 'rotation', _rotation(row))


@dataclass(frozen=True, slots=True)
class Scene:
    """
    The wearer: any number of boxes in the base frame.

    Parameters
    ----------
    boxes : sequence of Box

    Attributes
    ----------
    numbers : ndarray, shape (n, 15)
        Those of the boxes.

    """

    boxes: tuple[Box, ...]
    numbers: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Freeze the collection."""
        boxes = tuple(self.boxes)
        object.__setattr__(self, 'boxes', boxes)
        numbers = np.array([box.numbers for box in boxes]).reshape(len(boxes), kernels.NUMBERS)
        object.__setattr__(self, 'numbers', _frozen(numbers))
