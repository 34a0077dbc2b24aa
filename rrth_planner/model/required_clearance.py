# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What has to stay clear of the wearer."""

from dataclasses import dataclass

from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import FARTHEST, float_number
from rrth_planner.model.errors import check_type, OptionsError


@dataclass(frozen=True, slots=True)
class RequiredClearance:
    """
    The arm, the clearance that it keeps, and how much of its pointing ray counts.

    Two that are equal have the same arm, not another one that is like it.

    Parameters
    ----------
    margin : float
        Clearance from every box, from 0 to 1e4 [m].
    ray_guard_length : float
        Length of the pointing ray kept clear in motion, from 0 to 1e4 [m].
    library : str
        Behind the second collision check, one of `distance_library.LIBRARIES`.

    Raises
    ------
    OptionsError
        A number out of its range.

    """

    arm: ArmModel
    margin: float
    ray_guard_length: float
    library: str = 'fcl'

    def __post_init__(self) -> None:
        """Validate."""
        check_type(self.arm, ArmModel, 'arm')
        for name in ('margin', 'ray_guard_length'):
            value = float_number(getattr(self, name), name, 'm', 0.0, FARTHEST, OptionsError)
            object.__setattr__(self, name, value)
