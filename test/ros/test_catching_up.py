# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came before a motion is published is read before, however busy the node was."""

from itertools import count
from threading import Event, Timer
import time

import pytest

pytest.importorskip('rclpy')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.ros import catching_up  # noqa: E402
from rrth_planner.ros.catching_up import CatchUp  # noqa: E402
from std_msgs.msg import Int32  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
N = catching_up.MOST_ROUNDS
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
    catch_up = CatchUp(node, lambda: (len(node.numbers), 0))
    with spinning(node) as executor:
        wait_until(lambda: node.out.get_subscription_count() == 1)
        end = _busy(executor)
        for k in range(N):
            node.out.publish(Int32(data=k))
        assert node.out.wait_for_all_acked()
        time.sleep(DELIVERY)
        assert node.numbers == []
        Timer(0.05, end.set).start()
        assert catch_up()
        assert node.numbers == list(range(N))


def test_who_hears_more_and_more_is_not_waited_for(node, spinning):
    rounds = count()
    catch_up = CatchUp(node, lambda: (next(rounds), 0))
    with spinning(node):
        for k in range(1, 4):
            assert catch_up()
            assert next(rounds) == k * (catching_up.MOST_ROUNDS + 2) - 1


@pytest.mark.parametrize('is_news', [False, True])
def test_one_that_came_later_ends_the_waiting(node, spinning, is_news):
    rounds, before = count(), time.time_ns()
    catch_up = CatchUp(node, lambda: (next(rounds), time.time_ns() if is_news else before))
    with spinning(node):
        assert catch_up()
    assert next(rounds) == 1 + (1 if is_news else catching_up.MOST_ROUNDS)


def test_a_node_that_stays_busy_is_not_waited_for(node, spinning):
    looks = count()
    catch_up = CatchUp(node, lambda: (next(looks), 0))
    with spinning(node) as executor:
        end, again = _busy(executor), Event()
        assert not catch_up()
        end.set()
        # It looks no further for who has gone.
        node.create_guard_condition(again.set).trigger()
        assert again.wait(10.0)
        assert next(looks) == 1


def test_nobody_waits_for_an_executor_that_is_gone(node):
    catch_up = CatchUp(node, lambda: (0, 0))
    assert not catch_up()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    assert not catch_up()
    executor.shutdown()
    assert not catch_up()
