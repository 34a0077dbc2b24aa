# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The latest good body, target and joint positions, and the last rejections."""

from collections.abc import Callable
import time
from typing import Any, Generic, TypeVar

from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.recent_wearer import RecentWearer
from rrth_planner.model.errors import MessageError, RequestError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.requests.inputs import InputSnapshot
from rrth_planner.requests.parameters import RequestParameters
from rrth_planner.ros.interface.parameters import AUTO
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.body_source import BodySource
from rrth_planner.ros.messages.error_codes import code_of_rejection

T = TypeVar('T')
# A message measured further ahead of now than this came before the clock was set back: its age is
# unknown [s].
CLOCK_STEP = 0.1
# Why a body that was sent once is not taken as that of a wearer who stands still.
STREAM_ENDED = ', since a stream of bodies, or one with a stamp, has come (separation: auto)'


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
        # By the monotonic clock.
        self._recent = RecentWearer(scene_of)

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
        self._recent.saw(self.body.value, time.monotonic())

    def is_wearer_moving(self) -> bool:
        """Return whether a box has moved lately by more than a tracker's noise."""
        return self._recent.is_moving(time.monotonic())

    def expected_scene(self) -> Scene:
        """Return where moving parts of the wearer will be soon; no box where that is unknown."""
        return self._recent.expected(time.monotonic())

    def body_age(self, now: float) -> float:
        """Return how old the wearer is that is known now [s]; inf: that is not known."""
        return self.body.age(now)

    def time_until_known(self, steady: float) -> float:
        """Return for how long it is not known whether he stands still; <= 0: it is known [s]."""
        return self.source.time_until_known(steady)

    @property
    def reading(self) -> JointReading | None:
        """The last good joint positions, however old."""
        return self.joints.value

    @property
    def all(self) -> dict[str, Input[Any]]:
        """The inputs by their names in diagnostics."""
        return {'body': self.body, 'target': self.target, 'joints': self.joints}

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
        scene = self.scene_at(now, parameters)
        goal = self._goal() if goal is None else goal
        joints = self.joints_at(now, parameters.joint_timeout)
        return InputSnapshot(scene, goal, joints)

    def scene_at(self, now: float, parameters: RequestParameters) -> Scene:
        """Return the present wearer [s], or raise RequestError where he is not known."""
        return scene_of(self.body_at(now, parameters))

    def body_at(
        self, now: float, parameters: RequestParameters, keep_lost: float = 0.0
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

    def require_fresh(self, now: float, parameters: RequestParameters) -> WearerBody:
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
