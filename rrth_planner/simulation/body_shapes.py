# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the boxes of the wearer are filled with."""

from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.model.arrays import Array

# A capsule shorter than this is a sphere [m].
SHORTEST = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class BodyCapsule:
    """
    A capsule of a part of the wearer, in the frame of its box.

    Parameters
    ----------
    ends : ndarray, shape (2, 3)
        Of its line; the same twice: a sphere [m].
    radius : float
        > 0 [m].

    """

    ends: Array
    radius: float


@dataclass(frozen=True, slots=True, eq=False)
class BodyBox:
    """A box of a part of the wearer, of some size along its axes, (3,) [m]."""

    size: Array


def whole_box(size: Array) -> tuple[BodyBox, ...]:
    """Return a box of some size, (3,) [m], itself."""
    return (BodyBox(size),)


def capsules_within(size: Array) -> tuple[BodyCapsule, ...]:
    """
    Return capsules that fill a box of some size, (3,) [m], without reaching beyond it.

    They lie along its longest axis, are as thick as its shortest, and stand side by side along the
    third, the outermost in contact with its sides.
    """
    thin, middle, long = np.argsort(size, kind='stable')
    radius = 0.5 * float(size[thin])
    reach, width = 0.5 * float(size[long]) - radius, float(size[middle]) - 2.0 * radius
    n = 1 + math.ceil(width / (2.0 * radius) - 1e-9)
    found = []
    for place in np.linspace(-0.5, 0.5, n) * width if n > 1 else [0.0]:
        ends = np.zeros((2, 3))
        ends[:, middle] = place
        if reach > SHORTEST:
            ends[:, long] = [-reach, reach]
        found.append(BodyCapsule(ends, radius))
    return tuple(found)
