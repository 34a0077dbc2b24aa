# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of messages: each counts once, and what was sent last stays last."""

import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PointStamped  # noqa: E402
from hypothesis import given, strategies as st  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.ros import body_history  # noqa: E402
from rrth_planner.ros.bodies import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.body_history import BodyHistory  # noqa: E402
from rrth_planner.ros.edits import read_edits  # noqa: E402
from rrth_planner.ros.messages import joint_reading  # noqa: E402
from rrth_planner.ros.subscriptions import (  # noqa: E402
    DuplicateFilter,
    OpenSubscription,
    REMEMBERED,
)
from samples import array, box, command, FOLDED, JOINTS, target  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402


def told(history, body, sent, *markers, now=0.0):
    """Return a body after an array that was sent at a time [ns]."""
    return history.apply(body, read_edits(array(*markers), now, 'torso'), sent, now)


def names(body):
    """Return the names of a body's boxes."""
    return {b.name for b in scene_of(body).boxes}


def test_a_copy_counts_once_whichever_comes_first():
    copies = DuplicateFilter()
    assert copies.counts_live((10, 1))
    assert not copies.counts_reliable((10, 1))
    assert copies.counts_reliable((20, 2))
    assert not copies.counts_live((20, 2))


def test_a_latched_message_of_a_late_publisher_is_late():
    copies = DuplicateFilter()
    assert copies.counts_live((100, 7))
    assert copies.is_late((50, 1))
    assert copies.counts_reliable((50, 1))
    assert not copies.counts_reliable((50, 1))
    assert not copies.is_late((100, 3))


def test_no_more_than_a_number_of_copies_are_remembered():
    copies = DuplicateFilter()
    assert copies.counts_live((10**6, 0))
    for k in range(2 * REMEMBERED):
        assert copies.counts_live((10**6 + k, 1))
        assert copies.counts_reliable((k, 2))
    assert len(copies._seen) == len(copies._seen_late) == REMEMBERED
    # The newest ones.
    assert not copies.counts_live((10**6 + 2 * REMEMBERED - 1, 1))


def test_what_comes_live_counts_even_from_a_clock_that_is_behind():
    copies = DuplicateFilter()
    assert copies.counts_live((100, 7))
    # The copy of the reliable reader may come first, and is taken for a latched one.
    assert copies.is_late((50, 1))
    copies.counts_reliable((50, 1))
    assert copies.counts_live((50, 1))
    assert copies.newest == 100


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
    copies, applied, late = DuplicateFilter(), [], []
    while live or reliable:
        if live and (not reliable or random.random() < 0.5):
            stamp = live.pop(0)
            if copies.counts_live(stamp):
                applied.append(stamp[1])
        else:
            stamp = reliable.pop(0)
            heard = late if copies.is_late(stamp) else applied
            if copies.counts_reliable(stamp):
                heard.append(stamp[1])
    assert applied == sorted(set(applied))
    assert applied[-1] == n
    assert sorted(applied + late) == list(range(1, n + 1))


@pytest.mark.usefixtures('ros_context')
def test_a_late_latched_target_does_not_override_a_newer_one():
    node, heard, late = Node('hearer'), [], []
    subscriptions = [
        OpenSubscription(node, PointStamped, 'target', lambda msg, *_: heard.append(msg)),
        OpenSubscription(
            node,
            PointStamped,
            'target',
            lambda msg, *_: heard.append(msg),
            lambda msg, sent, _: late.append((msg.point.x, sent)),
        ),
    ]
    new, old = (serialize_message(target(x)) for x in (2.0, 1.0))
    for subscription in subscriptions:
        subscription._on_live(new, {'source_timestamp': 200, 'publication_sequence_number': 1})
        # Of another publisher, whose numbers begin at 1 as well.
        for _ in range(2):
            subscription._on_reliable(
                old, {'source_timestamp': 100, 'publication_sequence_number': 1}
            )
    assert [msg.point.x for msg in heard] == [2.0, 2.0]
    assert late == [(1.0, 100)]
    node.destroy_node()


@pytest.mark.usefixtures('ros_context')
def test_how_far_it_has_read_is_told_by_the_reader_that_hears_everybody():
    node = Node('hearer')
    subscription = OpenSubscription(node, PointStamped, 'target', lambda *_: None)
    data = serialize_message(target())
    assert subscription.progress() == (0, 0)
    # Copies too: they stand in the queues with the others.
    for read, came, expected in (
        (subscription._on_live, 500, 500),
        (subscription._on_reliable, 600, 500),
        (subscription._on_live, 700, 700),
        # Of a middleware that does not say.
        (subscription._on_live, 0, 0),
    ):
        n = subscription.progress()[0]
        info = {'source_timestamp': 100, 'publication_sequence_number': 1}
        read(data, {**info, 'received_timestamp': came})
        assert subscription.progress() == (n + 1, expected)
    node.destroy_node()


def test_a_late_array_takes_its_place_before_the_newer_ones():
    history = BodyHistory()
    body = told(history, WearerBody(), 100, box('torso'), box('hand'))
    body = told(history, body, 200, command(Marker.DELETE, 'hand'), box('head'))
    body = told(history, body, 50, command(Marker.DELETEALL), box('hand'), box('pack'))
    assert names(body) == {'torso/0', 'head/0', 'pack/0'}
    body = told(history, body, 150, box('head', size=(9.0, 9.0, 9.0)))
    assert {b.name: b.size[0] for b in scene_of(body).boxes}['head/0'] == 0.3


def test_a_late_array_takes_nothing_away_that_may_be_forgotten(monkeypatch):
    monkeypatch.setattr(body_history, 'REMEMBERED', 2)
    history, body = BodyHistory(), WearerBody()
    for sent, name in ((100, 'torso'), (200, 'head'), (300, 'hand')):
        body = told(history, body, sent, box(name))
    body = told(history, body, 50, command(Marker.DELETEALL), box('pack'), box('head', 1))
    assert names(body) == {'torso/0', 'head/0', 'hand/0', 'pack/0', 'head/1'}


def test_what_has_expired_is_remembered_until_it_is_deleted_or_added_again():
    hat = box('hat')
    hat.lifetime.sec = 1
    history = BodyHistory()
    body = told(history, WearerBody(), 100, hat, box('torso'))
    assert [key for key, _ in body.at(2.0).expired] == [('hat', 0)]
    assert not body.at(0.5).expired
    later = told(history, body, 200, box('head'), now=2.0)
    assert [key for key, _ in later.expired] == [('hat', 0)]
    assert not told(history, later, 300, box('hat'), now=3.0).expired
    assert not told(history, later, 300, command(Marker.DELETE, 'hat'), now=3.0).expired
    assert not told(history, later, 300, command(Marker.DELETEALL), now=3.0).expired


def test_without_velocities_the_change_of_the_positions_counts():
    first = joint_reading(JointState(name=JOINTS, position=FOLDED), JOINTS, 10.0, None)
    assert not first.velocities.any()
    moved = [FOLDED[0] + 0.1, *FOLDED[1:]]
    second = joint_reading(JointState(name=JOINTS, position=moved), JOINTS, 10.2, first)
    assert second.velocities[0] == pytest.approx(0.5)
    assert second.velocities_expire == 10.5
    at_once = joint_reading(JointState(name=JOINTS, position=moved), JOINTS, 10.0, first)
    assert at_once.velocities[0] > 1e6
