# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes from tracker to planner: parts that are not believed, and others in the picture."""

from contextlib import contextmanager, ExitStack
from dataclasses import replace

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from conftest import ask, LONGEST_WAIT, send, spinning, wait_until  # noqa: E402
from geometry_msgs.msg import PoseStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rrth_planner.io.motion_capture_file import load_person  # noqa: E402
from rrth_planner.io.skeleton_file import load_skeleton  # noqa: E402
from rrth_planner.ros.client.stand_in_publisher import DRIVERS  # noqa: E402
from rrth_planner.ros.messages.tracked_person import points_to_msg, poses_to_msg  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
from rrth_planner.wearer.body_boxes import base_pose  # noqa: E402
from rrth_planner.wearer.recorded_person import posture_at  # noqa: E402
from rrth_planner.wearer.stand_in import stand_in  # noqa: E402
import samples  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

pytestmark = [pytest.mark.usefixtures('ros_context'), pytest.mark.slow]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
# What a driver reports at its origin where it does not see the left hand.
LOST = {
    'kinect': ('WRIST_LEFT', 'HAND_LEFT', 'HANDTIP_LEFT', 'THUMB_LEFT'),
    'vrpn': ('left_hand',),
}
PARTS = ('left forearm', 'left hand')


class Tracker(Node):
    """Somebody who stands still, as the driver of a tracker publishes him, 30 times a second."""

    def __init__(self, driver):
        """Create publishers, the client of the planner, and what hears the boxes."""
        super().__init__('tracker')
        self.driver, self.lost, self.boxes = DRIVERS[driver], (), []
        # How far others, who look alike, stand from him, by their numbers (3,) [m].
        self.others = {}
        skeleton = load_skeleton('cmu_bvh')
        posture = posture_at(load_person(), 0.0)
        self.skeleton = load_skeleton(self.driver.skeleton)
        self.seen = stand_in(skeleton, posture, self.skeleton, self.driver.view)(posture)
        is_markers = self.driver.input == 'markers'
        names = [''] if is_markers else self.seen.names
        kind = MarkerArray if is_markers else PoseStamped
        self.by_name = {
            name: self.create_publisher(kind, self.driver.topic.replace('{name}', name), 10)
            for name in names
        }
        self.create_subscription(MarkerArray, 'body_boxes', self._hear, BEST_EFFORT)
        self.target = self.create_publisher(type(samples.target()), 'target', LATCHED)
        self.plan = self.create_client(Trigger, 'rrth_planner/plan')
        self.create_timer(1.0 / 30.0, self._publish)

    def _hear(self, msg):
        self.boxes = sorted(m.text for m in msg.markers if m.action == Marker.ADD)

    def _publish(self):
        positions = self.seen.positions.copy()
        positions[[self.seen.names.index(name) for name in self.lost]] = 0.0
        seen = replace(self.seen, positions=positions)
        stamp = self.get_clock().now().to_msg()
        if '' in self.by_name:
            msg = points_to_msg(seen, self.skeleton, self.driver.frame, stamp)
            for marker in msg.markers:
                marker.id += 100
            for number, aside in dict(self.others).items():
                there = replace(self.seen, positions=self.seen.positions + aside)
                other = points_to_msg(there, self.skeleton, self.driver.frame, stamp)
                for marker in other.markers:
                    marker.id += 100 * number
                msg.markers.extend(other.markers)
            self.by_name[''].publish(msg)
            return
        poses = poses_to_msg(seen, self.skeleton, self.driver.frame, stamp)
        for name, pose in zip(seen.names, poses.poses, strict=True):
            self.by_name[name].publish(PoseStamped(header=poses.header, pose=pose))

    def source(self):
        """Return the options of body_boxes_node for this driver."""
        it = self.driver
        options = ['-p', f'skeleton:={it.skeleton}', '-p', f'input:={it.input}']
        if it.input == 'bodies':
            return [*options, '-p', f"pose_topic:='{it.topic}'"]
        return [*options, '-r', f'{it.input}:={it.topic}']

    def rejection(self):
        """Return the sentence of the planner, which shall not plan; empty where it does."""
        future = self.plan.call_async(Trigger.Request())
        wait_until(future.done)
        answer = future.result()
        return '' if answer.success else answer.message


@contextmanager
def running(tracker, said, planner, source=()):
    """Have the nodes from a tracker to an arm run, with parameters of planner and boxes."""
    # A tracker on a busy machine: ages are not what this is about.
    planner = ['separation:=false', 'body_timeout:=20.0', *planner]
    options = [*tracker.source(), *parameters(source)]
    nodes = {
        'rrth_planner.ros.body_boxes_node': options,
        'rrth_planner.ros.playback_node': [],
        'rrth_planner.ros.planner_node': parameters(planner),
    }
    with ExitStack() as stack:
        for module, words in nodes.items():
            process = ChildProcess(module, ['--ros-args', *words], said.append)
            stack.enter_context(process)
        stack.enter_context(spinning(tracker))
        wait_until(tracker.plan.service_is_ready, 8 * LONGEST_WAIT)
        wait_until(lambda: tracker.boxes)
        yield
    tracker.destroy_node()


def parameters(values):
    """Return the words of a command line."""
    return [word for value in values for word in ('-p', value)]


def refused(tracker):
    """Return why the planner does not plan; fail where it does."""
    sentence = tracker.rejection()
    assert sentence, 'planned without the left hand'
    return sentence


@pytest.mark.parametrize('driver', LOST)
def test_nothing_is_planned_without_a_required_part_that_is_not_believed(driver):
    tracker, said = Tracker(driver), []
    tracker.lost = LOST[driver]

    def is_lost(words):
        """Wait until nothing is planned for some reason."""
        # A machine that stalls may lose more, for a while, or not have heard anybody yet.
        wait_until(lambda: words in refused(tracker))
        assert 'left hand' in refused(tracker)
        assert 'torso' in tracker.boxes

    with running(tracker, said, ["required_boxes:=['torso','left hand']"]):
        send(tracker, tracker.target, samples.target())
        is_lost('has no box left hand, expected each of required_boxes')
        assert any('left out until all are seen' in line for line in said), said
        # The hand is seen.
        tracker.lost = ()
        wait_until(lambda: not tracker.rejection())
        wait_until(lambda: set(PARTS) <= set(tracker.boxes))
        assert ask(tracker.plan).success, said
        # It is lost again, and found again.
        tracker.lost = LOST[driver]
        wait_until(lambda: not set(PARTS) & set(tracker.boxes))
        # Where it was seen last its box stays for a while.
        wait_until(tracker.rejection)
        is_lost('has lost parts: ')
        tracker.lost = ()
        wait_until(lambda: not tracker.rejection())
        wait_until(lambda: set(PARTS) <= set(tracker.boxes))


def test_where_a_bystander_stood_is_free_once_he_has_left():
    tracker, said = Tracker('kinect'), []
    # The other stands before him, where the target is.
    forward = base_pose(tracker.skeleton, tracker.seen)[:3, 0]
    bystander = {2: 1.5 * forward}
    tracker.others = bystander
    with running(tracker, said, [], ['person:=1']):
        send(tracker, tracker.target, samples.target())
        for _ in range(2):
            wait_until(lambda: 'person 2' in tracker.boxes)
            wait_until(lambda: 'person 2' in tracker.rejection())
            # He leaves, and later comes back.
            tracker.others = {}
            wait_until(lambda: not tracker.rejection())
            wait_until(lambda: 'person 2' not in tracker.boxes)
            tracker.others = bystander
