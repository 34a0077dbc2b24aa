# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Clients of a planner: nodes that publish body and target, request motions, follow the arm."""

import asyncio
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import suppress
from functools import partial
import time
from typing import Any, TypeVar
import warnings

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.separation_status import SeparationStatus
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import MessageError, one_line, RrthError
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import REST_SPEED, Trajectory
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.interface.parameters import (
    declared,
    parameters_from_values,
    PlannerParameters,
)
from rrth_planner.ros.interface.separation_status import separation_from_msg
from rrth_planner.ros.messages.answer import answer_from_msg, answer_from_text
from rrth_planner.ros.messages.diagnostics import GIVEN_UP_KEY, REQUEST_KEY
from rrth_planner.ros.messages.fields import nanoseconds_of
from rrth_planner.ros.messages.joint_state import (
    configuration_from_msg,
    gaps_between,
    joint_reading,
)
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription
from rrth_planner.ros.middleware.parameter_declaration import ARM
from rrth_planner.ros.middleware.qos import ANSWERED, LATCHED, SERVICE
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

T = TypeVar('T')
# What is waited for, and its name, one after the other, until something comes of it.
Waits = Generator[tuple[Callable[[], bool], str], None, T]
NODE = 'rrth_planner'
# What a client sends.
TOPICS = {MarkerArray: 'body_boxes', PointStamped: 'target'}
# Codes of a planner that lacks an input, or a recent one: that may come a moment later.
LACKS_INPUT = (
    ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA,
    ErrorCode.SENSOR_INFO_STALE,
    ErrorCode.ROBOT_STATE_STALE,
)
# The figures of an answer come before it, by another way; they are waited for so long [s], and so
# many answers, those to others included, are remembered.
LONGEST_FIGURES, REMEMBERED = 1.0, 1000
# Between two requests to a planner that lacks an input [s].
PAUSE = 0.3
# What changes nothing is asked for again where no answer has come for so long [s].
ASK_AGAIN = 2.0
# Acknowledgements are waited for so long at a time [s].
ACKNOWLEDGED = 0.01
# Pause between two looks for messages while other tasks run [s].
POLLED = 0.005
# A wearer who stands still is published so often [s].
STANDING = 0.02
# Of an arm at the end of a motion of the demo: greatest deviation [rad], and speed of one that is
# played [rad/s].
ARRIVED, STILL = 1e-3, 1e-6


class NotInTimeError(RrthError):
    """A timeout."""


class GivenUpError(NotInTimeError):
    """What is waited for will not come: the planner has given the goal up."""


class DemoError(RrthError):
    """An error that ends the demo."""


class PlannerClient(Node):
    """
    A client of a planner; it receives messages only while it waits.

    `point_at` and `point_at_async` are what most programs need; rclpy is initialized before, and
    nothing else spins the node.

    Parameters
    ----------
    name : str
        Of the node.
    timeout : float
        Longest wait for anything [s].
    check : callable, optional
        Called while it waits; raises where waiting is useless.
    namespace : str, optional
        Of the node, and of the planner.

    """

    def __init__(
        self,
        name: str = 'planner_client',
        timeout: float = 30.0,
        check: Callable[[], None] = lambda: None,
        namespace: str = '',
    ) -> None:
        """Create publishers, subscriptions and the client of the planner."""
        super().__init__(name, namespace=namespace)
        self.timeout, self._check = timeout, check
        # Of the arm: other joint states are ignored.
        self.joint_names: tuple[str, ...] = ()
        self.state: JointState | None = None
        self._reading: JointReading | None = None
        # The commanded motions and the joint states, until they are cleared.
        self.commanded: list[JointTrajectory] = []
        self.observed: list[JointState] = []
        # Created when first needed: a client that sends no body is no publisher of it.
        self._publishers_by_type: dict[type, Publisher] = {}
        self._joints = OpenSubscription(self, JointState, 'joint_states', self._on_state)
        # Whole motions: with separation `joint_trajectory` has stretches of them, not latched.
        quietly = SubscriptionEventCallbacks(use_default_callbacks=False)
        for topic in ('joint_trajectory', f'{NODE}/planned_trajectory'):
            self.create_subscription(
                JointTrajectory,
                topic,
                lambda msg: self.commanded.append(msg),
                LATCHED,
                event_callbacks=quietly,
            )
        # The planner's diagnostics: level and message, the number of the request whose motion was
        # published last, and why its goal was given up, if it was.
        self.level, self.message = DiagnosticStatus.OK, ''
        self._request, self._given_up = 0, ''
        self._planner = self.resolve_service_name(NODE).lstrip('/')
        # By their texts.
        self._answers: dict[str, Answer] = {}
        self.create_subscription(DiagnosticStatus, f'{NODE}/answer', self._on_answer, ANSWERED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        # It may wait among many others, whose answers it receives, too.
        self._plan = self.create_client(Trigger, f'{NODE}/plan', qos_profile=SERVICE)
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def point_at(
        self, target: Sequence[float], frame: str = '', timeout: float | None = None
    ) -> Answer:
        """
        Have the arm point at a target; return the planner's answer once the motion is published.

        Parameters
        ----------
        target : sequence of three float
            [m].
        frame : str, optional
            Of the target; empty: the planner's `base_frame`.
        timeout : float, optional
            Longest wait for each of: a planner, its acknowledgement, its answer, and for inputs
            that the planner lacks [s]; without, that of the client.

        Raises
        ------
        NotInTimeError
            No planner, or none that answers.
        MessageError
            A coordinate that is missing or not finite.

        """
        timeout = self.timeout if timeout is None else timeout
        return self._run(self._point_at(_target(target, frame), timeout), timeout)

    async def point_at_async(
        self, target: Sequence[float], frame: str = '', timeout: float | None = None
    ) -> Answer:
        """
        Do what `point_at` does, while other tasks of asyncio run; one call at a time.

        A call that is cancelled while the planner plans does not cancel the plan.
        """
        timeout = self.timeout if timeout is None else timeout
        waits = self._point_at(_target(target, frame), timeout)
        while True:
            try:
                condition, what = next(waits)
            except StopIteration as end:
                return end.value
            limit = time.monotonic() + timeout
            while not condition():
                self.take_messages(0.0)
                if time.monotonic() > limit:
                    raise _late(what, timeout)
                await asyncio.sleep(POLLED)

    def why_given_up(self, answer: Answer) -> str:
        """
        Return why the planner does not pursue the goal of an answer any more; '' while it does.

        Known while messages are received, as in `wait_for`, a tenth of a second later at most.
        After arrival it is ''.
        """
        if not answer.number or self._request < answer.number:
            return ''
        if self._request > answer.number:
            return 'the motion of another request has replaced the one to this target'
        return self._given_up

    def require_pursued(self, answer: Answer) -> None:
        """Raise GivenUpError where the planner does not pursue the goal of an answer any more."""
        why = self.why_given_up(answer)
        if why:
            raise GivenUpError(f'the planner has given this target up: {why}')

    def _on_answer(self, msg: DiagnosticStatus) -> None:
        with suppress(MessageError):
            answer = answer_from_msg(msg)
            self._answers[answer.text] = answer
            if len(self._answers) > REMEMBERED:
                del self._answers[next(iter(self._answers))]

    def _on_diagnostics(self, msg: DiagnosticArray) -> None:
        for status in msg.status:
            if status.name != f'{self._planner}: planning':
                continue
            values = {pair.key: pair.value for pair in status.values}
            with suppress(KeyError, ValueError):
                self._request = int(values[REQUEST_KEY])
                self._given_up = values[GIVEN_UP_KEY]
            self.level, self.message = status.level, one_line(status.message)

    def _run(self, waits: Waits[T], timeout: float) -> T:
        """Return what comes of some waits, each for a time at most [s]."""
        while True:
            try:
                condition, what = next(waits)
            except StopIteration as end:
                return end.value
            self.wait_for(condition, what, timeout)

    def _point_at(self, target: PointStamped, patience: float) -> Waits[Answer]:
        service = self.resolve_service_name(f'{NODE}/plan')
        yield self._plan.service_is_ready, f'service {service}'
        yield from self._publish(target)
        return (yield from self._ask(patience))

    def motion_of(self, answer: Answer) -> Trajectory:
        """
        Return the motion of an answer, once it was received.

        Raises NotInTimeError where it does not come, or its stamp has not come with the answer.
        """
        if answer.stamp is None:
            topic = self.resolve_topic_name(f'{NODE}/answer')
            raise NotInTimeError(f'{topic}: no stamp of answer {answer.number}, expected one')

        def received() -> list[Trajectory]:
            stamped = (m for m in self.commanded if nanoseconds_of(m.header.stamp) == answer.stamp)
            return motions_of(stamped, self.joint_names)

        topic = self.resolve_topic_name('joint_trajectory')
        self.wait_for(lambda: bool(received()), topic)
        return received()[0]

    def wait_for(
        self, condition: Callable[[], bool], what: str, timeout: float | None = None
    ) -> None:
        """Receive messages until a condition holds, or raise NotInTimeError after a time [s]."""
        timeout = self.timeout if timeout is None else timeout
        end = time.monotonic() + timeout
        while not condition():
            self.take_messages()
            if time.monotonic() > end:
                raise _late(what, timeout)

    def destroy_node(self) -> None:
        """Destroy the node and what spins it."""
        # Left to the garbage collector, rclpy's executor may destroy a condition a second time,
        # which prints a traceback.
        self._spinner.shutdown(timeout_sec=0.0)
        super().destroy_node()

    def take_messages(self, longest: float = 0.05) -> None:
        """Receive a message, if one comes within a time [s]."""
        try:
            self._spinner.spin_once(timeout_sec=longest)
        except KeyboardInterrupt:
            # Interrupted coroutines would warn when Python ends.
            warnings.simplefilter('ignore', RuntimeWarning)
            raise
        self._check()

    def receive_for(self, span: float) -> None:
        """Receive messages for a time [s]."""
        end = time.monotonic() + span
        while time.monotonic() < end:
            self.take_messages(0.005)

    def wait_for_planner(self) -> None:
        """Wait for the service of the planner."""
        service = self.resolve_service_name(f'{NODE}/plan')
        self.wait_for(self._plan.service_is_ready, f'service {service}')

    def wait_for_state(self, joint_names: Sequence[str]) -> None:
        """Wait for a joint state of the arm that has these joints."""
        self.joint_names, self.state, self._reading = tuple(joint_names), None, None
        what = f'{self._joints.topic_name} of {", ".join(joint_names)}'
        self.wait_for(lambda: self.state is not None, what)

    def positions(self) -> Array:
        """Return the latest positions of the arm, (dof,) [rad]."""
        if self.state is None:
            raise NotInTimeError('joint_states: none yet')
        return configuration_from_msg(self.state, self.joint_names)

    def is_still_at(self, q: Array, tolerance: float, speed: float = REST_SPEED) -> bool:
        """Return whether the arm is so close to q [rad], and no faster than a speed [rad/s]."""
        reading = self._reading
        if reading is None or gaps_between(reading.mean_positions(), q).max() > tolerance:
            return False
        return not reading.is_moving(reading.taken, speed)

    def ask(self, patience: float) -> Answer:
        """Return the planner's answer; ask again while it lacks a recent input, for a time [s]."""
        return self._run(self._ask(patience), self.timeout)

    def _ask(self, patience: float) -> Waits[Answer]:
        end = time.monotonic() + patience
        while True:
            future = self._plan.call_async(Trigger.Request())
            yield future.done, 'an answer of rrth_planner/plan'
            answer, now = answer_from_text(future.result().message), time.monotonic()
            if answer.code not in LACKS_INPUT or now >= end:
                return (yield from self._with_figures(answer))
            yield partial(_is_later, now + PAUSE), 'an input of the planner'

    def _with_figures(self, answer: Answer) -> Waits[Answer]:
        """Return an answer with its figures, if they come."""
        # A planner that is just found may have published them before.
        end, text = time.monotonic() + LONGEST_FIGURES, answer.text
        yield lambda: text in self._answers or _is_later(end), 'the figures of an answer'
        return self._answers.get(text, answer)

    def count_arms(self) -> int:
        """Return the number of other subscribers of the motions."""
        return self.count_subscribers('joint_trajectory') - 1

    def publish(self, message: MarkerArray | PointStamped) -> None:
        """Publish a body or a target; return once the planner has it."""
        self._run(self._publish(message), self.timeout)

    def _publish(self, message: MarkerArray | PointStamped) -> Waits[None]:
        kind = type(message)
        publisher = self._publishers_by_type.get(kind)
        if publisher is None:
            publisher = self.create_publisher(kind, TOPICS[kind], LATCHED)
            self._publishers_by_type[kind] = publisher
        yield (
            lambda: is_matched(self, publisher),
            f'a reliable subscription of {publisher.topic}',
        )
        publisher.publish(message)
        # The request that follows must not overtake the message. Other threads and timers wait
        # meanwhile, and a reader of a program that was killed acknowledges nothing.
        yield (
            lambda: publisher.wait_for_all_acked(Duration(seconds=ACKNOWLEDGED)),
            f'an acknowledgement of {publisher.topic}',
        )

    def stand(self, body: MarkerArray) -> None:
        """Publish a body as `publish` does, and again as long as messages are received."""
        self.publish(body)
        self.create_timer(STANDING, lambda: self._publishers_by_type[MarkerArray].publish(body))

    def _on_state(self, msg: JointState, _: Arrival) -> None:
        try:
            now = self.get_clock().now().nanoseconds * 1e-9
            # No other joint jumps by half a turn between two messages either.
            may_wrap = (True,) * len(self.joint_names)
            self._reading = joint_reading(msg, self.joint_names, now, self._reading, may_wrap)
        except MessageError:
            # Of other joints, or invalid: the last state counts.
            return
        self.state = msg
        self.observed.append(msg)


class DemoClient(PlannerClient):
    """The demo's client: it publishes body and target, requests motions, and follows the arm."""

    def __init__(
        self,
        arm: ArmModel,
        timeout: float,
        check: Callable[[], None],
        still: float = STILL,
        settling: float = 0.0,
    ) -> None:
        """
        Create publishers, subscriptions and the client of the planner.

        The arm is at rest at a speed of at most `still` [rad/s]; its servos settle in a time [s].
        """
        super().__init__('rrth_demo', timeout, check)
        self._answer = Answer(ErrorCode.FAILURE, '')
        self.arm, self._still, self._settling = arm, still, settling
        # As `see_separation` keeps them; statuses with the time when they were sent [s].
        self.bodies: list[bytes] = []
        self.commitments: list[JointTrajectory] = []
        self.statuses: list[tuple[float, SeparationStatus]] = []

    def wait_for_nodes(self) -> None:
        """Wait for the planner, for joint states, and for a subscriber of the motions."""
        self.wait_for_state(self.arm.joint_names)
        self.wait_for_planner()
        self.wait_for(lambda: self.count_arms() > 0, 'a subscriber of joint_trajectory')

    def ask_for_motion(self) -> tuple[Trajectory, float]:
        """Return the motion that the planner publishes, and its planning time [ms]."""
        self.commanded, self.observed = [], []
        answer = self._answer = self.ask(self.timeout)
        if answer.code is not ErrorCode.SUCCESS:
            raise DemoError(f'the planner rejected the request: {answer.text}')
        figures = answer.figures
        if 'planning_time_ms' not in figures:
            raise DemoError(f'no planning time came with the answer "{answer.text}"')
        return self.motion_of(answer), figures['planning_time_ms']

    def wait_for_arrival(self, trajectory: Trajectory, q_aims: Callable[[Array], bool]) -> None:
        """
        Wait until the arm stands still at the end of its motion, and aims.

        Where the planner has stopped it, that is the end of the motion that came instead.
        """

        def has_arrived() -> bool:
            last = joint_trajectory_from_msg(self.commanded[-1], self.joint_names)
            q_end = last.positions[-1]
            if self.is_still_at(q_end, ARRIVED, self._still) and q_aims(q_end):
                return True
            self.require_pursued(self._answer)
            return False

        self.wait_for(
            has_arrived,
            f'the arm at the end of its motion of {trajectory.duration:.2f} s',
            trajectory.duration + self.timeout,
        )
        self.receive_for(self._settling)

    def withdraw_body(self) -> None:
        """Withdraw the body that was published: a planner that starts does not receive it."""
        self.destroy_publisher(self._publishers_by_type.pop(MarkerArray))

    def wait_for_end_of_planner(self) -> None:
        """Wait until the service of a planner that has ended is gone."""
        self.wait_for(lambda: not self._plan.service_is_ready(), 'the end of the planner')

    def see_separation(self) -> None:
        """Keep every body, serialized, commitment and status that is published from now on."""
        many = QoSProfile(depth=1000)
        # To decode bodies takes longer than the arm's states leave time for.
        self.create_subscription(MarkerArray, 'body_boxes', self.bodies.append, many, raw=True)
        self.create_subscription(
            JointTrajectory, 'joint_trajectory', self.commitments.append, many
        )
        topic = f'{NODE}/state'
        OpenSubscription(self, DiagnosticStatus, topic, self._on_separation)

    def _on_separation(self, msg: DiagnosticStatus, arrival: Arrival) -> None:
        self.statuses.append((1e-9 * arrival.sent[0], separation_from_msg(msg)))

    def point(self, q_aims: Callable[[Array], bool]) -> None:
        """
        Request a motion beside a wearer who moves, and again until the arm aims at rest.

        `q_aims` says whether a configuration, (dof,) [rad], aims at the target that was published.
        While he is in the way requests are rejected, or the planner stops the arm, goes on, or
        plans again.
        """
        end = time.monotonic() + self.timeout
        sentence = 'none was planned'
        while time.monotonic() < end:
            sentence = self.ask(self.timeout).text
            moved = time.monotonic()
            # The planner may be about to go on: it is asked once it leaves the arm at rest.
            while time.monotonic() - moved < PAUSE:
                self.take_messages()
                q = self.positions()
                if not self.is_still_at(q, ARRIVED, self._still):
                    moved = time.monotonic()
                elif q_aims(q):
                    return
            if self.level == DiagnosticStatus.ERROR:
                # To ask again does not help.
                raise DemoError(self.message)
        raise DemoError(f'the arm did not aim at its target within {self.timeout:g} s: {sentence}')


def _target(target: Sequence[float], frame: str) -> PointStamped:
    """Return the message of a target, (3,) [m], or raise MessageError."""
    point = frozen_array(target, (3,), 'target', 'm', MessageError)
    message = PointStamped()
    message.header.frame_id = frame
    message.point.x, message.point.y, message.point.z = point.tolist()
    return message


def _late(what: str, timeout: float) -> NotInTimeError:
    return NotInTimeError(f'{what}: nothing for {timeout:g} s')


def _is_later(end: float) -> bool:
    """Return whether the monotonic clock is past a time [s]."""
    return time.monotonic() >= end


def motions_of(messages: Iterable[JointTrajectory], names: Sequence[str]) -> list[Trajectory]:
    """Return the motions of these joints; a topic may carry those of others, or invalid ones."""
    motions = []
    for msg in messages:
        with suppress(MessageError):
            motions.append(joint_trajectory_from_msg(msg, names))
    return motions


def is_matched(node: Node, publisher: Publisher) -> bool:
    """
    Return whether all subscribers of a node's publisher are connected, a reliable one among them.

    Before that, `wait_for_all_acked` may return too early.
    """
    infos = node.get_subscriptions_info_by_topic(publisher.topic)
    is_reliable = any(info.qos_profile.reliability == ReliabilityPolicy.RELIABLE for info in infos)
    return is_reliable and publisher.get_subscription_count() >= len(infos)


def parameters_of_planner(client: PlannerClient) -> PlannerParameters:
    """
    Return the present parameters of the planner.

    Raises NotInTimeError where no planner answers, and another RrthError where it has other
    parameters, or its arm is described by a file that is not here.
    """
    asking = AsyncParameterClient(client, NODE)
    node = client.resolve_service_name(NODE)
    client.wait_for(asking.services_are_ready, f'the parameter services of {node}')

    def values_of(names: Sequence[str]) -> dict[str, Any]:
        begin = time.monotonic()
        futures: list[Future] = []

        def is_answered() -> bool:
            # The answer of a planner that does not know its client yet is lost.
            if time.monotonic() >= begin + ASK_AGAIN * len(futures):
                futures.append(asking.get_parameters(list(names)))
            return any(future.done() for future in futures)

        client.wait_for(is_answered, f'the parameters of {node}')
        answer = next(future.result() for future in futures if future.done())
        found = [parameter_value_to_python(value) for value in answer.values]
        values = dict(zip(names, found, strict=False))
        missing = [name for name in names if values.get(name) is None]
        if missing:
            raise RrthError(
                f'{node}: no parameter {missing[0]}, expected a planner of this version'
            )
        return values

    arm = load_arm(values_of([ARM.name])[ARM.name])
    return parameters_from_values(values_of([s.name for s in declared(arm.dof)]), arm)
