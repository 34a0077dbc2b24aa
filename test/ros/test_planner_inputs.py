# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planner's node makes of its messages, of late, broken and missing ones too."""

import re
import time

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.duration import Duration  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from samples import array, box, FOLDED, JOINTS, joints, target, wearer  # noqa: E402
from stranger import _start, inputs_of, LATCHED, NAN, say_all, TOPICS, VOLATILE  # noqa: E402, F401
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.mark.parametrize('missing', TOPICS)
def test_without_an_input_the_answer_names_its_topic(start, missing):
    planner, stranger = start()
    say_all(planner, stranger, but=(missing,))
    response = stranger.answer()
    assert not response.success
    assert response.message.startswith('UNABLE_TO_AQUIRE_SENSOR_DATA (-5): no ')
    assert f'/{missing}, expected' in response.message
    assert not stranger.received['joint_trajectory']


@pytest.mark.parametrize(
    ('timeout', 'answer'),
    [('body_timeout', 'SENSOR_INFO_STALE (-24)'), ('joint_timeout', 'ROBOT_STATE_STALE (-23)')],
)
def test_old_inputs_are_rejected_with_their_age(start, timeout, answer):
    planner, stranger = start(**{timeout: 1e-6})
    say_all(planner, stranger)
    message = stranger.answer().message
    assert message.startswith(answer)
    assert f's old, expected at most 1e-06 s ({timeout})' in message


def test_joint_positions_age_from_their_stamp_on(start):
    planner, stranger = start(joint_timeout=1.0)
    say_all(planner, stranger)
    source, old = inputs_of(planner).joints, joints()
    for age, is_fresh in ((5.0, False), (0.01, True), (3600.0, False), (-3600.0, True)):
        n_good = source.n_good
        stamp = planner.get_clock().now() - Duration(seconds=age)
        old.header.stamp = stamp.to_msg()
        stranger.publishers['joint_states'].publish(old)
        stranger.wait_until(lambda n=n_good: source.n_good > n)
        message = stranger.answer().message
        if is_fresh:
            assert message.startswith('SUCCESS'), message
        else:
            assert message.startswith('ROBOT_STATE_STALE (-23)'), message
            assert f' is {age:.0f}.' in message
            assert ' s old, expected at most 1 s (joint_timeout)' in message


def test_joint_states_that_waited_for_a_busy_node_are_all_taken_at_once(start, wait_until):
    planner, stranger = start()
    say_all(planner, stranger)
    source, order = inputs_of(planner).joints, []
    timer = planner.create_timer(0.001, lambda: order.append('another callback'))
    accept = source.accept

    def accepted(*arguments):
        order.append('joint state')
        return accept(*arguments)

    source.accept = accepted

    def are_taken_at_once():
        # A busy machine may deliver some of them later.
        order.clear()
        n_good = source.n_good
        planner.executor.create_task(lambda: time.sleep(0.3))
        for _ in range(8):
            stranger.publishers['joint_states'].publish(joints())
        wait_until(lambda: source.n_good == n_good + 8)
        begin = order.index('joint state')
        return order[begin : begin + 8] == ['joint state'] * 8

    assert any(are_taken_at_once() for _ in range(5))
    planner.destroy_timer(timer)


def test_velocities_that_are_no_numbers_are_rejected(start):
    planner, stranger = start()
    say_all(planner, stranger, joint_states=joints(velocity=[NAN, 0.0, 0.0, 0.0]))
    assert stranger.answer().message == (
        'START_STATE_INVALID (-26): joint_1 moves at nan rad/s, expected a velocity for every '
        'joint; answer 1'
    )
    stranger.publishers['joint_states'].publish(joints(velocity=[0.009] * 4))
    stranger.wait_until(lambda: inputs_of(planner).joints.value.velocities[1] == 0.009)
    assert stranger.answer().success


def test_broken_joint_positions_are_not_replaced_by_those_before(start):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs = inputs_of(planner)
    good = inputs.joints.value
    for n, bad in enumerate((joints([NAN] * 4), joints(FOLDED[:3], velocity=[])), 1):
        stranger.publishers['joint_states'].publish(bad)
        stranger.wait_until(lambda n=n: inputs.joints.n_rejected == n)
        message = stranger.answer().message
        assert message.startswith('ROBOT_STATE_STALE (-23): the last message on /test_')
        assert f'was rejected: {inputs.joints.rejection}' in message
    assert inputs.joints.value is good
    assert not stranger.received['joint_trajectory']
    stranger.publishers['joint_states'].publish(joints())
    stranger.wait_until(lambda: inputs.joint_rejection is None)
    assert stranger.answer().success


def test_a_box_whose_lifetime_has_passed_is_named_and_nothing_is_planned(start):
    planner, stranger = start()
    logged = stranger.lines(planner)
    body = wearer()
    pack = box('pack', center=(-1.0, 0.0, -1.0), text='a pack')
    pack.lifetime.nanosec = 10**8
    body.markers.append(pack)
    say_all(planner, stranger, body_boxes=body)
    stranger.wait_until(lambda: stranger.value('lost parts') == '"a pack"')
    stranger.wait_until(lambda: any('lifetime of "a pack"' in line for _, line in logged))
    for _ in range(2):
        message = stranger.answer().message
        assert message.startswith('SENSOR_INFO_STALE (-24): the body on'), message
        assert 'has lost parts: ' in message, message
        assert '"a pack"' in message
    assert sum('lifetime of "a pack"' in line for _, line in logged) == 1
    assert not stranger.received['joint_trajectory']
    gone = box('pack')
    gone.action = Marker.DELETE
    stranger.publishers['body_boxes'].publish(array(gone))
    stranger.wait_until(lambda: not stranger.value('lost parts'))
    assert stranger.answer().success


def test_a_second_publisher_of_the_body_is_reported(start):
    planner, stranger = start()
    logged = stranger.lines(planner)
    say_all(planner, stranger)
    stranger.wait_until(lambda: stranger.value('publishers of the body') == '1')
    other = stranger.node.create_publisher(MarkerArray, 'body_boxes', 10)
    stranger.wait_until(lambda: stranger.value('publishers of the body') == '2')
    stranger.node.destroy_publisher(other)
    stranger.wait_until(lambda: stranger.value('publishers of the body') == '1')
    (line,) = [line for _, line in logged if 'publishers' in line]
    assert 'body_boxes has 2 publishers: for each marker the last edit counts' in line, line


@pytest.mark.parametrize('age', [1.0, 3600.0])
def test_a_body_that_was_measured_long_ago_is_stale_however_new_the_message(start, age):
    planner, stranger = start(body_timeout=0.2)
    body = wearer()
    measured = planner.get_clock().now() - Duration(seconds=age)
    for marker in body.markers:
        marker.header.stamp = measured.to_msg()
    say_all(planner, stranger, body_boxes=body)
    message = stranger.answer().message
    assert message.startswith('SENSOR_INFO_STALE (-24): the last good message on'), message
    found = re.search(r'is ([0-9.]+) s old, expected at most 0.2 s \(body_timeout\)', message)
    assert age <= float(found.group(1)) < age + 60.0
    assert not stranger.received['joint_trajectory']


def test_a_body_without_a_required_box_is_rejected_until_it_comes(start):
    planner, stranger = start(required_boxes=['hat', 'torso'])
    say_all(planner, stranger)
    message = stranger.answer().message
    assert message.startswith('UNABLE_TO_AQUIRE_SENSOR_DATA (-5): the body on'), message
    assert 'has no box hat, expected each of required_boxes' in message
    assert not stranger.received['joint_trajectory']
    stranger.publishers['body_boxes'].publish(array(box('hat', center=(-1.0, 0.0, -1.0))))
    stranger.wait_until(lambda: not inputs_of(planner).body.value.without(['hat']))
    assert stranger.answer().success
    stranger.wait_until(lambda: stranger.value('age of body at decisions').startswith('1, last '))


def readers(planner, topic):
    """Return the durability of the reliable readers of a topic that the planner has."""
    found = planner.get_subscriptions_info_by_topic(topic)
    return [
        info.qos_profile.durability
        for info in found
        if info.node_name == 'rrth_planner'
        and info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    ]


@pytest.mark.parametrize('profile', [LATCHED, VOLATILE, BEST_EFFORT])
def test_publishers_of_every_quality_are_received_once(start, profile):
    planner, stranger = start()
    for name, (_, make) in TOPICS.items():
        stranger.say(name, make(), profile)
        publisher = stranger.publishers[name]
        stranger.wait_until(lambda p=publisher: p.get_subscription_count() > 0)
    inputs = inputs_of(planner)
    if profile is not LATCHED:
        for name, (_, make) in TOPICS.items():
            stranger.publishers[name].publish(make())
    stranger.wait_until(lambda: all(i.measured is not None for i in inputs.all.values()))
    if profile is not BEST_EFFORT:
        # What the best-effort reader misses comes by another one.
        for name in TOPICS:
            topic = planner.resolve_topic_name(name)
            stranger.wait_until(lambda topic=topic: profile.durability in readers(planner, topic))


def test_what_was_latched_before_the_start_is_received(start, spinning, wait_until):
    early = Node('early', namespace='/latched')
    publishers = [
        (early.create_publisher(kind, name, LATCHED), make)
        for name, (kind, make) in TOPICS.items()
    ]
    for publisher, make in publishers:
        publisher.publish(make())
    planner = PlannerNode(InProcessPlanner(), namespace='/latched')
    with spinning(early), spinning(planner):
        wait_until(lambda: all(i.measured is not None for i in inputs_of(planner).all.values()))
    planner.close()
    planner.destroy_node()
    early.destroy_node()


@pytest.mark.parametrize(
    ('topic', 'msg', 'sentence'),
    [
        ('body_boxes', array(box(center=(NAN, 0.0, 0.0))), 'expected finite numbers [m]'),
        ('body_boxes', array(box(size=(-1.0, 1.0, 1.0))), 'expected three lengths > 0 [m]'),
        ('body_boxes', array(box('ok'), box(frame='camera')), 'marker 1 ("torso/0"): frame'),
        ('joint_states', joints(FOLDED[:3], JOINTS[:3]), "no ['joint_4']"),
    ],
)
def test_a_rejected_message_is_reported_and_nothing_is_planned_until_a_good_one(
    start, topic, msg, sentence
):
    planner, stranger = start()
    say_all(planner, stranger)
    inputs = inputs_of(planner)
    before = (inputs.body.value, inputs.joints.value)
    stranger.publishers[topic].publish(msg)
    name = {'body_boxes': 'body', 'joint_states': 'joints'}[topic]
    stranger.wait_until(lambda: stranger.value(f'rejected messages, {name}') == '1')
    assert sentence in stranger.value(f'last rejection, {name}')
    assert (inputs.body.value, inputs.joints.value) == before
    if topic == 'body_boxes':
        # Of joint positions only those of all joints count.
        message = stranger.answer().message
        assert message.startswith('SENSOR_INFO_STALE (-24): the last message on'), message
        assert sentence in message
        stranger.publishers[topic].publish(wearer())
        stranger.wait_until(lambda: not inputs.body.is_last_rejected)
    assert stranger.answer().success


def test_a_rejected_target_is_not_replaced_by_the_one_before(start):
    planner, stranger = start()
    say_all(planner, stranger)
    stranger.publishers['target'].publish(target(frame='camera'))
    stranger.wait_until(lambda: inputs_of(planner).target.n_rejected == 1)
    assert stranger.answer().message.startswith('FRAME_TRANSFORM_FAILURE (-21): the last message')
    stranger.publishers['target'].publish(target())
    stranger.wait_until(lambda: not inputs_of(planner).target.is_last_rejected)
    assert stranger.answer().success


def test_joint_states_of_other_machines_are_ignored(start):
    planner, stranger = start()
    say_all(planner, stranger)
    stranger.publishers['joint_states'].publish(joints([NAN], ['wheel']))
    stranger.publishers['joint_states'].publish(joints([0.1, *FOLDED[1:]]))
    source = inputs_of(planner).joints
    stranger.wait_until(lambda: source.value.positions[0] == 0.1)
    assert source.n_rejected == 0
