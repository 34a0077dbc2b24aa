# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The publishers of the planner: motions, and what RViz shows of them."""

from nav_msgs.msg import Path
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.plan_markers import plan_markers
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg, tool_path_to_msg
from rrth_planner.ros.middleware.qos import COMMANDED, COMMITTED, LATCHED, RAY_CLEAR
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

TOOL_PATH_POSES = 25
LONGEST_FLUSH = 0.5


class PlanPublishers:
    """The topics that the planner publishes; late subscribers get the last plan too."""

    def __init__(self, node: Node, is_separated: bool = False) -> None:
        """Advertise them; is_separated: each motion on `joint_trajectory` is safe by itself."""
        # An old commitment must not be executed by a controller that comes late.
        motions = COMMITTED if is_separated else COMMANDED
        # Who asks for latched motions, or for liveliness, then takes `~/planned_trajectory`.
        quietly = PublisherEventCallbacks(use_default_callbacks=not is_separated)
        self._trajectory = node.create_publisher(
            JointTrajectory, 'joint_trajectory', motions, event_callbacks=quietly
        )
        self._planned = self._ray_clear = None
        if is_separated:
            name = '~/planned_trajectory'
            self._planned = node.create_publisher(JointTrajectory, name, LATCHED)
            self._ray_clear = node.create_publisher(Bool, '~/ray_clear', RAY_CLEAR)
        self._tool_path = node.create_publisher(Path, '~/tool_path', LATCHED)
        self._markers = node.create_publisher(MarkerArray, '~/markers', LATCHED)

    def publish_motion(
        self, trajectory: Trajectory, parameters: PlannerParameters, begin: float
    ) -> None:
        """Publish a motion for the arm to begin at a time [s]; 0: on reception."""
        self._trajectory.publish(self.motion(trajectory, parameters, begin))

    def motion(
        self, trajectory: Trajectory, parameters: PlannerParameters, begin: float
    ) -> JointTrajectory:
        """Return the message of such a motion."""
        return joint_trajectory_to_msg(
            trajectory, parameters.arm.joint_names, parameters.base_frame, begin
        )

    def publish(self, msg: JointTrajectory) -> None:
        """Publish the message of a planned motion: to the arm, or with separation to be seen."""
        (self._planned or self._trajectory).publish(msg)

    @property
    def motion_topic(self) -> str:
        """The resolved name of the topic on which the controller is to listen."""
        return str(self._trajectory.topic_name)

    def has_listener(self) -> bool:
        """Return whether anybody is subscribed to that topic."""
        return int(self._trajectory.get_subscription_count()) > 0

    def assert_liveliness(self) -> None:
        """Assert that the running motion is monitored."""
        if self._planned is None:
            self._trajectory.assert_liveliness()

    def publish_ray_clear(self, is_clear: bool) -> None:
        """Publish whether the pointing ray meets nobody, with separation."""
        if self._ray_clear is not None:
            self._ray_clear.publish(Bool(data=is_clear))

    def flush(self) -> None:
        """Wait briefly until all subscribers have the last motion."""
        self._trajectory.wait_for_all_acked(Duration(seconds=LONGEST_FLUSH))

    def tool_path(self, trajectory: Trajectory, parameters: PlannerParameters) -> Path:
        """Return the tool's path along a motion."""
        return tool_path_to_msg(parameters.arm, trajectory, parameters.base_frame, TOOL_PATH_POSES)

    def is_view_subscribed(self) -> bool:
        """Return whether `publish_view` has any subscriber."""
        return any(p.get_subscription_count() > 0 for p in (self._tool_path, self._markers))

    def publish_view(
        self, trajectory: Trajectory, parameters: PlannerParameters, scene: Scene, target: Array
    ) -> None:
        """Publish what shows a motion."""
        path = self.tool_path(trajectory, parameters)
        self._tool_path.publish(path)
        self._markers.publish(
            plan_markers(parameters.arm, scene, parameters.margin, trajectory, target, path)
        )
