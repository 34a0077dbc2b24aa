# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A node that publishes a person as the driver of a tracker does."""

from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, PoseStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.ros.messages.definitions import require_type, type_of_name
from rrth_planner.ros.messages.posture import BODY_FORMATS, IDS_OF_PERSON, TRACKED
from rrth_planner.ros.messages.tracked_person import points_to_msg, poses_to_msg
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import Skeleton
from rrth_planner.wearer.stand_in import stand_in
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

# The types of messages, by the inputs of body_boxes_node; those of packages beside ROS by name.
KINDS = {'markers': MarkerArray, 'poses': PoseArray, 'bodies': PoseStamped}
PACKAGED = {'zed': 'zed_msgs/msg/ObjectsStamped', 'rigid_bodies': 'mocap4r2_msgs/msg/RigidBodies'}
# What the drivers say of a person who is well seen [0 to 100], and his number.
CONFIDENCE, NUMBER = 90.0, 1


@dataclass(frozen=True, slots=True)
class Driver:
    """
    What the driver of a tracker publishes.

    Parameters
    ----------
    skeleton : str
        One of config/skeletons.
    input : str
        Of body_boxes_node.
    topic : str
        Relative; `{name}` stands for the name of a rigid body.
    frame : str
        Of the messages.
    fps : float
        Messages per second [1/s].
    view : str
        Where the person stands, one of `LOOKING`.

    """

    skeleton: str
    input: str
    topic: str
    frame: str
    fps: float
    view: str


_kinect = Driver(
    'azure_kinect', 'markers', 'body_tracking_data', 'depth_camera_link', 30.0, 'optical'
)
_color = 'camera_color_optical_frame'
DRIVERS = {
    'kinect': _kinect,
    'femto': _kinect,
    **{
        name: Driver(
            f'zed_body_{n}',
            'zed',
            'zed/zed_node/body_trk/skeletons',
            'zed_left_camera_frame',
            30.0,
            'camera',
        )
        for name, n in (('zed', 38), *((f'zed_body_{n}', n) for n in BODY_FORMATS))
    },
    'coco': Driver('coco_17', 'poses', 'poses', _color, 30.0, 'optical'),
    'halpe': Driver('halpe_26', 'markers', 'markers', _color, 30.0, 'optical'),
    'natnet': Driver('rigid_bodies', 'bodies', '{name}/pose', 'world', 120.0, 'room'),
    'vrpn': Driver('rigid_bodies', 'bodies', 'vrpn_mocap/{name}/pose', 'world', 100.0, 'room'),
    'mocap4r2': Driver('rigid_bodies', 'rigid_bodies', 'rigid_bodies', 'map', 120.0, 'room'),
}


class StandInPublisher(Node):
    """Publishes the postures of a recorded person as one of `DRIVERS` does."""

    def __init__(self, recorded: Skeleton, first: Posture, driver: str) -> None:
        """
        Create the publishers.

        Raises
        ------
        OptionsError
            The package of the messages is not installed.

        """
        self._driver = DRIVERS[driver]
        user, package = f'--as {driver}', PACKAGED.get(self._driver.input, '')
        kind = require_type(package, user) if package else KINDS[self._driver.input]
        super().__init__('rrth_wearer')
        self._skeleton = load_skeleton(self._driver.skeleton)
        self._convert = stand_in(recorded, first, self._skeleton, self._driver.view)
        names = list(self._convert(first).names) if self._driver.input == 'bodies' else ['']
        self._publishers_by_name = {
            name: self.create_publisher(
                kind, self._driver.topic.replace('{name}', name), QoSProfile(depth=1)
            )
            for name in names
        }
        self._kind, self._n_frames = kind, 0

    @property
    def topic_name(self) -> str:
        """The topic, or the first one."""
        return next(iter(self._publishers_by_name.values())).topic_name

    def publish(self, posture: Posture, age: float) -> None:
        """Publish a posture of the recording that was measured so long ago [s]."""
        stamp = (self.get_clock().now() - Duration(seconds=age)).to_msg()
        seen = self._convert(posture)
        self._n_frames += 1
        make = {
            'markers': self._markers,
            'poses': self._poses,
            'bodies': self._bodies,
            'zed': self._zed,
            'rigid_bodies': self._rigid_bodies,
        }[self._driver.input]
        for name, message in make(seen, stamp).items():
            self._publishers_by_name[name].publish(message)

    def _markers(self, seen: Posture, stamp: Time) -> dict[str, Any]:
        msg = points_to_msg(seen, self._skeleton, self._driver.frame, stamp)
        for marker in msg.markers:
            # As the Kinect driver numbers them; detectors name them.
            marker.text = self._skeleton.names_by_id[marker.id]
            marker.id += IDS_OF_PERSON * NUMBER
        return {'': msg}

    def _poses(self, seen: Posture, stamp: Time) -> dict[str, Any]:
        return {'': poses_to_msg(seen, self._skeleton, self._driver.frame, stamp)}

    def _bodies(self, seen: Posture, stamp: Time) -> dict[str, Any]:
        poses = poses_to_msg(seen, self._skeleton, self._driver.frame, stamp)
        return {
            name: PoseStamped(header=poses.header, pose=pose)
            for name, pose in zip(seen.names, poses.poses, strict=True)
        }

    def _rigid_bodies(self, seen: Posture, stamp: Time) -> dict[str, Any]:
        kind = type_of_name('mocap4r2_msgs/msg/RigidBody')
        poses = poses_to_msg(seen, self._skeleton, self._driver.frame, stamp)
        bodies = [
            kind(rigid_body_name=name, pose=pose)
            for name, pose in zip(seen.names, poses.poses, strict=True)
        ]
        msg = self._kind(header=poses.header, frame_number=self._n_frames, rigidbodies=bodies)
        return {'': msg}

    def _zed(self, seen: Posture, stamp: Time) -> dict[str, Any]:
        kind = type_of_name('zed_msgs/msg/Object')
        person = kind(label=f'Body_{NUMBER}', label_id=NUMBER, confidence=CONFIDENCE)
        person.tracking_available = person.skeleton_available = True
        person.tracking_state = TRACKED
        person.body_format = BODY_FORMATS.index(len(seen.names))
        for keypoint, position in zip(person.skeleton_3d.keypoints, seen.positions, strict=False):
            keypoint.kp = position
        header = Header(frame_id=self._driver.frame, stamp=stamp)
        return {'': self._kind(header=header, objects=[person])}
