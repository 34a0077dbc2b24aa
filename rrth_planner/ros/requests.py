# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One request: from what was heard to an outcome with a code, whatever happens."""

from collections.abc import Callable
from dataclasses import dataclass
import secrets

import numpy as np
from rrth_planner.arm import tool_pose
from rrth_planner.arrays import Array
from rrth_planner.certificate import certify
from rrth_planner.fcl_check import first_touch
from rrth_planner.goal import PointingGoal
from rrth_planner.pipeline import MotionPlan, plan_motion
from rrth_planner.ros.error_codes import CODE_OF_STATUS, ErrorCode
from rrth_planner.ros.inputs import Inputs, PlanInputs, RequestError
from rrth_planner.ros.parameters import PlannerParameters
from rrth_planner.scene import Scene
from rrth_planner.trajectory import Trajectory
from rrth_planner.world import arm_world

# A motion that starts further from the arm than this would begin with a jump [rad].
START_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PlanOutcome:
    """How a request ended: code, sentence, and the plan and its inputs where there was one."""

    code: ErrorCode
    sentence: str
    plan: MotionPlan | None = None
    inputs: PlanInputs | None = None

    @property
    def trajectory(self) -> Trajectory | None:
        """The motion to publish; None unless the request succeeded."""
        if self.plan is None or self.code is not ErrorCode.SUCCESS:
            return None
        return self.plan.trajectory


def plan_request(
    heard: Inputs,
    parameters: PlannerParameters,
    clock: Callable[[], float],
    should_stop: Callable[[], bool],
    goal: PointingGoal | None = None,
) -> PlanOutcome:
    """
    Return the outcome of a request that begins now.

    Parameters
    ----------
    heard : Inputs
        What a plan begins with is copied from here at once; at the end it is looked at again.
    parameters : PlannerParameters
    clock : callable
        Returns the present time [s].
    should_stop : callable
        Polled while planning; True cancels.
    goal : PointingGoal, optional
        Of the request; without, the last target.

    """
    try:
        now = clock()
        inputs = heard.at(now, parameters, goal)
        inputs.require_rest(now, parameters.arm)
        if should_stop():
            raise RequestError(ErrorCode.PREEMPTED, 'the request was cancelled before its turn')
        plan = plan_motion(
            parameters.arm,
            inputs.scene,
            inputs.q_start,
            inputs.goal,
            parameters.limits,
            parameters.options,
            margin=parameters.margin,
            ray_guard_length=parameters.ray_guard_length,
            seed=secrets.randbelow(2**31) if parameters.seed < 0 else parameters.seed,
            should_stop=should_stop,
        )
        code = CODE_OF_STATUS[plan.status]
        if plan.trajectory is not None and code is ErrorCode.SUCCESS:
            if should_stop():
                raise RequestError(ErrorCode.PREEMPTED, 'the request was cancelled')
            _check_present(heard, parameters, clock(), inputs, plan.trajectory)
        return PlanOutcome(code, plan.sentence, plan, inputs)
    except RequestError as problem:
        return PlanOutcome(problem.code, str(problem))


def _check_present(
    heard: Inputs,
    parameters: PlannerParameters,
    now: float,
    inputs: PlanInputs,
    trajectory: Trajectory,
) -> None:
    """Raise RequestError where wearer or arm have moved so that the motion no longer fits."""
    present = heard.at(now, parameters, inputs.goal)
    moved = float(np.abs(present.q_start - inputs.q_start).max())
    if not moved <= START_TOLERANCE:
        raise RequestError(
            ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
            f'the arm moved by {moved:.4f} rad while its motion was planned, expected at most '
            f'{START_TOLERANCE:g} rad',
        )
    present.require_rest(now, parameters.arm)
    if _is_same(present.scene, inputs.scene):
        return
    world = arm_world(
        parameters.arm, present.scene, parameters.margin, parameters.ray_guard_length
    )
    q_end: Array = trajectory.positions[-1]
    reach = float(np.linalg.norm(inputs.goal.target - tool_pose(parameters.arm, q_end)[:3, 3]))
    # Both judges must agree, as they had to when it was planned.
    if not (
        world.is_valid(q_end, reach)
        and certify(trajectory, world).is_proven
        and first_touch(
            parameters.arm, present.scene, trajectory, parameters.margin, world.ray_length, reach
        )
        is None
    ):
        raise RequestError(
            ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
            'the wearer moved while the motion was planned, and it is no longer proven free of '
            'the present body',
        )


def _is_same(one: Scene, other: Scene) -> bool:
    return len(one.boxes) == len(other.boxes) and all(
        a is b
        or (
            np.array_equal(a.center, b.center)
            and np.array_equal(a.size, b.size)
            and np.array_equal(a.rotation, b.rotation)
        )
        for a, b in zip(one.boxes, other.boxes, strict=True)
    )
