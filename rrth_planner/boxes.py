# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Many boxes at once, from their numbers."""

from collections.abc import Sequence

from rrth_planner.arrays import Array, FARTHEST
from rrth_planner.kernels import boxes as kernels
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.scene import Box


def boxes_of(names: Sequence[str], numbers: Array) -> tuple[Box, ...]:
    """
    Return boxes from their names and numbers, shape (n, 15), which are frozen by this.

    Raises
    ------
    SceneError
        Of the first that is no box.

    """
    numbers.setflags(write=False)
    bad = first_bad(numbers)
    if bad >= 0:
        row = numbers[bad]
        Box(names[bad], row[:SIZE], row[SIZE:ROTATION], row[ROTATION:].reshape(3, 3))
    return tuple(Box.of_row(name, row) for name, row in zip(names, numbers, strict=True))


def first_bad(numbers: Array) -> int:
    """Return which of some numbers, shape (n, 15), are the first that are no box; -1: none."""
    return int(kernels.first_bad(numbers, FARTHEST))
