# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Revalidation of a planned motion against the latest inputs, just before it is published."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.penetration import escape_depths
from rrth_planner.collision.trajectory_validation import is_proven_free
from rrth_planner.collision.violation import Disagreement
from rrth_planner.collision.world import world_of
from rrth_planner.execution.command import ahead
from rrth_planner.execution.decide import MARGIN_LEFT
from rrth_planner.execution.executing_motion import ExecutingMotion, FOLLOWS
from rrth_planner.execution.expected_wearer import is_expected_free
from rrth_planner.execution.handover import Handover, LEADS
from rrth_planner.execution.remaining_motion import is_place_free
from rrth_planner.execution.tracked_motion import OFF_COMMAND
from rrth_planner.model.arm import ArmModel, reach_to
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError
from rrth_planner.model.frozen import changed
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.host import Host
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.requests.inputs import ArmHasMoved, Inputs, InputSnapshot
from rrth_planner.requests.parameters import RequestParameters


@dataclass(frozen=True, slots=True, eq=False)
class Revalidation:
    """
    Checks a planned motion against wearer and arm as they are now; may be repeated.

    Parameters
    ----------
    inputs : Inputs
        The latest ones.
    host : Host
        Where the request runs.
    snapshot : InputSnapshot
        The inputs of the plan.
    plan : MotionPlan
        With a motion.
    handover : Handover or None
        None: from rest.
    running : ExecutingMotion or None
        The last commanded motion.

    """

    inputs: Inputs
    host: Host
    parameters: RequestParameters
    snapshot: InputSnapshot
    plan: MotionPlan
    handover: Handover | None
    running: ExecutingMotion | None

    async def disagreement(self) -> tuple[Disagreement, Scene] | None:
        """
        Return the violation that only the second checker finds, and in which scene.

        It is asked only where the wearer has moved. Raise RequestError where an input is stale or
        rejected, or the motion is no longer valid for the moved wearer.
        """
        present = self.inputs.at(self.host.now(), self.parameters, self.snapshot.goal)
        if np.array_equal(present.scene.numbers, self.snapshot.scene.numbers):
            return None
        scene = self.require_fit()
        parameters = self.parameters
        violation = await self.host.violation_seen(
            parameters.required,
            scene,
            self._motion,
            self._target_distance,
            self.plan.escape_time,
        )
        if violation is None:
            return None
        return Disagreement(self._motion, violation, self.plan.escape_time), scene

    def is_late(self) -> bool:
        """Return whether it is too late to publish the motion."""
        return self.handover is not None and self.host.now() > self.handover.deadline

    def require_fit(self) -> Scene:
        """
        Return the present wearer, of whom the motion is proven free.

        Raise RequestError where it is not, or begins where he will be soon, or where the arm is
        not at the start of the motion.
        """
        now = self.host.now()
        present = self.inputs.at(now, self.parameters, self.snapshot.goal)
        self._require_arm(present, now)
        if not np.array_equal(present.scene.numbers, self.snapshot.scene.numbers):
            self._require_proof(present.scene)
        self._require_clear(present)
        self._require_room()
        return present.scene

    def _require_arm(self, present: InputSnapshot, now: float) -> None:
        """Raise ArmHasMoved where the arm is not at the start of the motion."""
        snapshot, handover, arm = self.snapshot, self.handover, self.parameters.required.arm
        delay = self.parameters.execution.controller_delay
        expected, what = snapshot.q_start, 'moved by'
        place, tolerance = present.q_start, self.parameters.start_tolerance
        if handover is None:
            present.require_rest(now, arm)
            if present.is_about_to_move(self.running, now, LEADS[0] + ahead(delay), delay):
                raise ArmHasMoved(
                    ErrorCode.START_STATE_INVALID,
                    'the arm has begun its commanded motion, expected an arm at rest',
                )
        elif handover.is_commanded:
            assert handover.running is not None
            joints = present.joints
            aside = handover.running.deviation(joints.positions, joints.taken, delay)
            if not aside <= FOLLOWS:
                raise ArmHasMoved(
                    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                    f'the arm is {aside:.4f} rad (or m) from what it was commanded within the '
                    f'last {delay:g} s (controller_delay), expected at most {FOLLOWS:g}',
                )
            return
        else:
            what = 'deviates from its trajectory by'
            expected = snapshot.start_state_at(
                handover.running, present.joints.taken, arm, delay
            ).state.positions
            place = present.joints.positions
        moved, joint, unit = _farthest(arm, place - expected)
        # A motion that starts further from the arm would begin with a jump.
        if not moved <= tolerance:
            raise ArmHasMoved(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the arm {what} {moved:.4f} {unit} ({joint}) while its motion was planned, '
                f'expected at most {tolerance:g} {unit} (start_tolerance)',
            )
        aside, joint, unit = _farthest(arm, present.q_start - self._motion.positions[0])
        if handover is None and not aside <= OFF_COMMAND:
            raise ArmHasMoved(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'{joint} rests {aside:.4f} {unit} from what it is commanded, expected at most '
                f'{OFF_COMMAND:g} {unit}',
            )

    def _require_clear(self, present: InputSnapshot) -> None:
        """Raise RequestError where the arm, beside what it is commanded, is near the wearer."""
        required = self.parameters.required
        left = MARGIN_LEFT * required.margin
        if self.plan.escape_time == 0.0 and not is_place_free(
            present.joints.positions, changed(required, margin=left), present.scene
        ):
            raise RequestError(
                ErrorCode.START_STATE_IN_COLLISION,
                f'the arm is nearer than {left:g} m to the wearer where it is, beside what it is '
                'commanded',
            )

    def _require_proof(self, scene: Scene) -> None:
        """Raise RequestError where the motion is not proven free of a wearer."""
        parameters = self.parameters
        world = world_of(parameters.required, scene)
        escape_time = self.plan.escape_time
        is_too_deep = (
            escape_time > 0.0
            and escape_depths(world, self._motion.positions[0])[0].max() >= parameters.escape_depth
        )
        if is_too_deep or not is_proven_free(
            world, self._motion, parameters.required.margin, self._target_distance, escape_time
        ):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'the wearer moved while the motion was planned: it is not proven free of the '
                'present body',
            )

    def _require_room(self) -> None:
        """Raise RequestError where a moving part is about to come into the way of the motion."""
        motion = ExecutingMotion(
            trajectory=self._motion, start_time=0.0, escape_time=self.plan.escape_time
        )
        required, expected = self.parameters.required, self.inputs.expected_scene()
        if not is_expected_free(motion, 0.0, required, expected):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'the wearer is about to move into the path of the arm',
            )

    @property
    def _motion(self) -> Trajectory:
        trajectory = self.plan.trajectory
        assert trajectory is not None
        return trajectory

    @property
    def _target_distance(self) -> float:
        target = self.snapshot.goal.target
        return reach_to(self.parameters.required.arm, target, self._motion.positions[-1])


def _farthest(arm: ArmModel, gaps: Array) -> tuple[float, str, str]:
    """Return the greatest of the joints' gaps, (dof,), whose it is, and its unit."""
    k = int(np.abs(gaps).argmax())
    return abs(float(gaps[k])), arm.joint_names[k], arm.units[k]
