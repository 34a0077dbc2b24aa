# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A node that publishes a tracked person as boxes, or as trackers publish him."""

from contextlib import suppress

from geometry_msgs.msg import PoseArray
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rrth_planner.model.errors import SceneError
from rrth_planner.ros.messages.part_markers import PartMarkers
from rrth_planner.ros.messages.tracked_person import LIFETIME, points_to_msg, poses_to_msg
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import Skeleton
from visualization_msgs.msg import MarkerArray

# What a person is published as: on which topic, and as which type.
FORMS = {
    'boxes': ('body_boxes', MarkerArray),
    'markers': ('markers', MarkerArray),
    'poses': ('poses', PoseArray),
}
# The frame of the boxes, and that of points and poses.
BASE_FRAME, TRACKER_FRAME = 'torso', 'tracker'


class PersonPublisher(Node):
    """Publishes the postures of a person in one of FORMS; a skeleton makes boxes of them."""

    def __init__(self, skeleton: Skeleton, form: str) -> None:
        """Create the publisher."""
        super().__init__('rrth_wearer')
        self._skeleton, self._form = skeleton, form
        self._parts = PartMarkers((part.name for part in skeleton.parts), LIFETIME)
        topic, kind = FORMS[form]
        # As of trackers, the last one counts, and for those only who are there.
        self.publisher = self.create_publisher(kind, topic, QoSProfile(depth=1))

    @property
    def topic_name(self) -> str:
        """The topic that it publishes."""
        name: str = self.publisher.topic_name
        return name

    def publish(self, posture: Posture, age: float) -> None:
        """
        Publish a posture that was measured so long ago [s].

        Where the base frame is lost there are no boxes, and nothing is published.
        """
        stamp = (self.get_clock().now() - Duration(seconds=age)).to_msg()
        if self._form == 'boxes':
            with suppress(SceneError):
                scene, _ = body_boxes(self._skeleton, posture)
                self.publisher.publish(self._parts.message(scene, BASE_FRAME, stamp))
        elif self._form == 'markers':
            self.publisher.publish(points_to_msg(posture, self._skeleton, TRACKER_FRAME, stamp))
        else:
            self.publisher.publish(poses_to_msg(posture, self._skeleton, TRACKER_FRAME, stamp))
