# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a request is planned from: the wearer, the target and the arm as they are now."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from rrth_planner.execution.executing_motion import (
    ExecutingMotion,
    LONGEST_LAG,
    predict_start_state,
    sharp_phase_of,
)
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import StartState
from rrth_planner.requests.parameters import RequestParameters


class ArmHasMoved(RequestError):
    """The arm is not at the start of the motion."""


@dataclass(frozen=True, slots=True, eq=False)
class InputSnapshot:
    """The inputs of one plan: a copy, which later messages do not change."""

    scene: Scene
    goal: PointingGoal
    joints: JointReading

    @property
    def q_start(self) -> Array:
        """Where the arm rests, shape (dof,) [rad]."""
        return self.joints.mean_positions()

    def require_rest(self, now: float, arm: ArmModel) -> None:
        """Raise ArmHasMoved where the arm moves at a time [s]."""
        joints = self.joints
        if joints.is_moving(now):
            expected = f'an arm at rest (at most {joints.rest_speed:g} {{unit}}, rest_speed)'
            raise _rejection(arm, joints.mean_velocities(), expected, ArmHasMoved)

    def is_commanded(self, running: ExecutingMotion | None, delay: float) -> bool:
        """Return whether the arm executes a motion, at most so much later than stated [s]."""
        joints = self.joints
        return running is not None and running.follows(
            joints.positions, joints.velocities, joints.taken, delay + LONGEST_LAG
        )

    def is_about_to_move(
        self, running: ExecutingMotion | None, now: float, span: float, delay: float = 0.0
    ) -> bool:
        """Return whether the arm rests within its motion, and moves on in less than a span [s]."""
        if running is None or self.joints.is_moving(now):
            return False
        if self.is_commanded(running, delay):
            return running.will_move(now, span)
        located = self._localize(running)
        if located is None:
            return False
        phase, rate = located
        then = running.start_time + phase + rate * (now - self.joints.taken)
        return running.will_move(then, rate * span)

    def start_state_at(
        self, running: ExecutingMotion | None, time: float, arm: ArmModel, delay: float = 0.0
    ) -> StartState:
        """
        Return the state of a moving arm at a time [s], or raise RequestError.

        It is the commanded one where the arm executes its motion, else predicted by its reading.
        """
        joints = self.joints
        if not np.isfinite(joints.velocities).all():
            raise _rejection(arm, joints.velocities, 'a velocity for every joint')
        known = None
        if (
            running is not None
            and running.start_time <= time
            and (joints.taken < running.start_time or self.is_commanded(running, delay))
        ):
            # The arm may lag, or was not on it yet: a stop, say, may just have been published.
            known = joints.taken - running.start_time, 1.0
        elif running is not None and not joints.is_moving(joints.taken):
            known = self._localize(running)
        try:
            # Velocities that overflow match no motion.
            with np.errstate(all='ignore'):
                return predict_start_state(
                    joints.positions,
                    joints.velocities,
                    None if running is None else running.trajectory,
                    time - joints.taken,
                    known,
                )
        except RrthError as problem:
            expected = f'a finite position {time - joints.taken:.3f} s later'
            raise _rejection(arm, joints.velocities, expected) from problem

    def _localize(self, running: ExecutingMotion) -> tuple[float, float] | None:
        """Return the time within a motion of an arm that hardly moves [s], and its rate."""
        joints = self.joints
        q, v = joints.positions, joints.velocities
        # An arm that executes its motion slowly may seem on time while it hardly moves.
        with np.errstate(all='ignore'):
            found = sharp_phase_of(q, v, running.trajectory)
        if found is None and running.is_on_time(q, v, joints.taken):
            # An arm at rest for a moment has no velocity to locate it by.
            found = joints.taken - running.start_time, 1.0
        return found


class Inputs(Protocol):
    """The latest good wearer, target and arm, as far as they are known."""

    def at(
        self, now: float, parameters: RequestParameters, goal: PointingGoal | None = None
    ) -> InputSnapshot:
        """
        Return the inputs of a plan that begins now [s]; without a goal, the last target.

        Raises
        ------
        RequestError
            Something is missing, too old (`parameters` have the timeouts) or rejected.

        """

    def scene_at(self, now: float, parameters: RequestParameters) -> Scene:
        """Return the present wearer [s], or raise RequestError where he is not known."""

    def joints_at(self, now: float, timeout: float) -> JointReading:
        """Return the present joint positions [s], or raise RequestError where there are none."""

    @property
    def reading(self) -> JointReading | None:
        """The last good one, however old."""

    def body_age(self, now: float) -> float:
        """Return how old the wearer is that is known now [s]; inf: that is not known."""

    def expected_scene(self) -> Scene:
        """Return where moving parts of the wearer will be soon; no box where that is unknown."""

    def is_wearer_moving(self) -> bool:
        """Return whether a box has moved lately by more than a tracker's noise."""

    def time_until_known(self, steady: float) -> float:
        """Return for how long it is not known whether he stands still; <= 0: it is known [s]."""


def _rejection(
    arm: ArmModel, velocities: Array, expected: str, kind: type[RequestError] = RequestError
) -> RequestError:
    speeds = np.abs(velocities)
    k = int(np.argmax(np.where(np.isnan(speeds), np.inf, speeds)))
    unit = f'{arm.units[k]}/s'
    expected = expected.format(unit=unit)
    sentence = f'{arm.joint_names[k]} moves at {speeds[k]:.3f} {unit}, expected {expected}'
    return kind(ErrorCode.START_STATE_INVALID, sentence)
