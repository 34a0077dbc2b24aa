# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""`PlanningProcess` without a process: the caller plans."""

from collections.abc import Callable
from dataclasses import replace
import gc

from rrth_planner.collision.trajectory_validation import violation_seen
from rrth_planner.model.arm import ArmModel
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_question, warm_up
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import TreeOptions


class InProcessPlanner:
    """Plans, and asks the second collision checker; the methods are those of `Planner`."""

    violation_seen = staticmethod(violation_seen)

    def warm_up(self, arm: ArmModel, options: TreeOptions, second_checker: str = 'fcl') -> None:
        """Compile and load everything for an arm, options and a second checker."""
        warm_up(arm, options, second_checker)
        # Loaded objects live as long as the process: the collector skips them.
        gc.collect()
        gc.freeze()

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """Return what `plan_question` returns, without the search behind it."""
        return replace(plan_question(question, should_stop), search=None)

    def close(self) -> None:
        """Do nothing."""
