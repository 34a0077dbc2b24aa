# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions to what trackers publish of a person, each kind of which becomes postures."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
import time
from typing import Any

from geometry_msgs.msg import PoseArray, PoseStamped
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rrth_planner.io.extras import require
from rrth_planner.model.errors import MessageError, ModelError, OptionsError
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.interface.tracker_parameters import NAME, TrackerParameters
from rrth_planner.ros.messages.definitions import fast_decoder, require_type
from rrth_planner.ros.messages.fields import nanoseconds_of
from rrth_planner.ros.messages.frames import FrameError, Frames
from rrth_planner.ros.messages.posture import (
    posture_from_joint_state,
    posture_from_markers,
    posture_from_poses,
    posture_from_rigid_bodies,
    posture_from_zed,
    posture_of_poses,
    TrackedPosture,
)
from rrth_planner.ros.messages.wearer_choice import WearerChoice
from rrth_planner.ros.middleware.open_subscription import Arrival, OpenSubscription
from rrth_planner.wearer.jump_filter import LONGEST_GAP
from rrth_planner.wearer.link_tree import LinkTree
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import FrameBase, JointBase, Skeleton
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

# Poses of rigid bodies whose stamps differ by at most this are of one measurement [ns].
SAME_MEASUREMENT = 2_000_000
APART = 'stamps of the rigid bodies {:.1f} ms apart, expected at most 2 ms in one measurement'
# Messages whose stamps are so much older than the last ones are late; older ones are of a clock
# that was set back [ns].
LATE = round(LONGEST_GAP * NANOSECONDS)
# A frame or body that is not heard of for so long is lost: others do not wait for it [ns].
LONGEST_BEHIND = 100_000_000
# TF that has known none of the frames for so long is reported [s].
LONGEST_UNKNOWN = 1.0

# Takes what reads a posture, or raises MessageError, and the time of arrival [ns].
Take = Callable[[Callable[[], TrackedPosture], int], None]


def create_input(node: Node, parameters: TrackerParameters, take: Take) -> Any:
    """
    Return the input that parameters choose; every posture that comes is handed to `take`.

    Raises
    ------
    RrthError
        It needs a library that is not installed, or a name is none of a topic.

    """
    return _INPUTS[parameters.input](node, parameters, take)


def points_of(skeleton: Skeleton) -> tuple[str, ...]:
    """Return the names of all points and frames of a tracker that a skeleton needs, each once."""
    names = [point for joint in skeleton.joints for point in joint.points]
    if isinstance(skeleton.base, FrameBase):
        names.insert(0, skeleton.base.frame)
    return tuple(dict.fromkeys(names))


def _subscribe(
    node: Node, kind: type, topic: str, take: Take, read: Callable[[Any], TrackedPosture]
) -> OpenSubscription:
    """Subscribe to messages that are postures each."""

    def on_message(msg: Any, arrival: Arrival) -> None:
        take(lambda: read(msg), arrival.received)

    return OpenSubscription(
        node,
        kind,
        topic,
        on_message,
        partial(_reject, take),
        decode=fast_decoder(kind),
        is_stream=True,
    )


def _reject(take: Take, problem: MessageError) -> None:
    def read() -> TrackedPosture:
        raise problem

    take(read, time.time_ns())


class PersonInput:
    """Persons by their numbers; the one who is the wearer stays that until `reset`."""

    def __init__(
        self,
        node: Node,
        parameters: TrackerParameters,
        take: Take,
        kind: type,
        topic: str,
        read: Callable[[Any, Sequence[str], WearerChoice, float], TrackedPosture],
    ) -> None:
        """Subscribe to a kind of messages, which `read` reads."""
        names, least = parameters.skeleton.names_by_id, parameters.min_confidence
        self._choice = WearerChoice(parameters.person, parameters.arm_position)
        self._subscription = _subscribe(
            node, kind, topic, take, lambda msg: read(msg, names, self._choice, least)
        )

    def reset(self) -> None:
        """Have who is seen next become the wearer."""
        self._choice.reset()


def _marker_input(node: Node, parameters: TrackerParameters, take: Take) -> PersonInput:
    """`markers`: a SPHERE a joint, by numbers."""
    return PersonInput(node, parameters, take, MarkerArray, 'markers', posture_from_markers)


def _zed_input(node: Node, parameters: TrackerParameters, take: Take) -> PersonInput:
    """`skeletons`: the persons whom a ZED camera sees."""
    kind = require_type('zed_msgs/msg/ObjectsStamped', 'input zed')
    return PersonInput(node, parameters, take, kind, 'skeletons', posture_from_zed)


class RigidBodiesInput:
    """`rigid_bodies`: all rigid bodies in one message, by their names."""

    def __init__(self, node: Node, parameters: TrackerParameters, take: Take) -> None:
        """Subscribe."""
        kind = require_type('mocap4r2_msgs/msg/RigidBodies', 'input rigid_bodies')
        names, prefix = points_of(parameters.skeleton), parameters.name_prefix
        self._subscription = _subscribe(
            node,
            kind,
            'rigid_bodies',
            take,
            lambda msg: posture_from_rigid_bodies(msg, names, prefix),
        )


class PoseInput:
    """`poses`: an array of frames, by their order."""

    def __init__(self, node: Node, parameters: TrackerParameters, take: Take) -> None:
        """Subscribe."""
        names = parameters.skeleton.names_by_id
        self._subscription = _subscribe(
            node, PoseArray, 'poses', take, lambda msg: posture_from_poses(msg, names)
        )


class BodyInput:
    """
    A topic for each rigid body, of which those that were measured at once are a posture.

    It is handed on as soon as it is complete. One that is not heard of for 0.1 s is lost: the
    others wait for it no longer.
    """

    def __init__(self, node: Node, parameters: TrackerParameters, take: Take) -> None:
        """Subscribe."""
        self._node, self._take = node, take
        self._names = points_of(parameters.skeleton)
        # Of measurements that are not complete, by when they were [ns]: messages by body.
        self._open: dict[int, dict[str, Any]] = {}
        # When each body was measured last, and when the last measurement was that is complete.
        self._measured: dict[str, int] = {}
        self._last = 0
        try:
            self._subscriptions = [
                OpenSubscription(
                    node,
                    PoseStamped,
                    parameters.pose_topic.replace(NAME, parameters.name_prefix + name),
                    partial(self._on_pose, name),
                    partial(_reject, take),
                    decode=fast_decoder(PoseStamped),
                    is_stream=True,
                )
                for name in self._names
            ]
        except InvalidTopicNameException as problem:
            said = ' '.join(str(problem).split())
            raise OptionsError(
                f'pose_topic: {said}; expected names in the skeleton that topics may have'
            ) from problem

    def _on_pose(self, name: str, msg: Any, arrival: Arrival) -> None:
        stamp = nanoseconds_of(msg.header.stamp) or self._node.get_clock().now().nanoseconds
        if not self._measured:
            self._measured = dict.fromkeys(self._names, stamp)
        self._measured[name] = stamp
        if -SAME_MEASUREMENT <= self._last - stamp < LATE:
            # It has been handed on without this one, or a newer one has.
            return
        n_open = len(self._open)
        self._open = {t: found for t, found in self._open.items() if abs(stamp - t) < LATE}
        behind = max(abs(stamp - t) for t in self._measured.values())
        if len(self._open) < n_open and behind <= LONGEST_BEHIND:
            # All are heard, and none of their measurements gets complete.
            _reject(self._take, MessageError(APART.format(1e-6 * behind)))
        time_of = next((t for t in self._open if abs(stamp - t) <= SAME_MEASUREMENT), stamp)
        found = self._open.setdefault(time_of, {})
        found[name] = msg
        if all(
            other in found or abs(stamp - t) > LONGEST_BEHIND
            for other, t in self._measured.items()
        ):
            self._last = time_of
            self._open = {t: found for t, found in self._open.items() if t > time_of}
            self._take(lambda: self._read(found, time_of), arrival.received)

    def _read(self, found: Mapping[str, Any], time_of: int) -> TrackedPosture:
        frames = {msg.header.frame_id for msg in found.values()}
        if len(frames) > 1:
            raise MessageError(f'frames {sorted(frames)}, expected one for all rigid bodies')
        has_stamps = all(nanoseconds_of(msg.header.stamp) for msg in found.values())
        posture = posture_of_poses({name: msg.pose for name, msg in found.items()}, self._names)
        return TrackedPosture(posture, time_of if has_stamps else 0, *frames)


class JointInput:
    """`joint_states` and `robot_description`: angles of joints between the links of a URDF."""

    def __init__(self, node: Node, parameters: TrackerParameters, take: Take) -> None:
        """Subscribe."""
        require('tools', 'yourdfpy', 'trimesh')
        # They take a second to load, which nobody else has to wait for.
        from rrth_planner.io.urdf.tree import link_tree_from_urdf

        self._take, self._parse = take, link_tree_from_urdf
        self._tree: LinkTree | None = None
        self._text = ''
        self._subscriptions = [
            OpenSubscription(node, String, 'robot_description', self._on_description),
            _subscribe(node, JointState, 'joint_states', take, self._read),
        ]
        self._topic = self._subscriptions[0].topic_name

    def _on_description(self, msg: String, _: Arrival) -> None:
        if msg.data == self._text:
            return
        self._text, self._tree = msg.data, None
        try:
            self._tree = self._parse(msg.data, self._topic)
        except ModelError as problem:
            _reject(self._take, MessageError(str(problem)))

    def _read(self, msg: JointState) -> TrackedPosture:
        if self._tree is None:
            raise MessageError(f'no good URDF yet on {self._topic}, expected that of the person')
        return posture_from_joint_state(msg, self._tree)


class TransformInput:
    """TF: frames by name, relative to one of them, at the newest time that all have in common."""

    def __init__(self, node: Node, parameters: TrackerParameters, take: Take) -> None:
        """Subscribe to TF, and look it up again and again."""
        skeleton = parameters.skeleton
        self._names, self._take = points_of(skeleton), take
        self._prefix, self._reference = parameters.name_prefix, parameters.base_frame
        if isinstance(skeleton.base, FrameBase):
            self._reference = skeleton.base.frame
        elif isinstance(skeleton.base, JointBase):
            origin = skeleton.base.origin
            self._reference = next(j.points[0] for j in skeleton.joints if j.name == origin)
        has_own = skeleton.base is not None
        self._frames = Frames(node, (self._prefix if has_own else '') + self._reference)
        if not self._frames.is_available:
            raise OptionsError('input: tf, expected where tf2_ros is installed (a system ROS)')
        self._last = 0
        # When something was known last, or it was reported that nothing is [s].
        self._known = time.monotonic()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(1.0 / parameters.rate, self._look_up, clock=steady)

    def _look_up(self) -> None:
        """Hand on what is newer than the last time."""
        arrived, times, problem = time.time_ns(), {}, None
        for name in self._names:
            if name != self._reference:
                try:
                    times[name] = self._frames.newest(self._prefix + name)
                except FrameError as error:
                    problem = problem or error
        if problem is None or times:
            self._known = time.monotonic()
        elif time.monotonic() - self._known > LONGEST_UNKNOWN:
            # Its own frame may be what is missing, or has another name.
            self._known = time.monotonic()
            _reject(self._take, problem)
        newest = max(times.values(), default=0)
        # Those that are fixed are known at all times.
        seen = {name for name, t in times.items() if t == 0 or newest - t <= LONGEST_BEHIND}
        stamp = min((times[name] for name in seen if times[name]), default=0)
        if not stamp or 0 <= self._last - stamp < LATE:
            return
        self._last = stamp
        self._take(lambda: self._read(seen, stamp), arrived)

    def _read(self, seen: set[str], stamp: int) -> TrackedPosture:
        poses = np.full((len(self._names), 4, 4), np.nan)
        for k, name in enumerate(self._names):
            if name == self._reference:
                poses[k] = np.eye(4)
            elif name in seen:
                with suppress(FrameError):
                    poses[k] = self._frames.lookup(self._prefix + name, stamp)
        return TrackedPosture(
            Posture(names=self._names, positions=poses[:, :3, 3], rotations=poses[:, :3, :3]),
            stamp,
            self._reference,
        )


_INPUTS: dict[str, Callable[[Node, TrackerParameters, Take], Any]] = {
    'markers': _marker_input,
    'poses': PoseInput,
    'bodies': BodyInput,
    'joint_states': JointInput,
    'tf': TransformInput,
    'zed': _zed_input,
    'rigid_bodies': RigidBodiesInput,
}
