# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came before a motion is published is read before, however busy the node was."""

from threading import Event, Thread, Timer
import time

import pytest

pytest.importorskip('rclpy')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.ros import catching_up  # noqa: E402
from rrth_planner.ros.catching_up import catch_up  # noqa: E402
from std_msgs.msg import Int32  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
N = 5
# For messages to come that nobody reads yet [s].
DELIVERY = 0.3


@pytest.fixture(name='node')
def _node():
    """Give a node that hears numbers."""
    node = Node('catching_up')
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


def test_all_that_came_is_heard(node, spinning, wait_until, monkeypatch):
    monkeypatch.setattr(catching_up, 'LONGEST', 30.0)
    with spinning(node) as executor:
        wait_until(lambda: node.out.get_subscription_count() == 1)
        end = _busy(executor)
        for k in range(N):
            node.out.publish(Int32(data=k))
        assert node.out.wait_for_all_acked()
        time.sleep(DELIVERY)
        assert node.numbers == []
        Timer(0.05, end.set).start()
        assert catch_up(executor, lambda: (len(node.numbers), 0))
        assert node.numbers == list(range(N))


def test_who_hears_more_and_more_is_not_waited_for(node, spinning):
    rounds = []

    def heard():
        rounds.append(0)
        return len(rounds), 0

    with spinning(node) as executor:
        assert catch_up(executor, heard)
        assert len(rounds) == catching_up.MOST_ROUNDS + 1


@pytest.mark.parametrize('is_news', [False, True])
def test_one_that_came_later_ends_the_waiting(node, spinning, is_news):
    rounds, before = [], time.time_ns()

    def heard():
        rounds.append(0)
        return len(rounds), time.time_ns() if is_news else before

    with spinning(node) as executor:
        assert catch_up(executor, heard)
        assert len(rounds) == (1 if is_news else catching_up.MOST_ROUNDS + 1)


def test_a_node_that_stays_busy_is_not_waited_for(node, spinning, wait_until):
    looked = []
    with spinning(node) as executor:
        end = _busy(executor)
        assert not catch_up(executor, lambda: (looked.append(0) or len(looked), 0))
        end.set()
        wait_until(lambda: looked)
        again = Event()
        executor.create_task(again.set)
        assert again.wait(10.0)
        # It looks no further for who has gone.
        assert len(looked) == 1


def test_nobody_waits_for_an_executor_that_is_gone(node):
    assert not catch_up(None, lambda: (0, 0))
    executor = SingleThreadedExecutor()
    executor.shutdown()
    assert not catch_up(executor, lambda: (0, 0))
    idle = SingleThreadedExecutor()
    idle.add_node(node)
    found = []
    thread = Thread(target=lambda: found.append(catch_up(idle, lambda: (0, 0))))
    thread.start()
    thread.join(10.0)
    assert found == [False]
    idle.shutdown()
