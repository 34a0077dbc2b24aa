# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded person is published as a tracker would: when it was measured, and where he was."""

from contextlib import contextmanager
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PoseArray  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rrth_planner.cli import wearer as wearer_command  # noqa: E402
from rrth_planner.io.motion_capture_file import load_person  # noqa: E402
from rrth_planner.io.skeleton_file import load_skeleton  # noqa: E402
from rrth_planner.ros.client.person_publisher import FORMS, PersonPublisher  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.part_markers import PartMarkers  # noqa: E402
from rrth_planner.ros.messages.tracked_person import points_to_msg, poses_to_msg  # noqa: E402
from rrth_planner.wearer.body_boxes import body_boxes  # noqa: E402
from rrth_planner.wearer.posture import Posture  # noqa: E402
from rrth_planner.wearer.recorded_person import posture_at  # noqa: E402
from rrth_planner.wearer.tracker import measurement, Tracker  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

MODULE = [sys.executable, '-m', 'rrth_planner.cli.wearer']
FPS, LATENCY = 100.0, 0.2
BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)

pytestmark = pytest.mark.usefixtures('ros_context')


@contextmanager
def wearer(*arguments):
    """Run the command until the block is left, then press Ctrl-C repeatedly; it must end well."""
    process = subprocess.Popen(
        [*MODULE, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
        # Many, so that one comes while another is handled, and while the command waits.
        for _ in range(30):
            process.send_signal(signal.SIGINT)
        _, words = process.communicate(timeout=60.0)
        assert (process.returncode, words) == (0, '')
    finally:
        process.kill()
        process.wait()


def seconds(stamp):
    """Return a stamp of a message [s]."""
    return stamp.sec + 1e-9 * stamp.nanosec


def part_markers(skeleton):
    """Return what makes markers of the parts of a skeleton."""
    return PartMarkers([part.name for part in skeleton.parts], 0.5)


def posture_of(names=('a', 'b'), lost=False):
    """Return a posture of points, the last of which may be lost."""
    positions = np.arange(3.0 * len(names)).reshape(-1, 3)
    if lost:
        positions[-1] = np.nan
    return Posture(names=names, positions=positions)


@pytest.mark.parametrize('form', list(FORMS))
def test_what_is_published_is_what_was_measured_at_its_stamp(form, spinning, wait_until):
    topic, kind = FORMS[form]
    node, received = Node('listener'), []
    node.create_subscription(
        kind, topic, lambda msg: received.append((msg, time.time())), BEST_EFFORT
    )
    options = ('--fps', FPS, '--latency', LATENCY, '--noise', 0.01, '--seed', 3, '--drop', 0.2)
    with spinning(node), wearer('--as', form, *options):
        wait_until(lambda: len(received) > 60)
    headers = [m.header if form == 'poses' else m.markers[0].header for m, _ in received]
    stamps = np.array([seconds(header.stamp) for header in headers])
    assert {h.frame_id for h in headers} == {'torso' if form == 'boxes' else 'tracker'}
    # Published late by the latency, with the stamp of the measurement.
    ages = np.array([arrived for _, arrived in received]) - stamps
    assert ages.min() > LATENCY - 0.01
    person, skeleton = load_person(), load_skeleton('cmu_bvh')
    tracker = Tracker(fps=FPS, latency=LATENCY, noise=0.01, seed=3, drop=0.2)
    # Which measurement the first message is, is found by what it says; the others by their time.
    numbers = np.rint((stamps - stamps[0]) * FPS).astype(int)
    assert (np.diff(numbers) >= 1).all()
    assert (np.diff(numbers) > 1).any()

    def expected(number):
        posture = measurement(tracker, person, number)
        if posture is None:
            return None
        stamp = headers[0].stamp
        if form == 'boxes':
            return part_markers(skeleton).message(body_boxes(skeleton, posture)[0], 'torso', stamp)
        if form == 'markers':
            return points_to_msg(posture, skeleton, 'tracker', stamp)
        return poses_to_msg(posture, skeleton, 'tracker', stamp)

    def places(msg):
        poses = msg.poses if form == 'poses' else [m.pose for m in msg.markers]
        return np.array([[p.position.x, p.position.y, p.position.z] for p in poses])

    def is_equal(msg, number):
        other = expected(number)
        return other is not None and np.array_equal(places(msg), places(other), equal_nan=True)

    first = next(k for k in range(2000) if is_equal(received[0][0], k))
    for (msg, _), number in zip(received, numbers, strict=True):
        assert is_equal(msg, first + number)


def test_the_boxes_are_a_wearer_for_the_planner():
    person, skeleton = load_person(), load_skeleton('cmu_bvh')
    body = WearerBody()
    for time_s in (0.0, 1.7, 5.2):
        scene, missing = body_boxes(skeleton, posture_at(person, time_s))
        assert not missing
        msg = part_markers(skeleton).message(scene, 'torso', PoseArray().header.stamp)
        body = body.apply(msg, 10.0 + time_s, 'torso')
        found = scene_of(body)
        assert [box.name for box in found.boxes] == [box.name for box in scene.boxes]
        np.testing.assert_allclose(found.numbers, scene.numbers, atol=1e-9)
    # Each marker ends by itself.
    assert not body.at(20.0).parts
    assert set(body.at(20.0).lost_names().split(', ')) == {f'"{b.name}"' for b in scene.boxes}


def test_a_part_that_is_lost_keeps_its_id_and_is_left_out():
    person, skeleton = load_person(), load_skeleton('cmu_bvh')
    seen = posture_at(person, 0.0)
    positions = seen.positions.copy()
    positions[seen.names.index('lForeArm')] = np.nan
    lost = Posture(names=seen.names, positions=positions, rotations=seen.rotations)
    ids = []
    for posture in (seen, lost):
        scene, missing = body_boxes(skeleton, posture)
        msg = part_markers(skeleton).message(scene, 'torso', PoseArray().header.stamp)
        ids.append({m.text: (m.ns, m.id) for m in msg.markers})
        assert all(m.action == Marker.ADD and m.type == Marker.CUBE for m in msg.markers)
        assert all(seconds(m.lifetime) == 0.5 for m in msg.markers)
    assert missing
    assert ids[1] == {name: k for name, k in ids[0].items() if name not in missing}


def test_points_have_the_ids_of_the_skeleton_and_lost_ones_are_left_out():
    kinect = load_skeleton('azure_kinect')
    names = tuple(reversed(kinect.names_by_id))
    msg = points_to_msg(posture_of(names, lost=True), kinect, 'tracker', PoseArray().header.stamp)
    assert len(msg.markers) == len(names) - 1
    for marker in msg.markers:
        assert marker.type == Marker.SPHERE
        k = names.index(kinect.names_by_id[marker.id])
        assert marker.pose.position.y == 3.0 * k + 1.0
    # Where a skeleton has none, they are counted.
    other = points_to_msg(
        posture_of(), load_skeleton('tum_bvh'), 'tracker', PoseArray().header.stamp
    )
    assert [m.id for m in other.markers] == [0, 1]


def test_poses_that_are_lost_are_no_numbers():
    unordered = load_skeleton('tum_bvh')
    msg = poses_to_msg(posture_of(lost=True), unordered, 'tracker', PoseArray().header.stamp)
    assert [pose.position.x for pose in msg.poses[:1]] == [0.0]
    assert np.isnan(msg.poses[1].position.x)
    assert np.isnan(msg.poses[0].orientation.w)


def test_poses_are_in_the_order_of_the_skeleton_and_what_it_has_not_is_left_out():
    xsens = load_skeleton('xsens')
    names = ('hat', *reversed(xsens.names_by_id[1:]))
    msg = poses_to_msg(posture_of(names), xsens, 'tracker', PoseArray().header.stamp)
    assert len(msg.poses) == len(xsens.names_by_id)
    assert np.isnan(msg.poses[0].position.x)
    for name, pose in zip(xsens.names_by_id[1:], msg.poses[1:], strict=True):
        assert pose.position.x == 3.0 * names.index(name)


def test_a_person_without_a_base_frame_is_not_published(wait_until, spinning):
    skeleton = load_skeleton('cmu_bvh')
    node, received = Node('listener'), []
    node.create_subscription(MarkerArray, 'body_boxes', received.append, BEST_EFFORT)
    publisher = PersonPublisher(skeleton, 'boxes')
    seen = posture_at(load_person(), 0.0)
    with spinning(node):
        wait_until(lambda: publisher.publisher.get_subscription_count() == 1)
        publisher.publish(posture_of(), 0.0)
        publisher.publish(seen, 0.0)
        wait_until(lambda: received)
        time.sleep(0.1)
    (msg,) = received
    assert len(msg.markers) == len(skeleton.parts)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['none.bvh'], 'file none.bvh: No such file or directory'),
        (['--drop', '2'], 'drop: 2.0, expected a share from 0 to below 1'),
        (['--begin', '20'], 'expected times in this order within the recording, 0 to 9.600 [s]'),
        (['--skeleton', 'none'], 'file config/skeletons/none.yaml: not found'),
        (['--skeleton', 'mediapipe'], '--skeleton mediapipe: base: '),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(arguments, words, call):
    ended = call(wearer_command.main, *arguments)
    assert ended.returncode == 1
    assert ended.stderr.startswith('wearer: ')
    assert len(ended.stderr.splitlines()) == 1
    assert words in ended.stderr
    assert not ended.stdout


def test_what_is_wrong_ends_the_process():
    ended = subprocess.run([*MODULE, 'none.bvh'], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert line.startswith('wearer: file none.bvh: No such file or directory')
