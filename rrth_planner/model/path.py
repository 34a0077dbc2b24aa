# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Geometry without time: the waypoints of a path in joint space."""

from dataclasses import dataclass

from rrth_planner.kernels import vectors
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.frozen import Frozen


@dataclass(frozen=True, slots=True, eq=False)
class Path(Frozen):
    """Straight joint motions between one or more waypoints, array_like of shape (n, dof) [rad]."""

    waypoints: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        value = frozen_array(self.waypoints, (None, None), 'waypoints', 'rad', RrthError)
        if len(value) == 0:
            raise RrthError('waypoints: none, expected at least one [rad]')
        object.__setattr__(self, 'waypoints', value)

    @property
    def length(self) -> float:
        """Sum of the edge lengths in joint space [rad]."""
        return float(vectors.path_length(self.waypoints, len(self.waypoints)))
