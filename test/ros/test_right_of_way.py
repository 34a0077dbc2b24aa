# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A planner gives way to whoever holds the wearer against a motion that runs."""

import os
from threading import Event, get_ident, Thread

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.node import Node  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.ros.middleware import thread_priority  # noqa: E402
from rrth_planner.ros.middleware.open_subscription import OpenSubscription  # noqa: E402
from rrth_planner.ros.middleware.thread_priority import RightOfWay  # noqa: E402
from rrth_planner.ros.planner_node import PlannerNode  # noqa: E402
from rrth_planner.ros.requests import request_queue  # noqa: E402
from std_msgs.msg import Int32  # noqa: E402

# What waits is seen to wait for this long [s].
SOON = 0.1


@pytest.fixture(name='patient')
def _patient(monkeypatch):
    """Have nobody give up waiting within a test, nor wait seldom."""
    monkeypatch.setattr(thread_priority, 'LONGEST', 60.0)
    monkeypatch.setattr(thread_priority, 'APART', -1.0)


def giving(way):
    """Return what is set once a thread has given way."""
    given = Event()

    def give():
        way.give()
        given.set()

    Thread(target=give, daemon=True).start()
    return given


def test_who_plans_waits_until_the_way_is_left(patient):
    way = RightOfWay()
    assert giving(way).wait(30.0)
    for _ in range(3):
        with way:
            given = giving(way)
            assert not given.wait(SOON)
        assert given.wait(30.0)


def test_a_way_is_left_whatever_goes_wrong_in_it(patient):
    way = RightOfWay()
    with pytest.raises(ValueError, match='wrong'), way:
        raise ValueError('wrong')
    assert giving(way).wait(30.0)


def test_nobody_waits_long(monkeypatch, patient):
    monkeypatch.setattr(thread_priority, 'LONGEST', 1e-3)
    way = RightOfWay()
    with way:
        assert giving(way).wait(30.0)


def test_nobody_waits_again_and_again(monkeypatch, patient):
    way = RightOfWay()
    with way:
        given = giving(way)
        assert not given.wait(SOON)
    assert given.wait(30.0)
    monkeypatch.setattr(thread_priority, 'APART', 1e6)
    with way:
        assert giving(way).wait(30.0)


def test_a_message_is_read_and_dealt_with_on_the_way(ros_context, wait_until, spinning):
    node, way, heard = Node('walker'), RightOfWay(), []

    def deal(msg, *_):
        heard.append((msg.data, way._is_free.is_set()))
        raise ValueError('nobody deals with that')

    subscription = OpenSubscription(node, Int32, 'walked', deal, way=way)
    publisher = node.create_publisher(Int32, subscription.topic_name, 10)
    with spinning(node):
        wait_until(lambda: publisher.get_subscription_count() > 0)
        for k in range(2):
            publisher.publish(Int32(data=k))
            wait_until(lambda k=k: len(heard) > k)
        wait_until(way._is_free.is_set)
    assert heard == [(0, False), (1, False)]
    node.destroy_node()


@pytest.mark.parametrize(('priority', 'put'), [(10, 9), (2, 1), (1, None), (0, None)])
def test_who_plans_stands_back_where_threads_run_in_real_time(monkeypatch, priority, put):
    told = []
    monkeypatch.setattr(os, 'sched_getparam', lambda _: os.sched_param(priority))
    monkeypatch.setattr(os, 'sched_setparam', lambda k, p: told.append((k, p.sched_priority)))
    thread_priority.stand_back()
    assert told == ([] if put is None else [(0, put)])


def test_who_hears_may_rest_after_each_copy_of_a_message():
    node, n_heard, n_rested = Node('resting'), [], []
    try:
        heard = OpenSubscription(
            node, Int32, 'rests', lambda *_: n_heard.append(1), rest=lambda: n_rested.append(1)
        )
        data = serialize_message(Int32(data=1))
        for k in range(3):
            info = {'source_timestamp': k, 'publication_sequence_number': k}
            heard._on_live(data, info)
            # A copy that does not count takes its time, too.
            heard._on_copy(data, info, 'reliable')
        assert (len(n_heard), len(n_rested)) == (3, 6)
    finally:
        node.destroy_node()


def test_who_may_not_stand_back_plans_all_the_same(monkeypatch):
    def refuse(*_):
        raise PermissionError

    monkeypatch.setattr(os, 'sched_getparam', lambda _: os.sched_param(10))
    monkeypatch.setattr(os, 'sched_setparam', refuse)
    thread_priority.stand_back()


def test_the_planner_stands_back(monkeypatch):
    stood = []
    monkeypatch.setattr(request_queue, 'stand_back', lambda: stood.append(get_ident()))
    node = PlannerNode(namespace='/standing_back')
    try:
        ran = []
        node._queue.prepare(lambda: ran.append(get_ident()))
        node.close()
        assert stood == ran != [get_ident()]
    finally:
        node.destroy_node()


@pytest.mark.parametrize(
    ('spacing', 'works', 'rests'),
    [
        # A body each 10 ms, one in four of which asks for much, and a flood.
        (10e-3, [1e-3], False),
        (10e-3, [10e-3, 10e-3, 10e-3, 1e-3], False),
        (0.5e-3, [0.45e-3], True),
        (0.5e-3, [0.5e-3], True),
    ],
)
def test_who_hears_rests_where_messages_come_without_end(monkeypatch, spacing, works, rests):
    now, ran, slept = [0.0], [0.0], []

    def sleep(seconds):
        now[0] += seconds
        slept.append(seconds)

    for name, function in (
        ('monotonic', lambda: now[0]),
        ('thread_time', lambda: ran[0]),
        ('sleep', sleep),
    ):
        monkeypatch.setattr(thread_priority.time, name, function)
    rest = thread_priority.Breather()
    for k in range(2000):
        now[0], ran[0] = now[0] + spacing, ran[0] + works[k % len(works)]
        rest()
    assert bool(slept) == rests
    # About half of the time is left to who plans.
    assert not rests or 0.4 < sum(slept) / now[0] < 0.6
