# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node body_boxes_node, from outside: what trackers publish comes out as boxes, or nothing."""

from array import array
from dataclasses import replace
import io
from itertools import count
import re
import subprocess
import sys
from types import SimpleNamespace

from fleshed_person import make_person, seen_by
from human_urdf import human_urdf
import numpy as np
import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Time  # noqa: E402
from conftest import spinning, wait_until  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from geometry_msgs.msg import PoseArray, PoseStamped, TransformStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rclpy.time import Time as RosTime  # noqa: E402
from rrth_planner.io.skeleton_file import load_skeleton  # noqa: E402
from rrth_planner.model.rotation import quaternion_xyzw  # noqa: E402
from rrth_planner.ros import body_boxes_node  # noqa: E402
from rrth_planner.ros.body_boxes_node import BodyBoxesNode  # noqa: E402
from rrth_planner.ros.interface import tracker_reporter  # noqa: E402
from rrth_planner.ros.interface.posture_inputs import points_of  # noqa: E402
from rrth_planner.ros.messages import frames  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import measured_at, read_edits  # noqa: E402
from rrth_planner.ros.messages.tracked_person import points_to_msg, poses_to_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.wearer.body_boxes import body_boxes  # noqa: E402
from rrth_planner.wearer.posture import Posture  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# Boxes that come close behind one another are all heard.
ALL = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
MODULE = [sys.executable, '-m', 'rrth_planner.ros.body_boxes_node']
FIRST = 'poses: the first body is published'
# Each ready-made skeleton, and what a tracker of its kind publishes.
TRACKERS = [
    ('azure_kinect', 'markers'),
    ('mediapipe', 'markers'),
    ('mediapipe', 'poses'),
    ('xsens', 'poses'),
    ('cmu_bvh', 'poses'),
    ('xsens_bvh', 'poses'),
    ('xsens', 'bodies'),
    ('tum_bvh', 'bodies'),
    ('ros4hri', 'bodies'),
    ('xsens', 'tf'),
    ('ros4hri', 'tf'),
    ('azure_kinect', 'tf'),
]


def stamp_of(nanoseconds):
    """Return a time as messages have it."""
    sec, nanosec = divmod(nanoseconds, 10**9)
    return Time(sec=sec, nanosec=nanosec)


def person_of(name, seed=7):
    """Return what a tracker of a kind reports of a person who stands upright."""
    return seen_by(name, make_person(np.random.default_rng(seed), is_upright=True))


def moved(posture, name, move):
    """Return a posture in which a point is elsewhere."""
    positions = posture.positions.copy()
    positions[posture.names.index(name)] += move
    return replace(posture, positions=positions)


class FakeTransformError(Exception):
    """What tf2_ros raises."""


class FakeBuffer:
    """The part of tf2_ros.Buffer that is used: frames with one pose each, and when it was."""

    poses, times = {}, {}

    def __init__(self, *, node):
        self.node = node

    def lookup_transform(self, target_frame, source_frame, time):
        """Return the pose of a frame in another one."""
        if time.nanoseconds > self.get_latest_common_time(target_frame, source_frame).nanoseconds:
            raise FakeTransformError('would require extrapolation into the future')
        T = np.linalg.inv(self.poses[target_frame]) @ self.poses[source_frame]
        stamped = TransformStamped()
        t, r = stamped.transform.translation, stamped.transform.rotation
        t.x, t.y, t.z = T[:3, 3].tolist()
        r.x, r.y, r.z, r.w = quaternion_xyzw(T[:3, :3]).tolist()
        return stamped

    def get_latest_common_time(self, target_frame, source_frame):
        """Return when both frames were known last."""
        if not {target_frame, source_frame} <= set(self.times):
            raise FakeTransformError(f'"{source_frame}" is unknown')
        return RosTime(nanoseconds=min(self.times[target_frame], self.times[source_frame]))


@pytest.fixture(name='tf')
def _tf(monkeypatch):
    """Have TF with frames that a test sets."""
    FakeBuffer.poses.clear()
    FakeBuffer.times.clear()
    fake = SimpleNamespace(
        Buffer=FakeBuffer,
        TransformListener=lambda buffer, node: None,
        TransformException=FakeTransformError,
    )
    monkeypatch.setattr(frames, 'tf2_ros', fake)


class Tracker(Node):
    """Publishes a person as trackers do, and hears what the node makes of him."""

    def __init__(self, skeleton, source, **parameters):
        """Start the node beside it."""
        super().__init__('tracker')
        self.skeleton, self.source = load_skeleton(skeleton), source
        self.boxes, self.diagnostics, self.logs = [], [], []
        self.sent = count(1)
        values = {'skeleton': skeleton, 'input': source, **parameters}
        self.node = BodyBoxesNode(
            parameter_overrides=[Parameter(k, value=v) for k, v in values.items()]
        )
        self.node.get_logger().warning = lambda words, **_: self.logs.append(words)
        self.node.get_logger().info = lambda words, **_: self.logs.append(words)
        self.create_subscription(MarkerArray, 'body_boxes', self.boxes.append, ALL)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        kinds = {'markers': MarkerArray, 'poses': PoseArray, 'joint_states': JointState}
        self.publishers_of = {}
        if source in kinds:
            self.publishers_of[source] = self.create_publisher(kinds[source], source, BEST_EFFORT)
        if source == 'bodies':
            for name in points_of(self.skeleton):
                self.publishers_of[name] = self.create_publisher(PoseStamped, f'{name}/pose', 10)
        if source == 'joint_states':
            self.urdf = self.create_publisher(String, 'robot_description', LATCHED)

    def _on_diagnostics(self, msg):
        self.diagnostics += [s for s in msg.status if s.name == 'body_boxes_node: tracking']

    @property
    def figures(self):
        """The values of the last diagnostics."""
        return {v.key: v.value for v in self.diagnostics[-1].values} if self.diagnostics else {}

    def wait_for_node(self):
        """Wait until everybody hears everybody."""
        (boxes,) = (p for p in self.node.publishers if p.topic_name == '/body_boxes')
        for publisher in (boxes, *self.publishers_of.values()):
            wait_until(lambda p=publisher: p.get_subscription_count() > 0)

    def send(self, posture, stamp, frame='camera'):
        """Publish a posture measured at a time [ns]."""
        time = stamp_of(stamp)
        if self.source == 'markers':
            msg = points_to_msg(posture, self.skeleton, frame, time)
            self.publishers_of['markers'].publish(msg)
        elif self.source == 'poses':
            self.publishers_of['poses'].publish(poses_to_msg(posture, self.skeleton, frame, time))
        elif self.source == 'tf':
            poses = self.poses_of(posture)
            FakeBuffer.poses.update(poses)
            FakeBuffer.times.update(dict.fromkeys(poses, stamp))
        else:
            for name, msg in self.bodies_of(posture, stamp, frame):
                self.publishers_of[name].publish(msg)

    def send_in_turn(self, posture, stamp):
        """Have the node take the bodies of a posture one after the other, in this order."""
        for name, msg in self.bodies_of(posture, stamp, 'camera'):
            topic, n = f'/{name}/pose', next(self.sent)
            (take,) = (s.callback for s in self.node.subscriptions if s.topic_name == topic)
            info = {'source_timestamp': n, 'publication_sequence_number': n}
            wait_until(self.node.executor.create_task(take, serialize_message(msg), info).done)

    def poses_of(self, posture):
        """Return the poses of a posture that the skeleton needs, by name."""
        poses = {}
        for name in points_of(self.skeleton):
            if name in posture.names:
                k, T = posture.names.index(name), np.eye(4)
                T[:3, 3] = posture.positions[k]
                if posture.rotations is not None:
                    T[:3, :3] = posture.rotations[k]
                poses[name] = T
        return poses

    def bodies_of(self, posture, stamp, frame):
        """Yield the name and the message of each body that is seen."""
        for name, T in self.poses_of(posture).items():
            if not np.isnan(T).any():
                pose = PoseStamped()
                pose.header.frame_id, pose.header.stamp = frame, stamp_of(stamp)
                p, o = pose.pose.position, pose.pose.orientation
                p.x, p.y, p.z = T[:3, 3].tolist()
                o.x, o.y, o.z, o.w = quaternion_xyzw(T[:3, :3]).tolist()
                yield name, pose

    def hear(self, posture, stamp):
        """Publish a posture, and return the boxes that have its stamp."""
        self.send(posture, stamp)
        return self.wait_for(stamp)

    def wait_for(self, stamp):
        """Return the boxes with a stamp [ns]."""
        time = stamp_of(stamp)

        def found():
            return [m for m in self.boxes if m.markers[0].header.stamp == time]

        wait_until(found)
        return found()[0]

    def wait_for_rejection(self, words):
        """Wait until a sentence says why a message is rejected; it is in diagnostics too."""
        wait_until(lambda: any(re.search(words, line) for line in self.logs))
        wait_until(lambda: re.search(words, self.figures.get('last rejection', '')))
        assert self.diagnostics[-1].level == DiagnosticStatus.WARN


@pytest.fixture
def start(monkeypatch):
    """Return a function that starts a node and its tracker, which run until the test ends."""
    # Each test that waits for diagnostics would wait for a second.
    monkeypatch.setattr(tracker_reporter, 'DIAGNOSTICS_PERIOD', 0.1)
    running = []

    def started(*arguments, **parameters):
        tracker = Tracker(*arguments, **parameters)
        block = spinning(tracker.node, tracker)
        block.__enter__()
        running.append((tracker, block))
        tracker.wait_for_node()
        return tracker

    yield started
    for tracker, block in running:
        block.__exit__(None, None, None)
        tracker.node.destroy_node()
        tracker.destroy_node()


def expect(msg, skeleton, posture, frame='torso'):
    """Compare boxes with those that the core makes; return the names of the lost parts."""
    scene, lost = body_boxes(skeleton, posture)
    assert {m.header.frame_id for m in msg.markers} == {frame}
    found = scene_of(WearerBody().apply(msg, 1e10, frame))
    assert [box.name for box in found.boxes] == [box.name for box in scene.boxes]
    np.testing.assert_allclose(found.numbers, scene.numbers, rtol=0, atol=1e-9)
    return lost


NOW = 1_700_000_000_000_000_000
STEP = 20_000_000


@pytest.mark.usefixtures('tf')
@pytest.mark.parametrize(('name', 'source'), TRACKERS)
def test_a_tracker_of_each_kind_becomes_the_boxes_of_the_core(name, source, start):
    tracker = start(name, source, lifetime=0.25)
    posture = person_of(name)
    msg = tracker.hear(posture, NOW + 123)
    lost = expect(msg, tracker.skeleton, posture)
    assert not lost
    for marker in msg.markers:
        assert (marker.ns, marker.id) == (marker.text, 0)
        assert marker.header.stamp == stamp_of(NOW + 123)
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, 250_000_000)
    # And the next one of a person who has moved.
    other = replace(posture, positions=posture.positions + [0.02, 0.01, 0.0])
    expect(tracker.hear(other, NOW + STEP), tracker.skeleton, other)


def test_hands_have_the_size_that_is_said(start):
    tracker = start('mediapipe', 'poses', hand_size=0.2)
    posture = person_of('mediapipe')
    msg = tracker.hear(posture, NOW + 123)
    expect(msg, load_skeleton('mediapipe', hand_size=0.2), posture)
    sizes = {m.text: [m.scale.x, m.scale.y, m.scale.z] for m in msg.markers}
    np.testing.assert_allclose([sizes['left hand'], sizes['right hand']], 0.2, atol=1e-9)


def test_joint_states_of_a_person_with_a_urdf_become_boxes(start):
    yourdfpy = pytest.importorskip('yourdfpy')
    tracker = start('ros4hri', 'joint_states')
    publisher = tracker.publishers_of['joint_states']
    msg = JointState(name=['joint_1'], position=[0.0])
    publisher.publish(msg)
    tracker.wait_for_rejection('no good URDF yet on /robot_description')
    tracker.urdf.publish(String(data='<robot'))
    wait_until(lambda: 'readable XML' in tracker.figures['last rejection'])
    text = human_urdf()
    tracker.urdf.publish(String(data=text))
    person = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)
    q = np.random.default_rng(3).uniform(-0.5, 0.5, person.num_actuated_joints)
    person.update_cfg(dict(zip(person.actuated_joint_names, q, strict=True)))
    # An independent forward kinematics, in another frame.
    names = tuple(name.removesuffix('_ab3de') for name in person.link_map)
    poses = np.array([person.get_transform(name, 'l_wrist_ab3de') for name in person.link_map])
    posture = Posture(names=names, positions=poses[:, :3, 3], rotations=poses[:, :3, :3])
    msg = JointState(name=person.actuated_joint_names, position=array('d', q))
    msg.header.stamp = stamp_of(NOW)

    def is_heard():
        publisher.publish(msg)
        return tracker.boxes

    wait_until(is_heard)
    assert not expect(tracker.wait_for(NOW), tracker.skeleton, posture)
    # A joint that is not a number takes what is beyond it along, and nothing else.
    msg.header.stamp = stamp_of(NOW + STEP)
    msg.position[msg.name.index('l_elbow_ab3de')] = np.nan
    publisher.publish(msg)
    seen = {m.ns for m in tracker.wait_for(NOW + STEP).markers}
    parts = {part.name for part in tracker.skeleton.parts}
    assert parts - seen == {'left forearm', 'left hand'}


@pytest.mark.parametrize(('name', 'source'), [('azure_kinect', 'markers'), ('xsens', 'poses')])
def test_without_a_stamp_the_planner_counts_the_latency_of_the_tracker(start, name, source):
    tracker = start(name, source)
    tracker.send(person_of(name), 0)
    wait_until(lambda: tracker.boxes)
    edits = read_edits(tracker.boxes[0], 1e9, 'torso', latency=0.15)
    assert measured_at(edits, 0.0) == 1e9 - 0.15
    wait_until(lambda: float(tracker.figures.get('age of the last measurement [s]') or 'inf') < 30)


@pytest.mark.parametrize('stamp', [-(10**9), (2**31 - 1) * 10**9 + 2 * 10**9])
def test_a_stamp_that_is_no_time_is_rejected_and_forgotten(start, stamp):
    tracker = start('xsens', 'poses')
    posture = person_of('xsens')
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)
    sec = stamp // 10**9
    msg = poses_to_msg(posture, tracker.skeleton, 'camera', stamp_of(NOW))
    msg.header.stamp = Time(sec=min(sec, 2**31 - 1), nanosec=2**31 if sec > 0 else 0)
    tracker.publishers_of['poses'].publish(msg)
    tracker.wait_for_rejection(r'header\.stamp: .* s, expected a time since 1970')
    # The next jump is still held back.
    far = replace(posture, positions=posture.positions + 0.5)
    expect(tracker.hear(far, NOW + STEP), tracker.skeleton, posture)


def test_the_log_says_what_is_waited_for_and_when_the_first_body_is_published(start):
    tracker = start('azure_kinect', 'markers')
    wait_until(lambda: 'waiting for markers' in tracker.logs)
    for k in range(3):
        tracker.hear(person_of('azure_kinect'), NOW + k * STEP)
    first = FIRST.replace('poses', 'markers')
    wait_until(lambda: first in tracker.logs)
    assert tracker.logs.count(first) == 1


def test_a_part_that_is_lost_is_left_out_and_named_once(start):
    tracker = start('xsens', 'poses')
    posture = person_of('xsens')
    lost = moved(posture, 'LeftHand', np.nan)
    for k in range(5):
        assert expect(tracker.hear(lost, NOW + k * STEP), tracker.skeleton, lost)
    named = [line for line in tracker.logs if 'left hand' in line]
    assert named == ['poses: no points of left forearm, left hand: left out until all are seen']
    wait_until(lambda: tracker.figures.get('lost parts') == 'left forearm, left hand')
    assert tracker.diagnostics[-1].level in (DiagnosticStatus.WARN, DiagnosticStatus.STALE)
    assert not expect(tracker.hear(posture, NOW + 5 * STEP), tracker.skeleton, posture)
    wait_until(lambda: tracker.figures['lost parts'] == '')


def test_a_jump_is_held_back_once_and_counted(start):
    tracker = start('azure_kinect', 'markers')
    posture = person_of('azure_kinect')
    jumped = replace(posture, positions=posture.positions + [0.0, 0.0, 0.6])
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)
    expect(tracker.hear(jumped, NOW + STEP), tracker.skeleton, posture)
    expect(tracker.hear(jumped, NOW + 2 * STEP), tracker.skeleton, jumped)
    n = str(len(posture.names))
    wait_until(lambda: tracker.figures.get('jumps held back') == n)
    # After a gap it may be anywhere.
    late = NOW + 2 * STEP + 300_000_000
    expect(tracker.hear(posture, late), tracker.skeleton, posture)


def test_a_point_at_0_0_0_is_lost_named_once_and_jumps_neither_there_nor_back(start):
    tracker = start('azure_kinect', 'markers')
    posture = person_of('azure_kinect')
    posture = replace(posture, positions=posture.positions + 2.0)
    zero = posture.positions.copy()
    zero[[posture.names.index(name) for name in ('WRIST_LEFT', 'HAND_LEFT')]] = 0.0
    zero = replace(posture, positions=zero)
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)
    for k in range(1, 4):
        lost = expect(tracker.hear(zero, NOW + k * STEP), tracker.skeleton, zero)
        assert lost == ('left forearm', 'left hand')
    assert not expect(tracker.hear(posture, NOW + 4 * STEP), tracker.skeleton, posture)
    named = [line for line in tracker.logs if 'left hand' in line]
    assert named == [
        'markers: no points of left forearm, left hand: left out until all are seen '
        '("WRIST_LEFT", "HAND_LEFT" at exactly 0 0 0)'
    ]
    wait_until(lambda: tracker.figures.get('frames published') == '5')
    assert tracker.figures['jumps held back'] == '0'


@pytest.mark.parametrize(('name', 'source'), [('azure_kinect', 'markers'), ('xsens', 'poses')])
def test_a_person_in_millimetres_is_rejected_with_the_unit(name, source, start):
    tracker = start(name, source)
    posture = person_of(name)
    tracker.send(replace(posture, positions=1000.0 * posture.positions), NOW)
    tracker.wait_for_rejection('m away, expected metres: are the positions in mm')
    assert not tracker.boxes


def test_a_rigid_body_whose_quaternion_has_no_length_is_lost(start):
    tracker = start('xsens', 'bodies')
    posture = person_of('xsens')
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)
    rotations = posture.rotations.copy()
    k = posture.names.index('LeftHand')
    for others in (False, True):
        chosen = [i for i in range(len(posture.names)) if (i != k) == others]
        part = replace(
            posture,
            names=tuple(posture.names[i] for i in chosen),
            positions=posture.positions[chosen],
            rotations=rotations[chosen],
        )
        if others:
            tracker.send(part, NOW + STEP)
        else:
            pose = PoseStamped()
            pose.header.frame_id, pose.header.stamp = 'camera', stamp_of(NOW + STEP)
            pose.pose.orientation.w = 0.0
            tracker.publishers_of['LeftHand'].publish(pose)
    seen = {marker.ns for marker in tracker.wait_for(NOW + STEP).markers}
    parts = {part.name for part in tracker.skeleton.parts}
    assert parts - seen == {'left forearm', 'left hand'}


def test_without_the_base_frame_nothing_is_published(start):
    tracker = start('azure_kinect', 'markers')
    posture = person_of('azure_kinect')
    tracker.send(moved(posture, 'SPINE_CHEST', np.nan), NOW)
    tracker.wait_for_rejection('base: "neck" or a joint of its axes is lost')
    expect(tracker.hear(posture, NOW + STEP), tracker.skeleton, posture)
    assert len(tracker.boxes) == 1
    wait_until(lambda: tracker.figures['frames received'] == '2')
    assert (tracker.figures['frames rejected'], tracker.figures['frames published']) == ('1', '1')
    assert tracker.figures['received to published'].startswith('1, last ')


def test_what_is_no_person_is_rejected_and_the_node_goes_on(start):
    tracker = start('azure_kinect', 'markers')
    posture = person_of('azure_kinect')
    publisher = tracker.publishers_of['markers']
    # Another type, by its bytes.
    from rclpy.serialization import serialize_message

    publisher.publish(b'\x00\x01\x00\x00\xff\xff\xff\x7f')
    tracker.wait_for_rejection('8 bytes that are no MarkerArray')
    publisher.publish(serialize_message(MarkerArray()))
    wait_until(lambda: 'expected those of a person' in tracker.figures['last rejection'])
    two = points_to_msg(posture, tracker.skeleton, 'camera', stamp_of(NOW))
    for marker in two.markers[::2]:
        marker.id += 300
    publisher.publish(two)
    wait_until(lambda: 'persons [0, 3]' in tracker.figures['last rejection'])
    unknown = points_to_msg(posture, tracker.skeleton, 'camera', stamp_of(NOW))
    unknown.markers[0].id = 99
    publisher.publish(unknown)
    wait_until(lambda: 'id 99: joint 99, expected 0 to 31' in tracker.figures['last rejection'])
    assert not tracker.boxes
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)


def test_names_that_the_tracker_has_not_are_parts_that_are_lost(start):
    tracker = start('xsens', 'poses')
    posture = person_of('xsens')
    names = tuple('Foot' if name == 'LeftFoot' else name for name in posture.names)
    unknown = replace(posture, names=names)
    msg = tracker.hear(unknown, NOW)
    assert expect(msg, tracker.skeleton, unknown) == ('left shin', 'left foot')


def test_a_person_among_others_is_chosen_by_his_number(start):
    tracker = start('azure_kinect', 'markers', person=3)
    posture, other = person_of('azure_kinect'), person_of('azure_kinect', seed=8)
    mine = points_to_msg(posture, tracker.skeleton, 'camera', stamp_of(NOW))
    for marker in mine.markers:
        marker.id += 300
    others = points_to_msg(other, tracker.skeleton, 'camera', stamp_of(NOW - STEP))
    mine.markers = [*others.markers, *mine.markers]
    tracker.publishers_of['markers'].publish(mine)
    msg = tracker.wait_for(NOW)
    # Whoever else is there is a box that no entry of body_speeds slows down.
    assert [(m.ns, m.id, m.text) for m in msg.markers[-1:]] == [('person', 0, 'person 0')]
    del msg.markers[-1]
    expect(msg, tracker.skeleton, posture)


@pytest.mark.parametrize('place', [np.inf, np.nan, 0.0, 1e7])
def test_a_point_of_another_person_that_is_none_changes_no_box(start, place):
    tracker = start('azure_kinect', 'markers', person=3)
    posture, other = person_of('azure_kinect'), person_of('azure_kinect', seed=8)
    sizes = []
    for k, lost in enumerate((np.nan, place)):
        positions = other.positions.copy()
        positions[5] = lost
        theirs = replace(other, positions=positions)
        msg = points_to_msg(posture, tracker.skeleton, 'camera', stamp_of(NOW + k * STEP))
        for marker in msg.markers:
            marker.id += 300
        msg.markers += points_to_msg(theirs, tracker.skeleton, 'camera', Time()).markers
        if k == 1 and np.isfinite(place):
            assert any(marker.pose.position.x == place for marker in msg.markers)
        tracker.publishers_of['markers'].publish(msg)
        boxes = tracker.wait_for(NOW + k * STEP)
        assert boxes.markers[-1].text == 'person 0'
        sizes.append(boxes.markers[-1].scale)
        del boxes.markers[-1]
        expect(boxes, tracker.skeleton, posture)
    assert sizes[0] == sizes[1]


def test_a_rigid_body_that_is_lost_delays_no_other(start):
    tracker = start('xsens', 'bodies')
    posture = person_of('xsens')
    keep = [k for k, name in enumerate(posture.names) if name != 'RightHand']
    lost = Posture(
        names=tuple(posture.names[k] for k in keep),
        positions=posture.positions[keep],
        rotations=posture.rotations[keep],
    )
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)
    # For a tenth of a second the others wait for it.
    for k in range(1, 9):
        tracker.send_in_turn(lost, NOW + k * STEP)
    for k in range(6, 9):
        expect(tracker.wait_for(NOW + k * STEP), tracker.skeleton, lost)
    assert len(tracker.boxes) == 4
    # It is back: at the latest from the second measurement on.
    tracker.send_in_turn(posture, NOW + 9 * STEP)
    tracker.wait_for(NOW + 9 * STEP)
    expect(tracker.hear(posture, NOW + 10 * STEP), tracker.skeleton, posture)


def test_rigid_bodies_whose_stamps_never_fit_are_named(start):
    tracker = start('tum_bvh', 'bodies')
    posture = person_of('tum_bvh')
    last = points_of(tracker.skeleton)[-1]

    def part_of(names):
        chosen = [posture.names.index(name) for name in names]
        return Posture(
            names=tuple(names),
            positions=posture.positions[chosen],
            rotations=posture.rotations[chosen],
        )

    others = [name for name in points_of(tracker.skeleton) if name != last]
    for k in range(15):
        for names, stamp in ((others, NOW + k * STEP), ([last], NOW + k * STEP + 3_000_000)):
            tracker.send_in_turn(part_of(names), stamp)
    tracker.wait_for_rejection('stamps of the rigid bodies .* ms apart, expected at most 2 ms')
    assert not tracker.boxes


def test_rigid_bodies_of_two_measurements_are_not_mixed(start):
    tracker = start('tum_bvh', 'bodies')
    posture = person_of('tum_bvh')
    later = replace(posture, positions=posture.positions + [0.05, 0.0, 0.0])
    # Topics overtake each other.
    first = points_of(tracker.skeleton)[0]
    tracker.send(posture, NOW)
    tracker.wait_for(NOW)
    for part, stamp in ((later, NOW + 2 * STEP), (posture, NOW + STEP)):
        k = part.names.index(first)
        one = Posture(
            names=(first,),
            positions=part.positions[k : k + 1],
            rotations=part.rotations[k : k + 1],
        )
        tracker.send_in_turn(one, stamp)
    rest = [k for k, name in enumerate(later.names) if name != first]
    tracker.hear(
        Posture(
            names=tuple(later.names[k] for k in rest),
            positions=later.positions[rest],
            rotations=later.rotations[rest],
        ),
        NOW + 2 * STEP,
    )
    expect(tracker.wait_for(NOW + 2 * STEP), tracker.skeleton, later)
    assert len(tracker.boxes) == 2


@pytest.mark.usefixtures('tf')
def test_where_tf_lacks_the_frame_of_the_chest_that_is_said(start):
    tracker = start('xsens', 'tf')
    posture = person_of('xsens')
    others = [name for name in posture.names if name != 'T8']
    FakeBuffer.poses.update({name: np.eye(4) for name in others})
    FakeBuffer.times.update(dict.fromkeys(others, NOW))
    tracker.wait_for_rejection('frame "Pelvis", expected a frame that TF knows')
    expect(tracker.hear(posture, NOW + STEP), tracker.skeleton, posture)


@pytest.mark.usefixtures('tf')
def test_a_frame_that_tf_has_not_heard_of_for_long_is_lost_and_delays_no_other(start):
    tracker = start('xsens', 'tf')
    posture = person_of('xsens')
    expect(tracker.hear(posture, NOW), tracker.skeleton, posture)
    without = moved(posture, 'RightHand', np.nan)
    known = [name for name in posture.names if name != 'RightHand']
    # A little later it may still come. The node may be looking: what it sees then of both times is
    # not so far apart that frames of the first one count as lost.
    FakeBuffer.times.update(dict.fromkeys(known, NOW + 90_000_000))
    FakeBuffer.times.update(dict.fromkeys(known, NOW + 150_000_000))
    msg = tracker.wait_for(NOW + 150_000_000)
    expect(msg, tracker.skeleton, without)


def test_where_the_tracker_reports_in_the_base_frame_boxes_are_in_its_own(start, tmp_path):
    file = tmp_path / 'own.yaml'
    file.write_text(
        'base: none\njoints: {hips: a, neck: b}\nnames_by_id: [a, b]\n'
        'parts: {trunk: {bone: [hips, neck], radius: 0.2, ends: [0.1, 0.1]}}\n'
        'without: [torso, pelvis, neck, head, left upper arm, right upper arm, left forearm, '
        'right forearm, left hand, right hand, left thigh, right thigh, left shin, right shin, '
        'left foot, right foot]\n'
    )
    tracker = start(str(file), 'markers')
    posture = Posture(names=('a', 'b'), positions=np.array([[0, 0, 0], [0.0, 0, 0.5]]))
    tracker.send(posture, NOW, frame='chest')
    expect(tracker.wait_for(NOW), tracker.skeleton, posture, frame='chest')
    tracker.send(posture, NOW + STEP, frame='')
    expect(tracker.wait_for(NOW + STEP), tracker.skeleton, posture)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['skeleton:=none'], 'file config/skeletons/none.yaml: not found'),
        (['input:=faces'], 'input: "faces", expected one of markers, poses, bodies'),
        (['skeleton:=tum_bvh'], 'input: markers, which have no names; expected a skeleton'),
        (['max_jump:=0.0'], 'max_jump: 0.0, expected a number from 0.01 to 100 [m]'),
        (['pose_topic:=pose'], 'pose_topic: "pose", expected a name with {name}'),
        (['skeletton:=xsens'], 'skeletton: no such parameter, the closest name is skeleton'),
        (
            ['skeleton:=xsens', 'input:=bodies', "pose_topic:='{name} /pose'"],
            'pose_topic: Invalid topic name',
        ),
    ],
)
def test_a_start_that_cannot_be_is_one_sentence(arguments, words, call):
    options = [word for argument in arguments for word in ('-p', argument)]
    ended = call(body_boxes_node.main, '--ros-args', *options)
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
    assert 'cannot start: ' in ended.stderr
    assert words in ended.stderr


def test_a_start_that_cannot_be_ends_the_process():
    ended = subprocess.run(
        [*MODULE, '--ros-args', '-p', 'skeleton:=none'],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
    assert 'cannot start: ' in ended.stderr


def test_without_tf_the_input_tf_says_so(monkeypatch):
    monkeypatch.setattr(frames, 'tf2_ros', None)
    with pytest.raises(Exception, match='input: tf, expected where tf2_ros is installed'):
        BodyBoxesNode(
            parameter_overrides=[
                Parameter('skeleton', value='xsens'),
                Parameter('input', value='tf'),
            ]
        )


def test_no_error_ends_the_node(start, monkeypatch):
    tracker = start('azure_kinect', 'markers')

    def fail(*_):
        raise ZeroDivisionError('unexpected')

    posture = person_of('azure_kinect')
    with monkeypatch.context() as patch:
        patch.setattr(body_boxes_node, 'boxes_of_plausible', fail)
        tracker.send(posture, NOW)
        wait_until(lambda: tracker.figures.get('frames received') == '1')
    expect(tracker.hear(posture, NOW + STEP), tracker.skeleton, posture)


@pytest.mark.slow
def test_beside_a_recorded_person_the_planner_plans_by_what_a_tracker_sees(
    wait_until, send, ask, spinning
):
    pytest.importorskip('fcl')
    client, said, of_node = Node('client'), [], []
    target = client.create_publisher(type(samples.target()), 'target', LATCHED)
    plan = client.create_client(Trigger, 'rrth_planner/plan')
    seen = []
    client.create_subscription(MarkerArray, 'body_boxes', seen.append, BEST_EFFORT)
    tracked = ['--ros-args', '-p', 'skeleton:=cmu_bvh', '-p', 'input:=poses']
    required = "required_boxes:=['torso','head','left hand','right hand','left foot']"
    with (
        ChildProcess('rrth_planner.cli.wearer', ['--as', 'poses', '--rate', '0'], said.append),
        ChildProcess('rrth_planner.ros.body_boxes_node', tracked, of_node.append) as node,
        ChildProcess('rrth_planner.ros.playback_node', [], said.append),
        ChildProcess(
            'rrth_planner.ros.planner_node',
            ['--ros-args', '-p', 'separation:=false', '-p', 'body_timeout:=5.0', '-p', required],
            said.append,
        ),
        spinning(client),
    ):
        wait_until(plan.service_is_ready, 240.0)
        wait_until(lambda: seen)
        send(client, target, samples.target())
        answer = ask(plan)
        node.check()
    assert answer.success, (answer.message, said)
    assert answer.message.startswith('SUCCESS (1): ')
    assert len(seen[-1].markers) == len(load_skeleton('cmu_bvh').parts)
    # Nothing but that: no part is lost, no message rejected.
    assert [line for line in of_node if line != 'waiting for poses'] == [FIRST]
