# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that keep the inputs of the planner up to date."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
import time
from typing import Any

from geometry_msgs.msg import PointStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.model.goal import PointingGoal
from rrth_planner.ros.interface.inputs import Input, Inputs
from rrth_planner.ros.interface.parameters import AUTO, PlannerParameters
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.body_publishers import BodyPublishers
from rrth_planner.ros.messages.body_source import (
    after_body,
    as_stream,
    BodySource,
    has_body,
    TRACKER,
)
from rrth_planner.ros.messages.definitions import fast_decoder
from rrth_planner.ros.messages.frames import FrameIsLateError, Frames
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import has_joint_of, joint_reading, stamped_at
from rrth_planner.ros.messages.marker_edits import Edit, measured_at, read_edits
from rrth_planner.ros.messages.marker_order import MarkerOrder
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

# Rejections of one topic are warned about at most this often [s].
WARNING_PERIOD = 5.0
# A body waits so long for its frame, which may come later than itself; period of that [s].
LONGEST_WAIT, WAIT_PERIOD = 0.2, 0.005
# So many bodies wait at most.
MOST_WAITING = 100
# Period of the search for a node that makes bodies of what a tracker measures [s].
SEARCH_PERIOD = 0.2


class SceneMonitor:
    """
    Reads messages into the inputs; a rejected one changes no value, and is logged.

    Parameters
    ----------
    parameters : PlannerParameters
        For the constant ones: the arm, the base frame and `body_latency`.
    on_change : callable, optional
        Called on the first message of a topic, on a rejection, and on the next good message; and
        when bodies are found to come as a stream.
    on_body : callable, optional
        Called after each body, with the wearer since then, its time of arrival [ns], and whether
        it is the newest of those that came.
    on_error : callable, optional
        Called after an unexpected error, with its name and message.
    keep_removed : callable, optional
        Returns how long a part that is removed now stays where it was [s].
    check_clock : callable, optional
        Called before a message is read: its times are compared with those of others.
    rest_speed : callable, optional
        Returns the greatest speed of a joint at rest now [rad/s]; without, that of `parameters`.

    """

    def __init__(
        self,
        node: Node,
        parameters: PlannerParameters,
        inputs: Inputs,
        on_change: Callable[[], None] = lambda: None,
        on_body: Callable[[WearerBody, int, bool], None] = lambda body, arrived, is_newest: None,
        on_error: Callable[[str], None] = lambda what: None,
        keep_removed: Callable[[], float] = lambda: 0.0,
        check_clock: Callable[[], None] = lambda: None,
        rest_speed: Callable[[], float] | None = None,
    ) -> None:
        """Subscribe."""
        self._node = node
        self._arm, self._joint_names = parameters.arm, parameters.arm.joint_names
        self._base_frame, self._latency = parameters.base_frame, parameters.body_latency
        self._on_change, self._notify_body = on_change, on_body
        self._check_clock = check_clock
        self._rest_speed = rest_speed or (lambda: parameters.rest_speed)
        self._frames = Frames(node, parameters.base_frame)
        self._warned: dict[tuple[str, str], float] = {}
        self._inputs = inputs
        self._order, self._publishers = MarkerOrder(), BodyPublishers()
        self._keep_removed = keep_removed
        # Bodies in frames whose poses are not known yet, since when they wait [s], and which
        # of them are descriptions.
        self._waiting: deque[tuple[MarkerArray, Arrival, float, bool]] = deque()
        # When the last message came that was no body at all [s].
        self._undecoded = -float('inf')
        if self._frames.is_available:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = node.create_timer(WAIT_PERIOD, self._read_waiting, clock=steady)
        if parameters.separates == AUTO:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._search = node.create_timer(SEARCH_PERIOD, self._search_tracker, clock=steady)
        # The node may be busy for a while: what came meanwhile must not get old in a queue.
        all_at_once: dict[str, Any] = {'takes_all': True}
        # The monitor waits for bodies.
        fast = {**all_at_once, 'decode': fast_decoder(MarkerArray), 'takes_late': True}
        self._subscriptions = [
            OpenSubscription(
                node, kind, topic, take, partial(self._on_undecoded, source), on_error, **options
            )
            for kind, topic, source, take, options in (
                (MarkerArray, 'body_boxes', inputs.body, self._on_body, fast),
                (PointStamped, 'target', inputs.target, self._on_target, {}),
                (JointState, 'joint_states', inputs.joints, self._on_joints, all_at_once),
            )
        ]

    def _on_undecoded(self, source: Input[Any], problem: Exception) -> None:
        if source is self._inputs.body:
            self._undecoded = time.monotonic()
        self._reject(source, problem)

    def _reject(self, source: Input[Any], problem: Exception) -> None:
        def read() -> Any:
            raise problem

        self._take(source, read, self._now())
        if source is self._inputs.body:
            self._notify_body(source.value, time.time_ns(), True)

    def goal(self, msg: PointStamped) -> PointingGoal:
        """Return the goal of a request's own target, or raise MessageError."""
        return goal_from_msg(msg, self._base_frame, self._frames.lookup)

    def _on_body(self, msg: MarkerArray, arrival: Arrival) -> None:
        came = _steady_time(arrival)
        is_description = self._publishers.is_description(msg, arrival.sent, came)
        if has_body(msg):
            self._take_source(after_body(is_description, came, self._inputs.source))
        if any(m.action == Marker.ADD and not m.header.frame_id for m in msg.markers):
            self._warn_of_empty_frame(self._inputs.body)
        self._waiting.append((msg, arrival, time.monotonic(), is_description))
        self._read_waiting()

    def _search_tracker(self) -> None:
        if TRACKER in self._node.get_node_names():
            self._take_source(as_stream(self._inputs.source))
        if self._inputs.source.is_stream:
            self._search.cancel()

    def _take_source(self, source: BodySource) -> None:
        was_stream, self._inputs.source = self._inputs.source.is_stream, source
        if source.is_stream and not was_stream:
            self._on_change()

    def _read_waiting(self) -> None:
        """Read the bodies in their order, until one has to wait for its frame."""
        if self._waiting:
            self._check_clock()
        while self._waiting:
            msg, arrival, since, is_description = self._waiting.popleft()
            waited = time.monotonic() - since
            # Of a body without stamp.
            age = self._latency + 1e-9 * max(0, time.time_ns() - arrival.received)
            try:
                edits = read_edits(msg, self._now(), self._base_frame, self._frames.lookup, age)
            except Exception as problem:
                may_wait = waited < LONGEST_WAIT and len(self._waiting) < MOST_WAITING
                if isinstance(problem, FrameIsLateError) and may_wait:
                    self._waiting.appendleft((msg, arrival, since, is_description))
                    return
                self._reject(self._inputs.body, problem)
            else:
                # The wait for its frame is no delay of this node.
                read = time.time_ns() if waited > WAIT_PERIOD else arrival.received
                # What was rejected while it waited is newer, and stands.
                is_news = arrival.is_newer is None and since > self._undecoded
                self._take_body(edits, arrival, read, is_news, is_description)

    def _take_body(
        self,
        edits: Sequence[Edit],
        arrival: Arrival,
        arrived: int,
        is_news: bool,
        is_description: bool,
    ) -> None:
        now, body = self._now(), self._inputs.body
        # What measures no part says nothing about those that are known.
        is_news &= body.measured is None or any(edit.part is not None for edit in edits)

        def read() -> WearerBody:
            return self._order.apply(
                body.value,
                edits,
                arrival.sent,
                now,
                arrival.is_newer,
                is_description=is_description,
                keep_removed=self._keep_removed(),
            )

        measured = measured_at(edits, now - self._latency)
        self._take(body, read, measured, is_news)
        self._inputs.body_came()
        self._notify_body(body.value, arrived, not arrival.is_followed)

    def _on_target(self, msg: PointStamped, _: Arrival) -> None:
        if not msg.header.frame_id:
            self._warn_of_empty_frame(self._inputs.target)
        self._take(self._inputs.target, lambda: self.goal(msg), self._now())

    def _on_joints(self, msg: JointState, _: Arrival) -> None:
        # Other machines share this topic: messages without any joint of the arm are ignored.
        if not has_joint_of(msg, self._joint_names):
            return
        self._check_clock()
        now, source, rest_speed = self._now(), self._inputs.joints, self._rest_speed()
        names, is_continuous = self._joint_names, self._arm.is_continuous
        self._take(
            source,
            lambda: joint_reading(msg, names, now, source.value, is_continuous, rest_speed),
            stamped_at(msg, now),
        )
        if set(self._joint_names) <= set(msg.name):
            self._inputs.joint_rejection = source.rejection if source.is_last_rejected else None

    def _take(
        self, source: Input[Any], read: Callable[[], Any], measured: float, is_news: bool = True
    ) -> None:
        was_good = source.measured is not None and not source.is_last_rejected
        is_good = source.accept(read, measured, is_news)
        if not is_good:
            self._warn(source, 'rejected', f' rejected: {source.rejection}', WARNING_PERIOD)
        if is_good != was_good:
            self._on_change()

    def _warn_of_empty_frame(self, source: Input[Any]) -> None:
        words = f': empty frame, taken as "{self._base_frame}"'
        self._warn(source, 'empty frame', words, float('inf'))

    def _warn(self, source: Input[Any], kind: str, words: str, period: float) -> None:
        """Warn of a topic, at most once in a period [s] of each kind."""
        present, last = time.monotonic(), self._warned.get((source.topic, kind))
        if last is None or present - last >= period:
            self._warned[source.topic, kind] = present
            self._node.get_logger().warning(f'{source.topic}{words}')

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9


def _steady_time(arrival: Arrival) -> float:
    """Return when a message came, by the steady clock [s]."""
    return time.monotonic() - 1e-9 * max(0, time.time_ns() - arrival.received)
