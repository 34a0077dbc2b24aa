# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The latest good body, target and joint positions, and the last rejections."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
import time
from typing import Any, Generic, TypeVar

import numpy as np
from rrth_planner.execution.executing_motion import (
    ExecutingMotion,
    LONGEST_LAG,
    predict_start_state,
    sharp_phase_of,
)
from rrth_planner.execution.expected_wearer import expected_scene
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, RequestError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import REST_SPEED, StartState
from rrth_planner.ros.interface.parameters import AUTO, PlannerParameters
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.body_source import BodySource
from rrth_planner.ros.messages.error_codes import code_of_rejection

T = TypeVar('T')
# A message measured further ahead of now than this came before the clock was set back: its age is
# unknown [s].
CLOCK_STEP = 0.1
# A wearer moves whose boxes have changed by so much [m] within so long [s]; of so many bodies.
MOVED, LATELY, REMEMBERED = 0.01, 0.25, 64
# Velocities are those of this time at least: what a tracker's noise adds is small then [s].
STEADY = 0.08

# Why a body that was sent once is not taken as that of a wearer who stands still.
STREAM_ENDED = ', since a stream of bodies, or one with a stamp, has come (separation: auto)'


class ArmHasMoved(RequestError):
    """The arm is not at the start of the motion."""


class Input(Generic[T]):
    """The last good value of one topic, when it was measured [s], and the last rejection."""

    def __init__(self, topic: str, empty: T) -> None:
        """Begin with an empty value; the resolved name of the topic is for messages."""
        self.topic = topic
        self.value = empty
        self.measured: float | None = None
        self.n_good, self.n_rejected = 0, 0
        self.rejection: MessageError | None = None
        self.is_last_rejected = False

    def accept(self, read: Callable[[], T], measured: float, is_news: bool = True) -> bool:
        """
        Take what `read` returns, measured at a time [s]; return False where that raises.

        is_news: False where a newer message came before; then the age does not change, and a
        rejection of the newer one stands.
        """
        try:
            self.value = read()
        except MessageError as problem:
            self._reject(problem)
            return False
        except Exception as problem:
            what = f'{type(problem).__name__}: {problem}'
            self._reject(MessageError(f'it could not be read: {what}'))
            raise
        self.n_good += 1
        if is_news or self.measured is None:
            self.measured = measured
        if is_news:
            self.is_last_rejected = False
        return not self.is_last_rejected

    def _reject(self, problem: MessageError) -> None:
        self.n_rejected += 1
        self.rejection, self.is_last_rejected = problem, True

    def age(self, now: float) -> float:
        """Return the age of the last good message; inf before it, or where unknown [s]."""
        if self.measured is None or now < self.measured - CLOCK_STEP:
            return float('inf')
        return max(0.0, now - self.measured)

    def overdue(self, now: float, timeout: float) -> str:
        """Return, where the last good message is older than a timeout [s], how old; else ''."""
        age = self.age(now)
        return f'{age:.3f} s old, expected at most {timeout:g}' if 0.0 < timeout < age else ''


@dataclass(frozen=True, slots=True, eq=False)
class InputSnapshot:
    """The inputs of one plan: a copy, which later messages do not change."""

    scene: Scene
    goal: PointingGoal
    joints: JointReading
    rest_speed: float = REST_SPEED

    @property
    def q_start(self) -> Array:
        """Where the arm rests, shape (dof,) [rad]."""
        return self.joints.mean_positions(self.rest_speed)

    def is_moving(self, now: float) -> bool:
        """Return whether the arm moves at a time [s]."""
        return self.joints.is_moving(now, self.rest_speed)

    def require_rest(self, now: float, arm: ArmModel) -> None:
        """Raise ArmHasMoved where the arm moves at a time [s]."""
        if self.is_moving(now):
            expected = f'an arm at rest (at most {self.rest_speed:g} rad/s, rest_speed)'
            velocities = self.joints.mean_velocities(self.rest_speed)
            raise _rejection(arm, velocities, expected, ArmHasMoved)

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
        if running is None or self.is_moving(now):
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
        elif running is not None and not self.is_moving(joints.taken):
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


def _rejection(
    arm: ArmModel, velocities: Array, expected: str, kind: type[RequestError] = RequestError
) -> RequestError:
    speeds = np.abs(velocities)
    k = int(np.argmax(np.where(np.isnan(speeds), np.inf, speeds)))
    speed = f'{speeds[k]:.3f} {"m/s" if arm.is_prismatic[k] else "rad/s"}'
    sentence = f'{arm.joint_names[k]} moves at {speed}, expected {expected}'
    return kind(ErrorCode.START_STATE_INVALID, sentence)


class Inputs:
    """The three topics that a plan needs."""

    def __init__(self, body_topic: str, target_topic: str, joint_topic: str) -> None:
        """Begin without a message."""
        self.body = Input(body_topic, WearerBody())
        self.source = BodySource()
        self.target: Input[PointingGoal | None] = Input(target_topic, None)
        self.joints: Input[JointReading | None] = Input(joint_topic, None)
        # Why the last message with all joints was rejected; None: it was not.
        self.joint_rejection: MessageError | None = None
        # The last bodies, and when they came by the monotonic clock [s].
        self._bodies: deque[tuple[float, WearerBody]] = deque(maxlen=REMEMBERED)

    def shift(self, step: float) -> None:
        """Take the times of all inputs by a clock that was set forward by a step [s]."""
        self.body.value = self.body.value.shifted(step)
        if self.joints.value is not None:
            self.joints.value = self.joints.value.shifted(step)
        for source in self.all.values():
            if source.measured is not None:
                source.measured += step

    def body_came(self) -> None:
        """Remember the present body, to see whether the wearer moves."""
        bodies = self._bodies
        # Each part may come by itself, in a message of its own: of many bodies a few are enough.
        if len(bodies) > 1 and bodies[-1][0] - bodies[-2][0] < LATELY / REMEMBERED:
            bodies.pop()
        bodies.append((time.monotonic(), self.body.value))

    def is_wearer_moving(self) -> bool:
        """Return whether a box has moved lately by more than a tracker's noise."""
        since = time.monotonic() - LATELY
        bodies = [body for came, body in tuple(self._bodies) if came >= since]
        if len(bodies) < 2:
            return False
        now, before = scene_of(bodies[-1]).numbers, scene_of(bodies[0]).numbers
        return now.shape != before.shape or bool(np.abs(now - before).max(initial=0.0) > MOVED)

    def expected_scene(self) -> Scene:
        """Return where moving parts of the wearer will be soon; no box where that is unknown."""
        bodies = tuple(self._bodies)
        if not bodies or time.monotonic() - bodies[-1][0] > LATELY:
            return Scene(())
        came, present = bodies[-1]
        for then, before in reversed(bodies):
            if STEADY <= came - then <= LATELY:
                return expected_scene(scene_of(before), scene_of(present), came - then)
        return Scene(())

    @property
    def all(self) -> dict[str, Input[Any]]:
        """The inputs by their names in diagnostics."""
        return {'body': self.body, 'target': self.target, 'joints': self.joints}

    def at(
        self, now: float, parameters: PlannerParameters, goal: PointingGoal | None = None
    ) -> InputSnapshot:
        """
        Return the inputs of a plan that begins now [s]; without a goal, the last target.

        Raises
        ------
        RequestError
            Something is missing, too old (`parameters` have the timeouts) or rejected.

        """
        body = self.body_at(now, parameters)
        goal = self._goal() if goal is None else goal
        joints = self.joints_at(now, parameters.joint_timeout)
        return InputSnapshot(scene_of(body), goal, joints, parameters.rest_speed)

    def body_at(
        self, now: float, parameters: PlannerParameters, keep_lost: float = 0.0
    ) -> WearerBody:
        """
        Return the present body [s], or raise RequestError where it is stale, rejected or partial.

        keep_lost: how long a lost part may stay where it was [s].
        """
        source, code = self.body, ErrorCode.SENSOR_INFO_STALE
        _require(source, 'body', 'a visualization_msgs/MarkerArray with the wearer')
        if source.is_last_rejected:
            # An earlier body says nothing about the present one.
            raise _rejected(source, source.rejection, code)
        body = source.value.at(now)
        lost = body.lost_names(now - keep_lost) if body.lost else ''
        if lost:
            raise RequestError(
                code,
                f'the body on {source.topic} has lost parts: {lost}; expected each of them to be '
                'published again or deleted by name (DELETE; while a motion runs it takes effect '
                'after keep_lost)',
            )
        if body.n_boxes == 0 and not body.lost:
            raise RequestError(
                ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
                f'the body on {source.topic} is empty: every box was deleted; expected at '
                'least one box of the wearer',
            )
        wanted = parameters.required_boxes
        missing = body.without(wanted) if wanted else ()
        if missing:
            raise RequestError(
                ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
                f'the body on {source.topic} has no box {", ".join(missing)}, expected each of '
                'required_boxes',
            )
        late = source.overdue(now, parameters.body_timeout)
        if late:
            why = STREAM_ENDED if parameters.separates == AUTO else ''
            raise _late(source, f'{late} s (body_timeout){why}', code)
        return body

    def require_fresh(self, now: float, parameters: PlannerParameters) -> WearerBody:
        """Return the present body [s] for a motion in progress; raise RequestError if stale."""
        self.joints_at(now, parameters.joint_timeout)
        return self.body_at(now, parameters, parameters.keep_lost)

    def joints_at(self, now: float, timeout: float) -> JointReading:
        """Return the present joint positions [s], or raise RequestError where there are none."""
        rejection = self.joint_rejection
        if rejection is not None:
            # Earlier positions say nothing about the present ones.
            raise _rejected(self.joints, rejection, ErrorCode.ROBOT_STATE_STALE)
        joints: JointReading = _require(
            self.joints, 'joint positions', 'a sensor_msgs/JointState with every joint'
        )
        late = self.joints.overdue(now, timeout)
        if late:
            raise _late(self.joints, f'{late} s (joint_timeout)', ErrorCode.ROBOT_STATE_STALE)
        return joints

    def _goal(self) -> PointingGoal:
        rejection = self.target.rejection
        if self.target.is_last_rejected and rejection is not None:
            # The target before it is not the requested one.
            code = code_of_rejection(rejection, ErrorCode.INVALID_GOAL_CONSTRAINTS)
            raise _rejected(self.target, rejection, code)
        return _require(self.target, 'target', 'a geometry_msgs/PointStamped')


def _require(source: Input[Any], what: str, expected: str) -> Any:
    if source.measured is not None:
        return source.value
    if source.rejection is None:
        raise RequestError(
            ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
            f'no {what} yet on {source.topic}, expected {expected}',
        )
    raise RequestError(
        code_of_rejection(source.rejection, ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA),
        f'no good {what} yet on {source.topic}; the last of {source.n_rejected} rejected '
        f'messages: {source.rejection}',
    )


def _rejected(source: Input[Any], why: MessageError | None, code: ErrorCode) -> RequestError:
    return RequestError(code, f'the last message on {source.topic} was rejected: {why}')


def _late(source: Input[Any], age: str, code: ErrorCode) -> RequestError:
    return RequestError(code, f'the last good message on {source.topic} is {age}')
