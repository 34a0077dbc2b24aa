# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A client of a planner node that runs as a process of its own."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
import os
import signal
import time
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.model.scene import Scene
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.messages.answer import answer_from_msg, answer_from_text
from rrth_planner.ros.middleware.child_process import ChildProcess
from rrth_planner.ros.middleware.qos import ANSWERED
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker, MarkerArray

FRAME = 'torso'
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Longest waits: for a node that compiles, for an answer [s].
START, ANSWER = 300.0, 30.0


class Client(Node):
    """Publishes the inputs of a planner node, and requests plans."""

    def __init__(self) -> None:
        """Connect to the planner's topics and service."""
        super().__init__('rrth_benchmarks')
        self._body = self.create_publisher(MarkerArray, 'body_boxes', LATCHED)
        self._target = self.create_publisher(PointStamped, 'target', LATCHED)
        self._joints = self.create_publisher(JointState, 'joint_states', LATCHED)
        self._plan = self.create_client(Trigger, 'rrth_planner/plan')
        self._answers: dict[int, Answer] = {}
        topic = 'rrth_planner/answer'
        self.create_subscription(DiagnosticStatus, topic, self._on_answer, ANSWERED)
        # The last message of each topic.
        self.published: dict[str, Any] = {}
        self._spinner = SingleThreadedExecutor()
        self._spinner.add_node(self)

    def wait_for_service(self, child: ChildProcess) -> None:
        """Return as soon as the planner can be asked."""
        end = time.monotonic() + START
        while not self._plan.service_is_ready():
            child.check()
            if time.monotonic() > end:
                raise RrthError(f'planner node: not ready within {START:g} s')
            time.sleep(0.01)

    def publish_body(self, scene: Scene) -> None:
        """Publish a wearer."""
        markers = [Marker(action=Marker.DELETEALL)]
        for box in scene.boxes:
            marker = Marker(ns=box.name, text=box.name, type=Marker.CUBE, action=Marker.ADD)
            position, orientation = marker.pose.position, marker.pose.orientation
            position.x, position.y, position.z = box.center.tolist()
            x, y, z, w = quaternion_xyzw(box.rotation).tolist()
            orientation.x, orientation.y, orientation.z, orientation.w = x, y, z, w
            marker.scale.x, marker.scale.y, marker.scale.z = box.size.tolist()
            marker.color.a = 1.0
            markers.append(marker)
        for marker in markers:
            marker.header.frame_id = FRAME
        self._publish_acked(self._body, MarkerArray(markers=markers))

    def publish_target(self, target: Array) -> None:
        """Publish a target [m]."""
        message = PointStamped()
        message.header.frame_id = FRAME
        message.point.x, message.point.y, message.point.z = target.tolist()
        self._publish_acked(self._target, message)

    def publish_joints(self, names: tuple[str, ...], q: Array) -> None:
        """Publish where the arm is, at rest [rad]."""
        still = [0.0] * len(names)
        message = JointState(name=list(names), position=q.tolist(), velocity=still)
        self._publish_acked(self._joints, message)

    def ask(self) -> tuple[float, Trigger.Response]:
        """Return how long the planner takes to answer [s], and what it answers."""
        begin = time.perf_counter()
        future = self._plan.call_async(Trigger.Request())
        # Not spin_until_future_complete: what it leaves in the executor slows down the next call.
        while not future.done() and time.perf_counter() < begin + ANSWER:
            self._spinner.spin_once(ANSWER)
        elapsed = time.perf_counter() - begin
        if not future.done():
            raise RrthError(f'planner node: no answer within {ANSWER:g} s')
        return elapsed, future.result()

    def figures_of(self, response: Trigger.Response) -> Mapping[str, float]:
        """Return the figures of an answer, which come beside it."""
        number, end = answer_from_text(response.message).number, time.perf_counter() + ANSWER
        while number not in self._answers:
            self._spinner.spin_once(ANSWER)
            if time.perf_counter() > end:
                raise RrthError(f'planner node: no figures of answer {number}')
        return self._answers.pop(number).figures

    def _on_answer(self, msg: DiagnosticStatus) -> None:
        answer = answer_from_msg(msg)
        self._answers = {answer.number: answer}

    def _publish_acked(self, publisher: Any, message: Any) -> None:
        end = time.monotonic() + ANSWER
        while publisher.get_subscription_count() == 0:
            if time.monotonic() > end:
                raise RrthError(f'{publisher.topic}: nobody listens')
            time.sleep(0.002)
        publisher.publish(message)
        publisher.wait_for_all_acked()
        self.published[publisher.topic.rpartition('/')[2]] = message


T = TypeVar('T', bound=Client)


@contextmanager
def ros_client(make: Callable[[], T] = Client) -> Iterator[T]:
    """Give a client in a ROS domain of its own, to a main thread."""
    # Whatever ends this process, its nodes do not go on in the same domain.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        client = make()
        yield client
        client.destroy_node()
    finally:
        rclpy.try_shutdown()
