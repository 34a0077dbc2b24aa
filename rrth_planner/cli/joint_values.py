# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An option with a value for each joint."""

from collections.abc import Sequence

from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import OptionsError


def joint_values(given: Sequence[float], option: str, joint_names: Sequence[str]) -> Array:
    """Return an option's value for each joint, (dof,) [rad or m], or raise OptionsError."""
    n = len(joint_names)
    if len(given) != n:
        raise OptionsError(
            f'{option}: {len(given)} values, expected {n}, one for each of {list(joint_names)} '
            '[rad or m]'
        )
    return frozen_array(given, (n,), option, 'rad or m', OptionsError)
