# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Before a motion is told: whether it still fits wearer and arm, who may have moved since."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.penetration import box_depths
from rrth_planner.collision.trajectory_validation import is_proven_free, violation_seen
from rrth_planner.collision.violation import Disagreement
from rrth_planner.collision.world import arm_world, World
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.arm import reach_to
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.ros.interface.inputs import ArmHasMoved, Inputs, PlanInputs, RequestError
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.error_codes import ErrorCode
from rrth_planner.ros.messages.joint_state import JointReading
from rrth_planner.ros.requests.handover import LEADS, Start

# A motion that starts further from the arm than this would begin with a jump [rad].
START_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """
    What a motion was held against.

    Parameters
    ----------
    body : WearerBody
        As it was heard.
    joints : JointReading
    scene : Scene
        Its boxes.
    disagreement : Disagreement or None
        What one judge has against the motion and the other has not.

    """

    body: WearerBody
    joints: JointReading
    scene: Scene
    disagreement: Disagreement | None


@dataclass(frozen=True, slots=True, eq=False)
class Revalidation:
    """
    Holds a planned motion against wearer and arm as they are by now, as often as need be.

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
    running : ExecutingMotion or None
        The motion that the arm was last told to follow.
    should_stop : callable
        Polled between and while the judges look; what it says is for the caller to ask.

    """

    heard: Inputs
    clock: Callable[[], float]
    parameters: PlannerParameters
    inputs: PlanInputs
    plan: MotionPlan
    start: Start | None
    running: ExecutingMotion | None
    should_stop: Callable[[], bool]

    def take(self) -> Seen:
        """
        Return what is seen; the judges are asked where the wearer has moved.

        Raise RequestError where wearer or arm have moved so that the motion no longer fits.
        """
        now, body = self.clock(), self.heard.body.value
        present = self.heard.at(now, self.parameters, self.inputs.goal)
        self._require_arm(present, now)
        scene = present.scene
        if _is_same(scene, self.inputs.scene):
            return Seen(body, present.joints, scene, None)
        self.should_stop()
        world = self._require_proof(scene)
        self.should_stop()
        motion, escape_time = self._motion, self.plan.escape_time
        parameters = self.parameters
        touch = violation_seen(
            parameters.arm,
            scene,
            world,
            motion,
            parameters.margin,
            self._reach,
            escape_time,
            pause=self.should_stop,
        )
        found = None if touch is None else Disagreement(motion, touch, escape_time)
        return Seen(body, present.joints, scene, found)

    def is_late(self, ahead: float = 0.0) -> bool:
        """Return whether it is too late to tell the motion, or will be so much later [s]."""
        return self.start is not None and self.clock() + ahead > self.start.latest

    def still_fits(self, seen: Seen, is_last: bool) -> bool:
        """
        Return whether a motion may be told that fitted what was seen a moment ago.

        Not when it is too late, nor when the body has changed since. After the last look the
        certificate alone decides about that body: it is quick, and a lock is held. Raise
        RequestError where it does not prove the motion free, or the arm has moved.
        """
        now, body = self.clock(), self.heard.body.value
        present = self.heard.at(now, self.parameters, self.inputs.goal)
        if present.joints is not seen.joints:
            self._require_arm(present, now)
        if body is not seen.body and not _is_same(present.scene, seen.scene):
            if not is_last:
                return False
            self._require_proof(present.scene)
        return not self.is_late()

    def _require_arm(self, present: PlanInputs, now: float) -> None:
        """Raise ArmHasMoved where the arm is not where the motion needs it."""
        inputs, start, arm = self.inputs, self.start, self.parameters.arm
        expected = inputs.q_start
        if start is None:
            present.require_rest(now, arm)
            if present.pauses(self.running, now, LEADS[0]):
                raise ArmHasMoved(
                    ErrorCode.START_STATE_INVALID,
                    'the arm has begun the motion that it was told, expected an arm at rest',
                )
        else:
            expected = inputs.ahead(start.running, present.joints.taken, arm).state.positions
        moved = float(np.abs(present.q_start - expected).max())
        if not moved <= START_TOLERANCE:
            what = 'moved by' if start is None else 'is off its course by'
            raise ArmHasMoved(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the arm {what} {moved:.4f} rad while its motion was planned, expected at most '
                f'{START_TOLERANCE:g} rad',
            )

    def _require_proof(self, scene: Scene) -> World:
        """Return the world of a wearer, or raise RequestError where the motion is not free."""
        parameters = self.parameters
        world = arm_world(parameters.arm, scene, parameters.margin, parameters.ray_guard_length)
        escape_time = self.plan.escape_time
        is_too_deep = (
            escape_time > 0.0
            and box_depths(world, self._motion.positions[0]).max() >= parameters.escape_depth
        )
        if is_too_deep or not is_proven_free(world, self._motion, self._reach, escape_time):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'the wearer moved while the motion was planned, and it is no longer proven free '
                'of the present body',
            )
        return world

    @property
    def _motion(self) -> Trajectory:
        trajectory = self.plan.trajectory
        assert trajectory is not None
        return trajectory

    @property
    def _reach(self) -> float:
        target = self.inputs.goal.target
        return reach_to(self.parameters.arm, target, self._motion.positions[-1])


def require_news(catch_up: Callable[[], bool]) -> None:
    """Wait until the bodies that came are heard, or raise RequestError."""
    if not catch_up():
        raise busy()


def busy() -> RequestError:
    """Return what is said where bodies that came cannot be heard in time."""
    return RequestError(
        ErrorCode.SENSOR_INFO_STALE,
        'the node is busy: the bodies that came while the motion was planned are not read yet',
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
