# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the drivers of trackers publish, by their types and topics, becomes boxes of the wearer."""

from contextlib import ExitStack
import os
import sys

import message_packages
import numpy as np
import pytest

pytest.importorskip('rclpy')

from conftest import spinning, wait_until  # noqa: E402
from geometry_msgs.msg import Pose  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rrth_planner.cli.parsers import wearer as wearer_parser  # noqa: E402
from rrth_planner.io.motion_capture_file import load_person  # noqa: E402
from rrth_planner.io.skeleton_file import load_skeleton  # noqa: E402
from rrth_planner.model.separation import SeparationRules, speed_bound  # noqa: E402
from rrth_planner.ros.client.stand_in_publisher import DRIVERS  # noqa: E402
from rrth_planner.ros.messages.posture import (  # noqa: E402
    BODY_FORMATS,
    posture_from_markers,
    posture_from_rigid_bodies,
    posture_from_zed,
)
from rrth_planner.ros.messages.wearer_choice import NEAREST, ONLY, WearerChoice  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.wearer.body_boxes import body_boxes  # noqa: E402
from rrth_planner.wearer.recorded_person import posture_at  # noqa: E402
from rrth_planner.wearer.stand_in import stand_in  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
NEAR, FAR = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 3.0])


@pytest.fixture(name='messages', scope='module')
def _messages(request):
    """Have zed_msgs and mocap4r2_msgs, in this process and in those that it starts."""
    with pytest.MonkeyPatch.context() as patch:
        packages = ('zed_msgs', 'mocap4r2_msgs')
        folders = [message_packages.available(p, request.config.cache.mkdir) for p in packages]
        paths = [*folders, os.environ.get('PYTHONPATH', '')]
        patch.setenv('PYTHONPATH', os.pathsep.join(filter(None, paths)))
        yield


def recorded():
    """Return the packaged person at work as he stands first, and his skeleton."""
    return posture_at(load_person(), 0.0), load_skeleton('cmu_bvh')


def seen_as(name):
    """Return what a tracker with a ready-made skeleton sees of that person."""
    posture, skeleton = recorded()
    return stand_in(skeleton, posture, load_skeleton(name), 'camera')(posture)


@pytest.mark.usefixtures('messages')
@pytest.mark.parametrize('driver', DRIVERS)
def test_the_stand_in_of_each_driver_is_a_wearer_for_the_node(driver):
    assert set(wearer_parser.DRIVERS) == set(DRIVERS)
    it, said, seen = DRIVERS[driver], [], []
    topic = 'skeletons' if it.input == 'zed' else it.input
    source = ['-p', f'skeleton:={it.skeleton}', '-p', f'input:={it.input}']
    if it.input == 'bodies':
        source += ['-p', f"pose_topic:='{it.topic}'"]
    elif it.topic != topic:
        source += ['-r', f'{topic}:={it.topic}']
    listener = Node('listener')
    listener.create_subscription(MarkerArray, 'body_boxes', seen.append, BEST_EFFORT)
    with ExitStack() as stack:
        stack.callback(listener.destroy_node)
        stack.enter_context(
            ChildProcess('rrth_planner.cli.wearer', ['--as', driver, '--rate', '0'], said.append)
        )
        stack.enter_context(
            ChildProcess('rrth_planner.ros.body_boxes_node', ['--ros-args', *source], said.append)
        )
        stack.enter_context(spinning(listener))
        wait_until(lambda: len(seen) > 3)
    assert {m.text for m in seen[-1].markers} == {
        part.name for part in load_skeleton(it.skeleton).parts
    }
    assert not [line for line in said if 'rejected' in line], said
    # Each box has its place: that of the recorded person, up to what the trackers see otherwise.
    posture, skeleton = recorded()
    there = {box.name: box.center for box in body_boxes(skeleton, posture)[0].boxes}
    for marker in seen[-1].markers:
        p = marker.pose.position
        assert np.linalg.norm([p.x, p.y, p.z] - there[marker.text]) < 0.25, marker.text


def zed_message(name='zed_body_38', people=(1,), **fields):
    """Return a zed_msgs/ObjectsStamped of persons, and their keypoints."""
    from zed_msgs.msg import Object, ObjectsStamped

    msg, seen = ObjectsStamped(), seen_as(name)
    msg.header.frame_id, msg.header.stamp.sec = 'zed_left_camera_frame', 5
    for number in people:
        thing = Object(label_id=number, confidence=60.0, skeleton_available=True)
        thing.tracking_available, thing.tracking_state = True, 1
        thing.body_format = BODY_FORMATS.index(len(seen.names))
        for keypoint, place in zip(thing.skeleton_3d.keypoints, seen.positions, strict=False):
            keypoint.kp = place + [0.0, number - 1.0, 0.0]
        for field, value in fields.items():
            setattr(thing, field, value)
        msg.objects.append(thing)
    return msg, seen


@pytest.mark.usefixtures('messages')
@pytest.mark.parametrize('n', BODY_FORMATS)
def test_keypoints_of_a_zed_are_the_points_of_a_person(n):
    msg, seen = zed_message(f'zed_body_{n}')
    found = posture_from_zed(msg, seen.names)
    np.testing.assert_allclose(found.posture.positions, seen.positions, atol=1e-6)
    assert (found.stamp, found.frame) == (5 * 10**9, 'zed_left_camera_frame')


@pytest.mark.usefixtures('messages')
def test_keypoints_that_a_zed_does_not_see_or_believe_are_lost():
    msg, seen = zed_message()
    msg.objects[0].skeleton_3d.keypoints[4].kp = [np.nan] * 3
    found = posture_from_zed(msg, seen.names, min_confidence=0.6).posture.positions
    assert np.isnan(found[4]).all()
    assert np.isfinite(found[3]).all()
    assert np.isnan(posture_from_zed(msg, seen.names, min_confidence=0.61).posture.positions).all()


@pytest.mark.usefixtures('messages')
@pytest.mark.parametrize(
    ('fields', 'people', 'words'),
    [
        ({'tracking_state': 2}, (1,), r'tracking_state 2 of person 1, who is hidden'),
        ({'tracking_state': 0}, (1,), r'tracking_state 0 of person 1, expected 1 \(OK\)'),
        ({'body_format': 1}, (1,), 'body_format 1, BODY_34, expected BODY_38'),
        ({'body_format': 7}, (1,), 'body_format 7, BODY_0, expected BODY_38'),
        ({'skeleton_available': False}, (1,), r'skeletons of the persons \[\], expected those'),
        ({}, (1, 2), r'persons \[1, 2\], expected those of a person: choose one'),
        ({}, (3, 3), 'label_id 3: given twice'),
    ],
)
def test_what_is_no_wearer_of_a_zed_is_rejected(fields, people, words):
    msg, seen = zed_message(people=people, **fields)
    with pytest.raises(Exception, match=words):
        posture_from_zed(msg, seen.names)


@pytest.mark.usefixtures('messages')
def test_rigid_bodies_are_found_by_their_names_behind_a_subject():
    from mocap4r2_msgs.msg import RigidBodies, RigidBody

    names = ('chest', 'left_hand')
    pose = Pose()
    pose.orientation.w = 1.0
    given = ['Anna_chest', 'Anna_left_hand', 'Bob_chest', 'wand']
    msg = RigidBodies(rigidbodies=[RigidBody(rigid_body_name=name, pose=pose) for name in given])
    found = posture_from_rigid_bodies(msg, names, 'Anna_').posture
    assert found.names == names
    assert np.isfinite(found.positions).all()
    # Nobody is taken for the wearer by a guess.
    with pytest.raises(Exception, match='set the parameter name_prefix to Anna_'):
        posture_from_rigid_bodies(msg, names)
    del msg.rigidbodies[1]
    lost = posture_from_rigid_bodies(msg, names, 'Anna_').posture.positions
    assert np.isnan(lost).all(axis=1).tolist() == [False, True]
    msg.rigidbodies.append(msg.rigidbodies[0])
    with pytest.raises(Exception, match='"Anna_chest": given twice'):
        posture_from_rigid_bodies(msg, names, 'Anna_')


def sphere(number, place, text='', alpha=1.0):
    """Return a marker of a point."""
    marker = Marker(type=Marker.SPHERE, id=number, text=text)
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = map(float, place)
    marker.color.a = alpha
    return marker


def test_markers_have_names_and_confidences():
    array = MarkerArray(
        markers=[sphere(0, NEAR, 'nose', 0.9), sphere(1, FAR, 'left_ear', 0.4), sphere(2, FAR)]
    )
    names = ('left_ear', 'nose', 'neck')
    found = posture_from_markers(array, names, min_confidence=0.5).posture.positions
    np.testing.assert_array_equal(found, [[np.nan] * 3, NEAR, FAR])
    found = posture_from_markers(array, names).posture.positions
    np.testing.assert_array_equal(found, [FAR, NEAR, FAR])


def test_a_bystander_never_becomes_the_wearer():
    me, other = NEAR[None], FAR[None]
    nearest = WearerChoice(NEAREST, np.zeros(3))
    assert nearest({7: other, 3: me}) == 3
    # Also where the bystander is nearer, and where the wearer has left.
    assert nearest({7: 0.1 * me, 3: me}) == 3
    for _ in range(3):
        with pytest.raises(Exception, match=r'persons \[7\], expected person 3, .* ~/reset'):
            nearest({7: other})
    assert nearest({7: other, 3: me}) == 3
    nearest.reset()
    assert nearest({7: other}) == 7
    # The arm may be elsewhere.
    assert WearerChoice(NEAREST, FAR)({7: other, 3: me}) == 7
    lost = np.full((1, 3), np.nan)
    assert WearerChoice(NEAREST, FAR)({3: lost, 7: other}) == 7
    only = WearerChoice(ONLY, np.zeros(3))
    assert [only({}), only({3: me, 4: other}), only({3: me}), only({3: me, 4: other})] == [
        *(ONLY, ONLY, 3, ONLY)
    ]
    with pytest.raises(Exception, match=r'persons \[4\], expected person 3'):
        only({4: me})
    assert WearerChoice(5, np.zeros(3))({4: me}) == 5


class Scene(Node):
    """Publishes persons as a Kinect driver does, and hears what the node makes of them."""

    def __init__(self):
        """Create publisher, subscription and the client of the reset."""
        super().__init__('scene')
        self.heard, self.said, self.time = [], [], 1000
        self.publisher = self.create_publisher(MarkerArray, 'markers', 10)
        self.create_subscription(MarkerArray, 'body_boxes', self.heard.append, BEST_EFFORT)
        self.reset = self.create_client(Trigger, 'body_boxes_node/reset')
        self.wearer = seen_as('azure_kinect')

    def show(self, *people):
        """Publish persons, numbers and how far aside each stands [m]; return the answer."""
        self.time += 1
        array = MarkerArray()
        for number, aside in people:
            for k, place in enumerate(self.wearer.positions):
                if np.isfinite(place).all():
                    marker = sphere(100 * number + k, place + [0.0, aside, 0.0])
                    marker.header.frame_id, marker.header.stamp.sec = 'depth', self.time
                    array.markers.append(marker)
        self.publisher.publish(array)
        return self.time

    def answers(self, time):
        """Return the boxes of a message."""
        return [m for m in self.heard if m.markers[0].header.stamp.sec == time]

    def boxes(self, *people):
        """Return the boxes that persons become, by their texts."""
        time = self.show(*people)
        wait_until(lambda: self.answers(time))
        return {m.text: m for m in self.answers(time)[0].markers}


def test_others_are_boxes_and_a_change_of_person_needs_a_reset():
    parts = {part.name for part in load_skeleton('azure_kinect').parts}
    scene = Scene()
    options = ['--ros-args', '-p', 'person:=nearest']
    with (
        ChildProcess('rrth_planner.ros.body_boxes_node', options, scene.said.append),
        spinning(scene),
    ):
        wait_until(lambda: scene.publisher.get_subscription_count() > 0)
        wait_until(lambda: scene.count_publishers('body_boxes') > 0)
        wait_until(scene.reset.service_is_ready)
        wait_until(lambda: scene.show((2, 2.0), (1, 0.0)) and scene.heard)
        boxes = scene.boxes((2, 2.0), (1, 0.0))
        assert set(boxes) == {*parts, 'person 2'}
        p, s = boxes['person 2'].pose.position, boxes['person 2'].scale
        # A person high and broad; in the base frame his side is to the right or to the left.
        assert abs(np.hypot(p.x, p.y) - 2.0) < 0.3
        assert s.z > 1.4
        assert speed_bound(SeparationRules(), 'person 2') == 2.0
        # Whoever leaves is deleted by name, again and again, and then forgotten.
        boxes = scene.boxes((1, 0.0))
        assert boxes['person 2'].action == Marker.DELETE
        scene.boxes((1, 0.0))
        assert set(scene.boxes((1, 0.0))) == parts
        # The wearer has left: nothing is published, however near the bystander comes.
        lost = [scene.show((2, aside)) for aside in (2.0, 1.0, 0.0)]
        assert set(scene.boxes((1, 0.0), (2, 1.0))) == {*parts, 'person 2'}
        assert not any(scene.answers(time) for time in lost)
        # What a process writes comes by another way than what it publishes.
        words = 'expected person 1, who is the wearer'
        wait_until(lambda: any(words in line for line in scene.said))
        answer = scene.reset.call_async(Trigger.Request())
        wait_until(answer.done)
        assert answer.result().success
        assert parts <= set(scene.boxes((2, 0.0)))
    scene.destroy_node()


@pytest.mark.parametrize(
    ('name', 'package'), [('zed', 'zed_msgs'), ('rigid_bodies', 'mocap4r2_msgs')]
)
def test_without_the_package_of_its_messages_an_input_says_so(name, package, call, monkeypatch):
    from rrth_planner.ros import body_boxes_node

    for module in (package, f'{package}.msg'):
        monkeypatch.setitem(sys.modules, module, None)
    options = ['-p', f'input:={name}']
    ended = call(body_boxes_node.main, '--ros-args', *options)
    assert ended.returncode == 1
    assert f'input {name}: expected where the package {package} is inst' in ended.stderr
    assert len(ended.stderr.splitlines()) == 1, ended.stderr


@pytest.mark.parametrize(
    ('option', 'words'),
    [
        ('person:=farthest', "person: 'farthest', expected a whole number from -1 to 10000000"),
        ('person:=-2', 'person: -2, expected a whole number'),
        ('arm_position:=[1.0,2.0]', 'arm_position: '),
        ('min_confidence:=1.5', 'min_confidence: 1.5, expected a number from 0 to 1'),
    ],
)
def test_choices_that_are_none_are_named(option, words, call):
    from rrth_planner.ros import body_boxes_node

    ended = call(body_boxes_node.main, '--ros-args', '-p', option)
    assert ended.returncode == 1
    assert words in ended.stderr
    assert len(ended.stderr.splitlines()) == 1, ended.stderr
