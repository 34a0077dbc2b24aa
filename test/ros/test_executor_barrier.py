# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came before a motion is published is read before, however busy the node was."""

from contextlib import nullcontext
from itertools import count
from threading import Event, get_ident, Timer
import time
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.ros.middleware import executor_barrier  # noqa: E402
from rrth_planner.ros.middleware.executor_barrier import (  # noqa: E402
    ExecutorBarrier,
    NodeIsBusyError,
)
from std_msgs.msg import Int32  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
N = 5
# For messages to arrive that are not read yet [s].
DELIVERY = 0.3


@pytest.fixture(name='node')
def _node():
    """Give a node that receives numbers."""
    node = Node('barrier')
    node.numbers = []
    node.create_subscription(Int32, 'numbers', lambda msg: node.numbers.append(msg.data), 50)
    node.out = node.create_publisher(Int32, 'numbers', 50)
    yield node
    node.destroy_node()


def _busy(executor):
    """Keep an executor busy; return what ends that."""
    begun, end = Event(), Event()

    def keep():
        begun.set()
        end.wait(10.0)

    executor.create_task(keep)
    assert begun.wait(10.0)
    return end


def test_what_came_before_is_processed_before(node, spinning, wait_until, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
    barrier = ExecutorBarrier(node, lambda: (len(node.numbers), 0))
    with spinning(node) as executor:
        wait_until(lambda: node.out.get_subscription_count() == 1)
        end = _busy(executor)
        for k in range(N):
            node.out.publish(Int32(data=k))
        assert node.out.wait_for_all_acked()
        time.sleep(DELIVERY)
        assert node.numbers == []
        Timer(0.05, end.set).start()
        assert barrier.call(lambda: list(node.numbers)) == list(range(N))


def test_it_is_done_by_the_thread_that_spins(node, spinning):
    barrier = ExecutorBarrier(node, lambda: (0, 0))
    with spinning(node) as executor:
        spins = barrier.call(get_ident)
        assert spins != get_ident()
        assert spins == barrier.call(get_ident)
        ran = Event()
        executor.create_task(lambda: ran.set() or spins == get_ident())
        assert ran.wait(10.0)


def test_what_goes_wrong_is_raised_to_who_asked(node, spinning):
    barrier = ExecutorBarrier(node, lambda: (0, 0))
    with spinning(node):
        with pytest.raises(ZeroDivisionError):
            barrier.call(lambda: 1 // 0)
        assert barrier.call(lambda: 3) == 3


def test_one_quiet_round_is_enough(node, spinning):
    looks = []
    barrier = ExecutorBarrier(node, lambda: (7, looks.append(0) or 0))
    with spinning(node):
        for k in range(1, 4):
            barrier.call(lambda: None)
            # After the round in which it was asked for, which may have begun before, and that one.
            assert len(looks) == 2 * k


@pytest.mark.parametrize(('age', 'is_news'), [(-10.0, True), (0.001, False)])
def test_one_that_came_later_ends_the_waiting(node, spinning, monkeypatch, age, is_news):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.3)
    rounds, came = count(), 0
    barrier = ExecutorBarrier(node, lambda: (next(rounds), came))
    with spinning(node):
        # It came after the waiting begins, or others that came with it may be unread.
        came = time.time_ns() - int(age * 1e9)
        with nullcontext() if is_news else pytest.raises(NodeIsBusyError):
            barrier.call(lambda: None)
    # An executor that handles only old messages is not waited for for ever.
    assert (next(rounds) == 1) == is_news


def test_cancelled_work_does_not_run(node, spinning, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.3)
    barrier, done = ExecutorBarrier(node, lambda: (0, 0)), []
    with spinning(node) as executor:
        end = _busy(executor)
        with pytest.raises(NodeIsBusyError):
            barrier.call(lambda: done.append('first'))
        monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
        Timer(0.1, end.set).start()
        barrier.call(lambda: done.append('second'))
        barrier.call(lambda: None)
    assert done == ['second']


def test_a_round_that_was_asked_for_before_does_not_count(node, spinning, wait_until, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
    barrier = ExecutorBarrier(node, lambda: (len(node.numbers), 0))
    with spinning(node) as executor:
        wait_until(lambda: node.out.get_subscription_count() == 1)
        # One of its rounds is about to end: what comes now is not part of it.
        end, call = Event(), Event()
        executor.create_task(lambda: call.set() or end.wait(10.0))
        assert call.wait(10.0)
        barrier._round.trigger()
        node.out.publish(Int32(data=1))
        assert node.out.wait_for_all_acked()
        time.sleep(DELIVERY)
        Timer(0.05, end.set).start()
        assert barrier.call(lambda: list(node.numbers)) == [1]


def test_a_wake_up_that_got_lost_is_made_up_for(node, spinning, monkeypatch):
    barrier = ExecutorBarrier(node, lambda: (0, 0))
    trigger, tries = barrier._round.trigger, []
    lossy = SimpleNamespace(trigger=lambda: tries.append(0) or (len(tries) > 1 and trigger()))
    monkeypatch.setattr(barrier, '_round', lossy)
    with spinning(node):
        assert barrier.call(lambda: 1) == 1
    assert len(tries) >= 2


def test_nobody_waits_for_ever_for_an_executor_that_is_gone(node, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.1)
    barrier = ExecutorBarrier(node, lambda: (0, 0))
    # It was never there.
    assert barrier.call(lambda: 1) == 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    for _ in range(2):
        with pytest.raises(NodeIsBusyError):
            barrier.call(lambda: 1)
        executor.shutdown()
