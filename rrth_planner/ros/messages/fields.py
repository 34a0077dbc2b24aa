# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Fields that several messages share, checked and as arrays."""

from collections.abc import Sequence
import math
from typing import Any

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError
from rrth_planner.model.stamp import NANOSECONDS

# When a message was sent: source timestamp [ns] and sequence number.
Stamp = tuple[int, int]

# A quaternion this far from unit length is no rounding but a mistake.
QUATERNION_TOLERANCE = 1e-2


def numbers(values: Sequence[float], name: str, unit: str) -> Array:
    """Return numbers as an array, or raise MessageError when one is not finite."""
    if not all(math.isfinite(value) for value in values):
        raise MessageError(f'{name}: {list(values)}, expected finite numbers [{unit}]')
    return np.array(values, dtype=np.float64)


def triple_of(vector: Any, name: str) -> tuple[float, float, float]:
    """Return a geometry_msgs/Point or Vector3 [m], or raise MessageError."""
    x, y, z = vector.x, vector.y, vector.z
    # Finite where all three are, but for a sum that overflows.
    if not math.isfinite(x + y + z):
        numbers((x, y, z), name, 'm')
    return x, y, z


def unit_quaternion_of(quaternion: Any, name: str) -> tuple[float, float, float, float]:
    """Return a geometry_msgs/Quaternion of length 1, as it came, or raise MessageError."""
    q = x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    if not math.isfinite(x + y + z + w):
        numbers(q, name, '-')
    norm = math.hypot(x, y, z, w)
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        raise MessageError(
            f'{name}: {list(q)} of length {norm:.6g}, expected a quaternion (x, y, z, w) of '
            'length 1 [-]'
        )
    return q


def seconds_of(time: Any) -> float:
    """Return a builtin_interfaces Time or Duration [s]."""
    return nanoseconds_of(time) / NANOSECONDS


def nanoseconds_of(time: Any) -> int:
    """Return a builtin_interfaces Time or Duration [ns]."""
    return int(time.sec) * NANOSECONDS + int(time.nanosec)
