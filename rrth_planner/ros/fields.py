# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Fields that several messages share, checked and as arrays."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.errors import MessageError
from rrth_planner.rotation import rotation_matrix

# A quaternion this far from unit length is no rounding but a mistake.
QUATERNION_TOLERANCE = 1e-2
NANOSECONDS = 1_000_000_000


def numbers(values: Sequence[float], name: str, unit: str) -> Array:
    """Return numbers as an array, or raise MessageError when one is not finite."""
    if not all(math.isfinite(value) for value in values):
        raise MessageError(f'{name}: {list(values)}, expected finite numbers [{unit}]')
    return np.array(values, dtype=np.float64)


def position_of(point: Any, name: str) -> Array:
    """Return a geometry_msgs/Point, shape (3,) [m], or raise MessageError."""
    return numbers((point.x, point.y, point.z), name, 'm')


def rotation_of(quaternion: Any, name: str) -> Array:
    """Return the rotation of a geometry_msgs/Quaternion, shape (3, 3), or raise MessageError."""
    q = numbers((quaternion.x, quaternion.y, quaternion.z, quaternion.w), name, '-')
    norm = math.hypot(*q)
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        raise MessageError(
            f'{name}: {q.tolist()} of length {norm:.6g}, expected a quaternion (x, y, z, w) of '
            'length 1 [-]'
        )
    return rotation_matrix(q)


def seconds_of(time: Any) -> float:
    """Return a builtin_interfaces Time or Duration [s]."""
    return nanoseconds_of(time) / NANOSECONDS


def nanoseconds_of(time: Any) -> int:
    """Return a builtin_interfaces Time or Duration [ns]."""
    return int(time.sec) * NANOSECONDS + int(time.nanosec)
