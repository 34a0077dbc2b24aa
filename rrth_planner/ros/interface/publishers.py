# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The publishers of the planner: motions, and what RViz shows of them."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Path
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rrth_planner.execution.watch import MonitorRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.stamp import NANOSECONDS, stamp_of
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.interface.parameters import ALWAYS, NEVER
from rrth_planner.ros.messages.answer import answer_to_msg
from rrth_planner.ros.messages.plan_markers import plan_markers
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg, tool_path_to_msg
from rrth_planner.ros.middleware.qos import ANSWERED, COMMANDED, COMMITTED, LATCHED, RAY_CLEAR
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

TOOL_PATH_POSES = 25
LONGEST_FLUSH = 0.5


class PlanPublishers:
    """The topics that the planner publishes; late subscribers get the last plan too."""

    def __init__(self, node: Node, separates: str, base_frame: str) -> None:
        """Advertise them; separates, base_frame: as in `PlannerParameters`."""
        self._node, self._base_frame = node, base_frame
        # Of whole motions, and of commitments, which each are safe by themselves.
        self._whole: Publisher | None = None
        self._committed: Publisher | None = None
        if separates == ALWAYS:
            self.separate()
        else:
            self._whole = node.create_publisher(JointTrajectory, 'joint_trajectory', COMMANDED)
        self._answers = node.create_publisher(DiagnosticStatus, '~/answer', ANSWERED)
        self._planned = self._ray_clear = None
        if separates != NEVER:
            name = '~/planned_trajectory'
            self._planned = node.create_publisher(JointTrajectory, name, LATCHED)
            self._ray_clear = node.create_publisher(Bool, '~/ray_clear', RAY_CLEAR)
        self._tool_path = node.create_publisher(Path, '~/tool_path', LATCHED)
        self._markers = node.create_publisher(MarkerArray, '~/markers', LATCHED)

    def separate(self) -> None:
        """Have commitments published from now on; whole motions too, until they are withdrawn."""
        if self._committed is None:
            # An old commitment must not be executed by a controller that comes late. Who asks for
            # latched motions, or for liveliness, takes `~/planned_trajectory`.
            self._committed = self._node.create_publisher(
                JointTrajectory,
                'joint_trajectory',
                COMMITTED,
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
            )

    def withdraw_whole(self) -> None:
        """Withdraw the last whole motion, or its stop, once commitments are published."""
        if self._committed is not None and self._whole is not None:
            whole, self._whole = self._whole, None
            self._node.destroy_publisher(whole)

    def publish_motion(
        self, trajectory: Trajectory, parameters: MonitorRules, begin: float
    ) -> None:
        """Publish a motion for the arm to begin at a time [s]."""
        self._publisher(parameters).publish(self.motion(trajectory, parameters, begin))

    def _publisher(self, parameters: MonitorRules) -> Publisher:
        """Return the publisher of what the arm executes of a motion with these parameters."""
        found = self._whole if parameters.execution.separation is None else self._committed
        if found is None:
            raise RuntimeError('no publisher of such motions, expected that of their separation')
        return found

    def motion(
        self, trajectory: Trajectory, parameters: MonitorRules, begin: float
    ) -> JointTrajectory:
        """Return the message of such a motion."""
        return joint_trajectory_to_msg(
            trajectory, parameters.required.arm.joint_names, self._base_frame, begin
        )

    def prepared(
        self, trajectory: Trajectory, parameters: MonitorRules
    ) -> Callable[[float], None]:
        """Return what publishes a planned motion that begins at a time [s], with separation."""
        planned, msg = self._planned, self.motion(trajectory, parameters, 0.0)

        def publish(begin: float) -> None:
            if planned is not None:
                stamp = msg.header.stamp
                stamp.sec, stamp.nanosec = divmod(stamp_of(begin), NANOSECONDS)
                planned.publish(msg)

        return publish

    def publish_answer(self, answer: Answer) -> None:
        """Publish an answer with its figures."""
        name = f'{self._node.get_fully_qualified_name().lstrip("/")}: answer'
        self._answers.publish(answer_to_msg(name, answer))

    @property
    def motion_topic(self) -> str:
        """The resolved name of the topic on which the controller is to listen."""
        return str(self._node.resolve_topic_name('joint_trajectory'))

    def has_listener(self) -> bool:
        """Return whether anybody is subscribed to that topic."""
        publishers = (self._whole, self._committed)
        return any(p is not None and p.get_subscription_count() > 0 for p in publishers)

    def assert_liveliness(self) -> None:
        """Assert that the running motion is monitored."""
        if self._whole is not None:
            self._whole.assert_liveliness()

    def publish_ray_clear(self, is_clear: bool) -> None:
        """Publish whether the pointing ray meets nobody, with separation."""
        if self._ray_clear is not None:
            self._ray_clear.publish(Bool(data=is_clear))

    def flush(self) -> None:
        """Wait briefly until all subscribers have the last motion."""
        for publisher in (self._whole, self._committed):
            if publisher is not None:
                publisher.wait_for_all_acked(Duration(seconds=LONGEST_FLUSH))

    def tool_path(self, trajectory: Trajectory, parameters: MonitorRules) -> Path:
        """Return the tool's path along a motion."""
        return tool_path_to_msg(
            parameters.required.arm, trajectory, self._base_frame, TOOL_PATH_POSES
        )

    def is_view_subscribed(self) -> bool:
        """Return whether `publish_view` has any subscriber."""
        return any(p.get_subscription_count() > 0 for p in (self._tool_path, self._markers))

    def publish_view(
        self, trajectory: Trajectory, parameters: MonitorRules, scene: Scene, target: Array
    ) -> None:
        """Publish what shows a motion."""
        path = self.tool_path(trajectory, parameters)
        self._tool_path.publish(path)
        self._markers.publish(
            plan_markers(
                parameters.required.arm,
                scene,
                parameters.required.margin,
                trajectory,
                target,
                path,
            )
        )
