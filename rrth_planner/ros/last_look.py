# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Before a motion is told: whether it still fits wearer and arm, who may have moved since."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rrth_planner.arm import reach_to
from rrth_planner.judges import is_proven_free, touch_seen
from rrth_planner.motion_plan import MotionPlan
from rrth_planner.ros.error_codes import ErrorCode
from rrth_planner.ros.inputs import Inputs, PlanInputs, RequestError
from rrth_planner.ros.parameters import PlannerParameters
from rrth_planner.ros.start import Start
from rrth_planner.scene import Scene
from rrth_planner.touch import Disagreement
from rrth_planner.world import arm_world

# A motion that starts further from the arm than this would begin with a jump [rad].
START_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class LastLook:
    """
    What a planned motion is held against once more, as often as need be.

    Parameters
    ----------
    heard : Inputs
        What is heard now.
    clock : callable
        Returns the present time [s].
    parameters : PlannerParameters
    inputs : PlanInputs
        What it was planned for.
    plan : MotionPlan
        With a motion.
    start : Start or None
        None: from rest.

    """

    heard: Inputs
    clock: Callable[[], float]
    parameters: PlannerParameters
    inputs: PlanInputs
    plan: MotionPlan
    start: Start | None

    def disagreement(self) -> tuple[Disagreement, Scene] | None:
        """
        Return what the two judges disagree about in the present world, and its wearer.

        None where they agree that the motion is still free. Raise RequestError where wearer or arm
        have moved so that it no longer fits.
        """
        now = self.clock()
        present = self.heard.at(now, self.parameters, self.inputs.goal)
        self._require_arm(present, now)
        if _is_same(present.scene, self.inputs.scene):
            return None
        return self._judge(present.scene)

    def _require_arm(self, present: PlanInputs, now: float) -> None:
        """Raise RequestError where the arm is not where the motion needs it."""
        inputs, start, arm = self.inputs, self.start, self.parameters.arm
        expected = inputs.q_start
        if start is None:
            present.require_rest(now, arm)
        else:
            expected = inputs.ahead(start.running, present.joints.taken, arm).state.positions
        moved = float(np.abs(present.q_start - expected).max())
        if not moved <= START_TOLERANCE:
            what = 'moved by' if start is None else 'is off its course by'
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the arm {what} {moved:.4f} rad while its motion was planned, expected at most '
                f'{START_TOLERANCE:g} rad',
            )

    def _judge(self, scene: Scene) -> tuple[Disagreement, Scene] | None:
        """Return what the judges disagree about, round a wearer; both must agree, as at first."""
        trajectory, escape_time = self.plan.trajectory, self.plan.escape_time
        assert trajectory is not None
        parameters = self.parameters
        arm, margin = parameters.arm, parameters.margin
        world = arm_world(arm, scene, margin, parameters.ray_guard_length)
        reach = reach_to(arm, self.inputs.goal.target, trajectory.positions[-1])
        if not is_proven_free(world, trajectory, reach, escape_time):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'the wearer moved while the motion was planned, and it is no longer proven free '
                'of the present body',
            )
        touch = touch_seen(arm, scene, world, trajectory, margin, reach, escape_time)
        if touch is None:
            return None
        return Disagreement(trajectory, touch, escape_time), scene


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
