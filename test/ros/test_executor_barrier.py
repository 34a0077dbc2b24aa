# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came before a motion is published is read before, however busy the node was."""

from concurrent.futures import Future
from threading import Event, get_ident, Timer
import time
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

pytest.importorskip('rclpy')

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.subscription import Subscription  # noqa: E402
from rrth_planner.ros.middleware import executor_barrier  # noqa: E402
from rrth_planner.ros.middleware.executor_barrier import (  # noqa: E402
    ExecutorBarrier,
    NodeIsBusyError,
)
from rrth_planner.ros.middleware.open_subscription import OpenSubscription  # noqa: E402
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


def _leave_unread(out, executor):
    """Publish numbers to a busy executor, which is to read them a little later."""
    end = _busy(executor)
    for k in range(N):
        out.publish(Int32(data=k))
    assert out.wait_for_all_acked()
    time.sleep(DELIVERY)
    Timer(0.05, end.set).start()


@pytest.fixture(name='numbers')
def _numbers(node):
    """Give the subscription to the node's numbers."""
    take = node.numbers.append
    return OpenSubscription(node, Int32, 'numbers', lambda msg, _: take(msg.data), takes_late=True)


@pytest.mark.parametrize('is_latched', [False, True])
@pytest.mark.usefixtures('numbers')
def test_what_came_before_is_processed_before(node, spinning, wait_until, is_latched):
    qos = QoSProfile(depth=50)
    if is_latched:
        qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
    out = node.create_publisher(Int32, 'numbers', qos)
    plain = []
    node.create_subscription(Int32, 'numbers', lambda msg: plain.append(msg.data), 50)
    barrier = ExecutorBarrier(node)
    with spinning(node) as executor:
        # By the reader for all publishers, by that for such publishers, and by a usual one.
        wait_until(lambda: out.get_subscription_count() == 3)
        _leave_unread(out, executor)
        assert barrier.call(lambda: [list(node.numbers), list(plain)]) == 2 * [list(range(N))]


def test_as_many_are_read_as_a_reader_holds(node, monkeypatch):
    taken, handle = [], MagicMock()
    handle.take_message.return_value = b'', {}
    for kind, expected in ((Subscription.CallbackType.WithMessageInfo, (b'', {})), (None, (b'',))):
        reader = SimpleNamespace(
            handle=handle,
            msg_type=Int32,
            raw=True,
            qos_profile=QoSProfile(depth=N),
            _callback_type=kind,
            callback=lambda *message: taken.append(message),
        )
        monkeypatch.setattr(type(node), 'subscriptions', [reader])
        # It has always another one, which came later.
        assert len(list(ExecutorBarrier(node)._reading())) == N
        assert taken == N * [expected]
        taken.clear()


def test_timers_run_while_messages_take_long_to_process(node, spinning, wait_until, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
    events = []

    def take(msg):
        time.sleep(3 * executor_barrier.SLICE)
        events.append(msg.data)

    node.create_subscription(Int32, 'numbers', take, 50)
    node.create_timer(0.001, lambda: events.append('timer'))
    out = node.create_publisher(Int32, 'numbers', 50)
    barrier = ExecutorBarrier(node)
    with spinning(node) as executor:
        wait_until(lambda: out.get_subscription_count() == 1)
        _leave_unread(out, executor)
        read = barrier.call(lambda: list(events))
    assert [k for k in read if k != 'timer'] == list(range(N))
    assert 'timer' in read[read.index(1) : read.index(N - 1)]


def test_work_that_runs_out_of_time_by_itself_says_so(node, spinning, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
    barrier, done = ExecutorBarrier(node), []

    def work():
        done.append(0)
        raise TimeoutError('by itself')

    with spinning(node), pytest.raises(TimeoutError, match='by itself'):
        barrier.call(work)
    assert len(done) == 1


def test_what_has_run_just_when_the_wait_was_over_counts(node, monkeypatch):
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    barrier = ExecutorBarrier(node)

    class Late(Future):
        def result(self, timeout=None):
            if timeout is not None and not self.done():
                barrier._on_round()
                raise executor_barrier.NotYet
            return super().result(timeout)

    monkeypatch.setattr(executor_barrier, 'Future', Late)
    assert barrier.call(lambda: 'published') == 'published'
    executor.shutdown()


def test_it_is_done_by_the_thread_that_spins(node, spinning):
    barrier = ExecutorBarrier(node)
    with spinning(node) as executor:
        spins = barrier.call(get_ident)
        assert spins != get_ident()
        assert spins == barrier.call(get_ident)
        ran = Event()
        executor.create_task(lambda: ran.set() or spins == get_ident())
        assert ran.wait(10.0)


def test_what_goes_wrong_is_raised_to_who_asked(node, spinning, monkeypatch):
    barrier, broken = ExecutorBarrier(node), ExecutorBarrier(node)
    monkeypatch.setattr(broken, '_reading', lambda: (1 // k for k in (1, 0)))
    with spinning(node):
        with pytest.raises(ZeroDivisionError):
            barrier.call(lambda: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            broken.call(lambda: pytest.fail('it ran although not all was read'))
        assert barrier.call(lambda: 3) == 3


def test_cancelled_work_does_not_run(node, spinning, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.3)
    barrier, done = ExecutorBarrier(node), []
    with spinning(node) as executor:
        end = _busy(executor)
        with pytest.raises(NodeIsBusyError):
            barrier.call(lambda: done.append('first'))
        monkeypatch.setattr(executor_barrier, 'LONGEST', 30.0)
        Timer(0.1, end.set).start()
        barrier.call(lambda: done.append('second'))
        barrier.call(lambda: None)
    assert done == ['second']


def test_a_wake_up_that_got_lost_is_made_up_for(node, spinning, monkeypatch):
    barrier = ExecutorBarrier(node)
    trigger, tries = barrier._round.trigger, []
    lossy = SimpleNamespace(trigger=lambda: tries.append(0) or (len(tries) > 1 and trigger()))
    monkeypatch.setattr(barrier, '_round', lossy)
    with spinning(node):
        assert barrier.call(lambda: 1) == 1
    assert len(tries) >= 2


def test_nobody_waits_for_ever_for_an_executor_that_is_gone(node, monkeypatch):
    monkeypatch.setattr(executor_barrier, 'LONGEST', 0.1)
    barrier = ExecutorBarrier(node)
    # It was never there.
    assert barrier.call(lambda: 1) == 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    for _ in range(2):
        with pytest.raises(NodeIsBusyError):
            barrier.call(lambda: 1)
        executor.shutdown()
