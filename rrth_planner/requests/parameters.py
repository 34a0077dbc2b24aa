# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What requests take of the parameters in effect."""

from pathlib import Path
from typing import Protocol

from rrth_planner.execution.watch import MonitorRules
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.planning.options import TreeOptions


class RequestParameters(MonitorRules, Protocol):
    """Those of a plan, of the monitor of its motion, and of what becomes of it."""

    @property
    def limits(self) -> MotionLimits:
        """Of motions."""

    @property
    def options(self) -> TreeOptions:
        """Of the search; with its time limit [s]."""

    @property
    def seed(self) -> int:
        """Of the search; -1: a new one each time."""

    @property
    def escape_depth(self) -> float:
        """A start so deep in the wearer is rejected [m]."""

    @property
    def reserve(self) -> float:
        """Clearance beyond the margin that a path is given where there is room [m]."""

    @property
    def start_tolerance(self) -> float:
        """Greatest distance of a joint from where its motion begins [rad]."""

    @property
    def joint_timeout(self) -> float:
        """Older joint positions are not taken [s]; 0: any are."""

    @property
    def patience(self) -> float:
        """So long after a stop the same goal is tried again [s]."""

    @property
    def incident_path(self) -> Path:
        """Where incidents and flight records are written."""

    @property
    def body_timeout(self) -> float:
        """An older body is not taken [s]; 0: any is."""

    @property
    def keep_lost(self) -> float:
        """How long a lost part stays where it was before the arm stops [s]."""

    @property
    def required_boxes(self) -> tuple[str, ...]:
        """Names of boxes, or of namespaces, without which a body is not taken."""

    @property
    def separates(self) -> str:
        """Whether commitments are published beside a wearer who moves: always, never, auto."""
