# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came before a motion is published is read before, however busy the node was."""

from itertools import count
from threading import Event, Timer
import time
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.ros.middleware import executor_barrier  # noqa: E402
from rrth_planner.ros.middleware.executor_barrier import CatchUp  # noqa: E402
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
    monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
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


def test_one_quiet_round_is_enough(node, spinning):
    looks = []
    catch_up = CatchUp(node, lambda: (7, looks.append(0) or 0))
    with spinning(node):
        for k in range(1, 4):
            assert catch_up()
            assert len(looks) == 2 * k


@pytest.mark.parametrize(('age', 'is_news'), [(-10.0, True), (0.001, False)])
def test_one_that_came_later_ends_the_waiting(node, spinning, monkeypatch, age, is_news):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.3)
    rounds, came = count(), 0
    catch_up = CatchUp(node, lambda: (next(rounds), came))
    with spinning(node):
        # It came after the waiting begins, or others that came with it may be unread.
        came = time.time_ns() - int(age * 1e9)
        assert catch_up() == is_news
    # Who hears more and more, and nothing new, is not waited for for ever.
    assert (next(rounds) == 2) == is_news


def test_a_node_that_stays_busy_is_not_waited_for(node, spinning, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.3)
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


def test_a_round_that_nobody_waited_for_tells_nothing(node, spinning, wait_until, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.3)
    handled = []
    catch_up = CatchUp(node, lambda: (len(node.numbers), handled.append(0) or 0))
    with spinning(node) as executor:
        wait_until(lambda: node.out.get_subscription_count() == 1)
        end = _busy(executor)
        assert not catch_up()
        monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
        handled.clear()
        Timer(0.1, end.set).start()
        assert catch_up()
        # When it began, after the round from before, and after one of its own.
        assert len(handled) == 3


def test_a_wake_up_that_got_lost_is_made_up_for(node, spinning, monkeypatch):
    catch_up = CatchUp(node, lambda: (0, 0))
    trigger, tries = catch_up._round.trigger, []
    lossy = SimpleNamespace(trigger=lambda: tries.append(0) or (len(tries) > 1 and trigger()))
    monkeypatch.setattr(catch_up, '_round', lossy)
    with spinning(node):
        assert catch_up()
    assert len(tries) >= 2


def test_nobody_waits_for_ever_for_an_executor_that_is_gone(node, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.1)
    catch_up = CatchUp(node, lambda: (0, 0))
    # It was never there.
    assert catch_up()
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    assert not catch_up()
    executor.shutdown()
    assert not catch_up()
