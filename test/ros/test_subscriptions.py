# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of messages: each counts once, and what was sent last stays last."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PointStamped  # noqa: E402
from hypothesis import given, settings, strategies as st  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.ros.interface.inputs import Input  # noqa: E402
from rrth_planner.ros.messages import marker_order  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.joint_state import joint_reading  # noqa: E402
from rrth_planner.ros.messages.marker_edits import read_edits  # noqa: E402
from rrth_planner.ros.messages.marker_order import MarkerOrder  # noqa: E402
from rrth_planner.ros.middleware.open_subscription import (  # noqa: E402
    Copies,
    MOST_AT_ONCE,
    OpenSubscription,
    REMEMBERED,
)
from samples import array, box, command, FOLDED, JOINTS, target  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402

LIVE, RELIABLE = None, 'reliable'


def applied(order, body, sent, *markers, now=0.0, newer=None):
    """Return a body after an array that was sent at a time [ns]; newer: it comes after those."""
    edits = read_edits(array(*markers), now, 'torso')
    return order.apply(body, edits, (sent, 1), now, newer and (lambda other: other[0] in newer))


def names(body):
    """Return the names of a body's boxes."""
    return {b.name for b in scene_of(body).boxes}


def take(copies, sent, number, reader=LIVE):
    """Return what becomes of a copy: None, 'news' or 'late'."""
    arrival = copies.take((sent, number), 0, reader)
    return arrival and ('news' if arrival.is_newer is None else 'late')


def test_a_copy_counts_once_whichever_comes_first():
    copies = Copies(takes_late=True)
    assert take(copies, 10, 1) == 'news'
    assert take(copies, 10, 1, RELIABLE) is None
    assert take(copies, 20, 2, RELIABLE) == 'news'
    assert take(copies, 20, 2) is None


def test_a_latched_message_of_a_late_publisher_is_late():
    copies = Copies(takes_late=True)
    assert take(copies, 100, 7) == 'news'
    assert take(copies, 50, 1, RELIABLE) == 'late'
    assert take(copies, 50, 1, RELIABLE) is None


def test_what_comes_live_counts_even_from_a_clock_that_is_behind():
    for takes_late in (True, False):
        copies = Copies(takes_late)
        assert take(copies, 100, 7) == 'news'
        assert take(copies, 50, 1) == 'news'
    # The copy of the reliable reader may come first, and is taken for a latched one.
    copies = Copies(takes_late=False)
    assert take(copies, 100, 7) == 'news'
    assert take(copies, 50, 1, RELIABLE) is None
    assert take(copies, 50, 1) == 'news'


def test_no_more_than_a_number_of_copies_are_remembered():
    copies = Copies(takes_late=True)
    assert take(copies, 10**9, 0) == 'news'
    for k in range(2 * REMEMBERED):
        assert take(copies, 10**6 + k, 1)
        assert take(copies, k, 2, RELIABLE)
    assert len(copies._readers) == len(copies._counted) == REMEMBERED
    # A publisher whose clock was ahead is forgotten with its messages.
    assert copies._newest < 10**9
    assert take(copies, 2 * REMEMBERED - 1, 2, RELIABLE) is None


@st.composite
def streams(draw):
    """Draw what publishers send, and in which order copies of it come by two readers."""
    sent = []
    for publisher in range(draw(st.integers(1, 3))):
        # Their clocks differ by up to 50 ms, and they send every 10 ms.
        ahead = draw(st.integers(-50, 50))
        n, kind = draw(st.integers(1, 8)), draw(st.sampled_from(['both', 'live']))
        for k in range(n):
            stamp = (10**6 + 10 * k + ahead) * 3 + publisher
            sent.append((10 * k + publisher, publisher, (stamp, k + 1), kind))
    queues = {LIVE: [], RELIABLE: []}
    for _, publisher, stamp, kind in sorted(sent):
        # The live reader loses some, and the reliable one too where it is too slow.
        if kind == 'live' or draw(st.integers(0, 3)):
            queues[LIVE].append((publisher, stamp))
        if kind == 'both' and draw(st.integers(0, 9)):
            queues[RELIABLE].append((publisher, stamp))
    order = []
    while any(queues.values()):
        reader = draw(st.sampled_from([name for name, queue in queues.items() if queue]))
        order.append((reader, *queues[reader].pop(0)))
    return order


@settings(max_examples=500)
@given(order=streams())
def test_the_newest_edit_of_each_publisher_stays_whatever_their_clocks_say(order):
    copies, markers, body = Copies(takes_late=True), MarkerOrder(), WearerBody()
    newest, n_late = {}, 0
    for reader, publisher, sent in order:
        arrival = copies.take(sent, 0, reader)
        newest[publisher] = max(newest.get(publisher, 0), sent[1])
        if arrival is not None:
            # The number of the array identifies it.
            edits = read_edits(array(box(f'part {publisher}', 0, (sent[1], 0, 0))), 0.0, 'torso')
            body = markers.apply(body, edits, sent, 0.0, arrival.is_newer)
            n_late += arrival.is_newer is not None
        seen = {key[0]: part.boxes[0].center[0] for key, part in body.parts}
        assert seen == {f'part {name}': number for name, number in newest.items()}


@given(
    st.integers(1, 12).flatmap(
        lambda n: st.tuples(st.just(n), st.sets(st.integers(1, n)), st.randoms())
    )
)
def test_the_last_message_is_the_last_that_counts_and_none_is_missed(case):
    n, lost, random = case
    # Live copies, some lost, and all reliable ones, each stream in its order, mixed at random.
    live = [(10 * k, k) for k in range(1, n + 1) if k not in lost]
    reliable = [(10 * k, k) for k in range(1, n + 1)]
    copies, received = Copies(takes_late=True), {'news': [], 'late': []}
    while live or reliable:
        is_live = live and (not reliable or random.random() < 0.5)
        sent = (live if is_live else reliable).pop(0)
        found = take(copies, *sent, LIVE if is_live else RELIABLE)
        if found:
            received[found].append(sent[1])
    assert received['news'] == sorted(set(received['news']))
    assert received['news'][-1] == n
    assert sorted(received['news'] + received['late']) == list(range(1, n + 1))


@pytest.mark.usefixtures('ros_context')
def test_a_late_latched_target_does_not_override_a_newer_one():
    node, received, late = Node('subscriber'), [], []
    subscriptions = [
        OpenSubscription(node, PointStamped, 'target', lambda msg, _: received.append(msg)),
        OpenSubscription(
            node,
            PointStamped,
            'target',
            lambda msg, arrival: (
                received.append(msg)
                if arrival.is_newer is None
                else late.append((msg.point.x, arrival.sent[0]))
            ),
            takes_late=True,
        ),
    ]
    new, old = (serialize_message(target(x)) for x in (2.0, 1.0))
    for subscription in subscriptions:
        info = {'source_timestamp': 200, 'publication_sequence_number': 1}
        subscription._on_copy(new, info, None)
        # Of another publisher, whose numbers begin at 1 as well.
        for _ in range(2):
            subscription._on_copy(
                old, {'source_timestamp': 100, 'publication_sequence_number': 1}, RELIABLE
            )
    assert [msg.point.x for msg in received] == [2.0, 2.0]
    assert late == [(1.0, 100)]
    node.destroy_node()


@pytest.mark.usefixtures('ros_context')
def test_a_late_body_changes_neither_age_nor_rejection():
    source = Input('body', WearerBody())

    def reject():
        raise MessageError('no box')

    assert source.accept(WearerBody, 1.0)
    assert not source.accept(reject, 2.0)
    assert not source.accept(WearerBody, 3.0, is_news=False)
    assert source.is_last_rejected
    assert source.age(4.0) == 3.0
    assert source.accept(WearerBody, 4.0)
    assert not source.is_last_rejected


def test_a_late_array_does_nothing_to_markers_that_newer_ones_have_edited():
    order = MarkerOrder()
    body = applied(order, WearerBody(), 100, box('torso'), box('hand'))
    body = applied(order, body, 200, command(Marker.DELETE, 'hand'), box('head'))
    late = (command(Marker.DELETEALL), box('hand'), box('pack'))
    body = applied(order, body, 50, *late, newer={100, 200})
    assert names(body) == {'torso/0', 'head/0', 'pack/0'}
    body = applied(order, body, 150, box('head', size=(9.0, 9.0, 9.0)), newer={200})
    assert {b.name: b.size[0] for b in scene_of(body).boxes}['head/0'] == 0.3
    # Of another clock: what seems to be sent before was sent after it.
    body = applied(order, body, 30, box('head', size=(8.0, 8.0, 8.0)))
    assert {b.name: b.size[0] for b in scene_of(body).boxes}['head/0'] == 8.0


def test_a_late_array_adds_nothing_that_was_deleted_since_with_all_others():
    order = MarkerOrder()
    body = applied(order, WearerBody(), 100, box('torso'), box('hand'), box('hand', 1))
    body = applied(order, body, 200, command(Marker.DELETEALL, 'hand'))
    late = (box('hand', 1), box('hand', 2), box('torso', 1))
    body = applied(order, body, 150, *late, newer={200})
    assert names(body) == {'torso/0', 'torso/1'}
    # A late one deletes what came before it, and that alone.
    body = applied(order, body, 120, command(Marker.DELETEALL), newer={150, 200})
    assert names(body) == {'torso/1'}
    body = applied(order, body, 300, command(Marker.DELETEALL))
    assert not body.parts
    assert not applied(order, body, 250, box('torso'), newer={300}).parts


def test_what_an_order_remembers_is_bounded(monkeypatch):
    monkeypatch.setattr(marker_order, 'REMEMBERED', 20)
    order, body = MarkerOrder(), applied(MarkerOrder(), WearerBody(), 1, box('torso'))
    for k in range(100):
        body = applied(order, body, k, command(Marker.DELETE, 'hat', k), box('torso'))
        body = applied(order, body, k, command(Marker.DELETEALL, f'hats {k}'))
    assert len(order._markers) <= 22
    assert len(order._namespaces) == 20
    assert names(body) == {'torso/0'}


def test_what_is_lost_is_remembered_until_it_is_deleted_or_added_again():
    hat = box('hat')
    hat.lifetime.sec = 1
    order = MarkerOrder()
    body = applied(order, WearerBody(), 100, hat, box('torso'))
    assert [key for key, _ in body.at(2.0).lost] == [('hat', 0)]
    assert not body.at(0.5).lost
    later = applied(order, body, 200, box('head'), now=2.0)
    assert [key for key, _ in later.lost] == [('hat', 0)]
    assert not applied(order, later, 300, box('hat'), now=3.0).lost
    assert not applied(order, later, 300, command(Marker.DELETE, 'hat'), now=3.0).lost
    assert not applied(order, later, 300, command(Marker.DELETEALL), now=3.0).lost


def test_without_velocities_the_change_of_the_positions_counts():
    first = joint_reading(JointState(name=JOINTS, position=FOLDED), JOINTS, 10.0, None)
    assert not first.velocities.any()
    moved = [FOLDED[0] + 0.1, *FOLDED[1:]]
    second = joint_reading(JointState(name=JOINTS, position=moved), JOINTS, 10.2, first)
    assert second.velocities[0] == pytest.approx(0.5)
    assert second.velocities_expire == 10.5
    at_once = joint_reading(JointState(name=JOINTS, position=moved), JOINTS, 10.0, first)
    assert at_once.velocities[0] > 1e6


def wrapped(angle, low):
    """Return an angle as a driver reports it that wraps, from low on [rad]."""
    return low + (angle - low) % (2.0 * np.pi)


@pytest.mark.parametrize('low', [-np.pi, 0.0])
@pytest.mark.parametrize('has_velocities', [False, True])
def test_positions_that_a_driver_wraps_go_on(low, has_velocities):
    is_continuous = (False, False, False, True)
    begin = wrapped(3.0, low)
    reading, noise = None, np.random.default_rng(0)
    way = np.concatenate([np.linspace(3.0, 16.0, 300), np.linspace(16.0, -9.0, 600)])
    for k, angle in enumerate(way + noise.uniform(-1e-3, 1e-3, len(way))):
        msg = JointState(name=JOINTS, position=[*FOLDED[:3], wrapped(angle, low)])
        if has_velocities:
            msg.velocity = [0.0] * 4
        reading = joint_reading(msg, JOINTS, 10.0 + 0.02 * k, reading, is_continuous)
        assert reading.positions[3] == pytest.approx(angle - 3.0 + begin, abs=1e-9)
        assert np.abs(reading.velocities).max() < 5.0
    # After a while, too: this driver has been seen to wrap.
    msg = JointState(name=JOINTS, position=[*FOLDED[:3], wrapped(-9.2, low)])
    reading = joint_reading(msg, JOINTS, 90.0, reading, is_continuous)
    assert reading.positions[3] == pytest.approx(-9.2 - 3.0 + begin, abs=1e-9)


def test_positions_that_a_driver_counts_are_taken_as_they_are():
    is_continuous, reading = (False, False, False, True), None
    # The last one: it was started again, and has forgotten the turns.
    for k, angle in enumerate((3.1, 3.2, 4.0, 9.0, 9.0, 2.7168)):
        msg = JointState(name=JOINTS, position=[*FOLDED[:3], angle])
        reading = joint_reading(msg, JOINTS, 10.0 + 0.02 * k, reading, is_continuous)
        assert reading.positions[3] == angle
    # Without turns: it may have been turned by hand, and commands refer to what it reports.
    for k, angle in enumerate((3.1, -3.1)):
        msg = JointState(name=JOINTS, position=[*FOLDED[:3], angle])
        reading = joint_reading(msg, JOINTS, 20.0 + 2.0 * k, reading, is_continuous)
        assert reading.positions[3] == angle
    # Joints with stops do not wrap.
    first = joint_reading(JointState(name=JOINTS, position=[3.1] * 4), JOINTS, 1.0, None)
    other = JointState(name=JOINTS, position=[-3.1] * 4)
    assert (joint_reading(other, JOINTS, 1.01, first, (False,) * 4).positions == -3.1).all()


@pytest.mark.usefixtures('ros_context')
def test_of_a_stream_only_the_newest_message_is_read_from_every_publisher(wait_until, spinning):
    node, sender, received = Node('subscriber'), Node('sender'), []
    stream = OpenSubscription(
        node, PointStamped, 'stream', lambda msg, _: received.append(msg.point.x), is_stream=True
    )
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    live = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publishers = [sender.create_publisher(PointStamped, 'stream', q) for q in (latched, live)]
    for publisher in publishers:
        wait_until(lambda p=publisher: p.get_subscription_count() == 1)
    # The node is late: nobody has read the first ones.
    for x in (1.0, 2.0, 3.0):
        publishers[0].publish(target(x))
    time.sleep(0.2)
    with spinning(node):
        wait_until(lambda: received)
        publishers[1].publish(target(4.0))
        wait_until(lambda: 4.0 in received)
    assert received == [3.0, 4.0]
    assert not stream._reliable


@pytest.mark.usefixtures('ros_context')
def test_all_that_a_reader_holds_is_taken_at_once_and_the_last_one_is_known(wait_until, spinning):
    node, sender, received = Node('subscriber'), Node('sender'), []
    OpenSubscription(
        node,
        PointStamped,
        'held',
        lambda msg, arrival: received.append((msg.point.x, arrival.is_followed)),
        takes_all=True,
    )
    publisher = sender.create_publisher(PointStamped, 'held', QoSProfile(depth=50))
    with spinning(node):
        # The reader for reliable publishers as well.
        wait_until(lambda: publisher.get_subscription_count() == 2)
    # The node is late.
    n = MOST_AT_ONCE + 4
    for x in range(n):
        publisher.publish(target(float(x)))
    time.sleep(0.2)
    with spinning(node):
        wait_until(lambda: len(received) >= n)
    lasts = (MOST_AT_ONCE - 1, n - 1)
    assert received == [(float(x), x not in lasts) for x in range(n)]
