# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of a rehearsed planner."""

from dataclasses import dataclass, fields
from pathlib import Path

from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.io.settings import PlanSettings, required_clearance
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.trajectory import MotionLimits

# As the planner node has them by default [rad], [s].
START_TOLERANCE, BODY_TIMEOUT, JOINT_TIMEOUT, PATIENCE = 0.002, 0.2, 0.2, 5.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RehearsedParameters(PlanSettings):
    """
    Those of the planner node that a rehearsal has; the others are as they are by default.

    Parameters
    ----------
    stop_limits : MotionLimits
        Of fail-safe stops.
    execution : ExecutionRules
        How a motion is executed.
    body_timeout, joint_timeout, keep_lost, patience : float
        [s].
    start_tolerance : float
        Greatest distance of a joint from where its motion begins [rad].

    """

    arm: ArmModel
    stop_limits: MotionLimits
    execution: ExecutionRules
    body_timeout: float
    joint_timeout: float
    keep_lost: float
    patience: float
    start_tolerance: float
    stands_still: bool = False
    replan: bool = True
    required_boxes: tuple[str, ...] = ()
    separates: str = 'true'

    @property
    def required(self) -> RequiredClearance:
        """What stays clear of the wearer."""
        return required_clearance(self.arm, self)

    @property
    def incident_path(self) -> Path:
        """Where nothing is written: a rehearsal writes no files."""
        return Path()


def rehearsed_parameters(
    settings: PlanSettings,
    arm: ArmModel,
    stop_limits: MotionLimits,
    execution: ExecutionRules,
    keep_lost: float,
) -> RehearsedParameters:
    """Return settings of plans as the parameters of a node; keep_lost [s]."""
    return RehearsedParameters(
        **{field.name: getattr(settings, field.name) for field in fields(settings)},
        arm=arm,
        stop_limits=stop_limits,
        execution=execution,
        body_timeout=BODY_TIMEOUT,
        joint_timeout=JOINT_TIMEOUT,
        keep_lost=keep_lost,
        patience=PATIENCE,
        start_tolerance=START_TOLERANCE,
    )
