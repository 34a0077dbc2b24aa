# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What came before a motion is published is read before, however busy the node was."""

from threading import Event, get_ident, Timer
import time
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest

pytest.importorskip('rclpy')

from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.subscription import Subscription  # noqa: E402
from rrth_planner.ros.middleware.backlog import process_backlog  # noqa: E402
from rrth_planner.ros.middleware.open_subscription import OpenSubscription  # noqa: E402
from rrth_planner.ros.requests.node_host import NodeHost, SLICE  # noqa: E402
from std_msgs.msg import Int32  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
N = 5
# For messages to arrive that are not read yet [s].
DELIVERY = 0.3


@pytest.fixture(name='node')
def _node():
    """Give a node that receives numbers."""
    node = Node('backlog')
    node.numbers = []
    node.host = NodeHost(node, SimpleNamespace(close=lambda: None))
    yield node
    node.host.close()
    node.destroy_node()


def leave_unread(out, executor):
    """Publish numbers to a busy executor, which is to read them a little later."""
    begun, end = Event(), Event()
    executor.create_task(lambda: begun.set() or end.wait(10.0))
    assert begun.wait(10.0)
    for k in range(N):
        out.publish(Int32(data=k))
    assert out.wait_for_all_acked()
    time.sleep(DELIVERY)
    Timer(0.05, end.set).start()


def read_before(node, executor, wait_until, work):
    """Return what some work returns, once the node has read what has come."""
    found = []

    async def read():
        await node.host.read()
        found.append(work())

    executor.create_task(node.host.begin, read())
    wait_until(lambda: found)
    return found[0]


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
    with spinning(node) as executor:
        # By the reader for all publishers, by that for such publishers, and by a usual one.
        wait_until(lambda: out.get_subscription_count() == 3)
        leave_unread(out, executor)
        found = read_before(node, executor, wait_until, lambda: [[*node.numbers], [*plain]])
    assert found == 2 * [list(range(N))]


def test_as_many_are_read_as_a_reader_holds():
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
        # It has always another one, which came later.
        assert len(list(process_backlog(SimpleNamespace(subscriptions=[reader])))) == N
        assert taken == N * [expected]
        taken.clear()


def test_timers_run_while_messages_take_long_to_process(node, spinning, wait_until):
    events = []

    def take(msg):
        time.sleep(3 * SLICE)
        events.append(msg.data)

    node.create_subscription(Int32, 'numbers', take, 50)
    node.create_timer(0.001, lambda: events.append('timer'))
    out = node.create_publisher(Int32, 'numbers', 50)
    with spinning(node) as executor:
        wait_until(lambda: out.get_subscription_count() == 1)
        leave_unread(out, executor)
        read = read_before(node, executor, wait_until, lambda: [*events])
    assert [k for k in read if k != 'timer'] == list(range(N))
    assert 'timer' in read[read.index(1) : read.index(N - 1)]


def test_answers_come_back_to_the_thread_that_spins(node, spinning, wait_until):
    spins, found = [], []

    async def ask():
        spins.append(get_ident())
        found.append(await node.host.help(get_ident))
        spins.append(get_ident())

    with spinning(node) as executor:
        executor.create_task(node.host.begin, ask())
        wait_until(lambda: len(spins) == 2)
    assert spins[0] == spins[1]
    assert found[0] not in (spins[0], get_ident())


def test_what_goes_wrong_in_a_thread_is_raised_to_who_asked(node, spinning, wait_until):
    problems = []

    async def ask():
        try:
            await node.host.help(lambda: 1 // 0)
        except ZeroDivisionError as problem:
            problems.append(problem)

    with spinning(node) as executor:
        executor.create_task(node.host.begin, ask())
        wait_until(lambda: problems)


class Deaf(Node):
    """A node that no wake-up reaches."""

    n_woken = 0

    def create_guard_condition(self, *_, **__):
        """As of `Node`."""
        return self

    def trigger(self):
        """As of `GuardCondition`."""
        self.n_woken += 1


def test_a_wake_up_that_got_lost_is_made_up_for(spinning, wait_until):
    node, found = Deaf('deaf'), []
    host = NodeHost(node, SimpleNamespace(close=lambda: None))

    async def ask():
        found.append(await host.help(lambda: 1))

    with spinning(node) as executor:
        executor.create_task(host.begin, ask())
        wait_until(lambda: found)
    assert node.n_woken
    host.close()
    node.destroy_node()


def test_a_thread_that_hangs_is_not_waited_for(node, spinning, wait_until, monkeypatch):
    monkeypatch.setattr('rrth_planner.ros.requests.node_host.LONGEST_HELP', 0.05)
    end, problems = Event(), []

    async def ask():
        try:
            await node.host.help(end.wait, 30.0)
        except TimeoutError as problem:
            problems.append(str(problem))

    with spinning(node) as executor:
        executor.create_task(node.host.begin, ask())
        wait_until(lambda: problems)
        assert problems == ['not done within 0.05 s']
        end.set()
