# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that keep the inputs of the planner up to date."""

from collections.abc import Callable
import time
from typing import Any

from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.model.goal import PointingGoal
from rrth_planner.ros.interface.inputs import Input, Inputs
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.fast_decoding import fast_decoder
from rrth_planner.ros.messages.frames import Frames
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import has_joint_of, joint_reading
from rrth_planner.ros.messages.marker_edits import read_edits
from rrth_planner.ros.messages.marker_order import MarkerOrder
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

# Rejections of one topic are warned about at most this often [s].
WARNING_PERIOD = 5.0


class SceneMonitor:
    """
    Reads messages into the inputs; a rejected one changes no value, and is logged.

    Parameters
    ----------
    node : Node
    parameters : PlannerParameters
        For the constant ones: the arm and the base frame.
    inputs : Inputs
        Kept up to date.
    on_change : callable, optional
        Called on the first message of a topic, on a rejection, and on the next good message.
    on_body : callable, optional
        Called after each body, with the wearer since then, and its time of arrival [ns].
    on_error : callable, optional
        Called after an unexpected error, with its name and message.

    """

    def __init__(
        self,
        node: Node,
        parameters: PlannerParameters,
        inputs: Inputs,
        on_change: Callable[[], None] = lambda: None,
        on_body: Callable[[WearerBody, int], None] = lambda body, arrived: None,
        on_error: Callable[[str], None] = lambda what: None,
    ) -> None:
        """Subscribe."""
        self._node = node
        self._joint_names = parameters.arm.joint_names
        self._base_frame = parameters.base_frame
        self._on_change, self._notify_body, self._on_error = on_change, on_body, on_error
        self._frames = Frames(node, parameters.base_frame)
        self._warned: dict[str, float] = {}
        self._has_warned_of_empty_frame: set[str] = set()
        self._inputs = inputs
        self._order = MarkerOrder()
        self._subscriptions = [
            self._subscribe(
                MarkerArray,
                'body_boxes',
                inputs.body,
                self._on_body,
                on_late=self._on_body,
                # The monitor waits for it.
                decode=fast_decoder(MarkerArray),
            ),
            self._subscribe(PointStamped, 'target', inputs.target, self._on_target),
            self._subscribe(JointState, 'joint_states', inputs.joints, self._on_joints),
        ]

    def _subscribe(
        self,
        kind: type,
        topic: str,
        source: Input[Any],
        on_message: Callable[[Any, Arrival], None],
        on_late: Callable[[Any, Arrival], None] | None = None,
        decode: Callable[[bytes], Any] | None = None,
    ) -> OpenSubscription:
        def supervised(take: Callable[..., None]) -> Callable[..., None]:
            def supervise(*arguments: Any) -> None:
                try:
                    take(*arguments)
                except Exception as problem:
                    self._on_error(one_line(f'{topic}: {type(problem).__name__}: {problem}'))
                    raise

            return supervise

        def reject(problem: MessageError) -> None:
            def read() -> Any:
                raise problem

            self._take(source, read, self._now())
            if source is self._inputs.body:
                self._notify_body(source.value, time.time_ns())

        return OpenSubscription(
            self._node,
            kind,
            topic,
            supervised(on_message),
            None if on_late is None else supervised(on_late),
            supervised(reject),
            decode,
        )

    def body_progress(self) -> tuple[int, int]:
        """Return `OpenSubscription.progress` of the bodies."""
        return self._subscriptions[0].progress()

    def goal(self, msg: PointStamped) -> PointingGoal:
        """Return the goal of a request's own target, or raise MessageError."""
        return goal_from_msg(msg, self._base_frame, self._frames.lookup)

    def _on_body(self, msg: MarkerArray, arrival: Arrival) -> None:
        now, body = self._now(), self._inputs.body
        if any(m.action == Marker.ADD and not m.header.frame_id for m in msg.markers):
            self._warn_of_empty_frame(body)

        def read() -> WearerBody:
            edits = read_edits(msg, now, self._base_frame, self._frames.lookup)
            return self._order.apply(body.value, edits, arrival.sent, now, arrival.is_newer)

        self._take(body, read, now, is_news=arrival.is_newer is None)
        self._notify_body(body.value, arrival.received)

    def _on_target(self, msg: PointStamped, _: Arrival) -> None:
        if not msg.header.frame_id:
            self._warn_of_empty_frame(self._inputs.target)
        self._take(self._inputs.target, lambda: self.goal(msg), self._now())

    def _on_joints(self, msg: JointState, _: Arrival) -> None:
        # Other machines share this topic: messages without any joint of the arm are ignored.
        if not has_joint_of(msg, self._joint_names):
            return
        now, source = self._now(), self._inputs.joints
        self._take(source, lambda: joint_reading(msg, self._joint_names, now, source.value), now)
        if set(self._joint_names) <= set(msg.name):
            self._inputs.joint_rejection = source.rejection if source.is_last_rejected else None

    def _take(
        self, source: Input[Any], read: Callable[[], Any], now: float, is_news: bool = True
    ) -> bool:
        was_good = source.received is not None and not source.is_last_rejected
        is_good = source.accept(read, now, is_news)
        if not is_good:
            self._warn(source)
        if is_good != was_good:
            self._on_change()
        return is_good

    def _warn(self, source: Input[Any]) -> None:
        present = time.monotonic()
        if present - self._warned.get(source.topic, -WARNING_PERIOD) >= WARNING_PERIOD:
            self._warned[source.topic] = present
            self._node.get_logger().warning(f'{source.topic} rejected: {source.rejection}')

    def _warn_of_empty_frame(self, source: Input[Any]) -> None:
        if source.topic not in self._has_warned_of_empty_frame:
            self._has_warned_of_empty_frame.add(source.topic)
            self._node.get_logger().warning(
                f'{source.topic}: empty frame, taken as "{self._base_frame}"'
            )

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
