# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node's executor calls what rclpy's does, with less work."""

from threading import Timer
import time

import pytest

pytest.importorskip('rclpy')

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.task import Future  # noqa: E402
from rrth_planner.ros.middleware import executor as executor_module  # noqa: E402
from rrth_planner.ros.middleware.executor import OneThreadExecutor, spin  # noqa: E402
from std_msgs.msg import Int32  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')


@pytest.fixture(name='node')
def _node():
    node = Node('executor')
    yield node
    node.destroy_node()


def _spin_until(executor, is_done):
    for _ in range(1000):
        if is_done():
            return
        executor.spin_once(timeout_sec=0.01)
    pytest.fail('not within 1000 rounds')


def _sum_of_messages(node, executor, n):
    """Have an executor take n numbers, and return their sum."""
    numbers = []
    reader = node.create_subscription(Int32, 'numbers', lambda msg: numbers.append(msg.data), 10)
    out = node.create_publisher(Int32, 'numbers', 10)
    for k in range(n):
        out.publish(Int32(data=k))
        _spin_until(executor, lambda: len(numbers) > k)  # noqa: B023
    node.destroy_subscription(reader)
    node.destroy_publisher(out)
    return sum(numbers)


def test_a_wait_set_is_made_once_for_the_same_entities(node, monkeypatch):
    made = []

    class Counted(executor_module._WaitSet):
        def __init__(self, *arguments):
            made.append(1)
            super().__init__(*arguments)

    monkeypatch.setattr(executor_module, '_WaitSet', Counted)
    executor = OneThreadExecutor()
    executor.add_node(node)
    for n in range(3):
        executor.spin_once(timeout_sec=0.05)
        made.clear()
        assert _sum_of_messages(node, executor, 20) == 190
        # With the reader, and at most once more while its publisher comes.
        assert 1 <= len(made) <= 2, n
    executor.close()


def test_a_task_of_another_thread_wakes_it_up(node):
    executor, seen = OneThreadExecutor(), []
    executor.add_node(node)
    executor.spin_once(timeout_sec=0.05)
    Timer(0.2, executor.create_task, (seen.append, 7)).start()
    begin = time.monotonic()
    while not seen and time.monotonic() < begin + 5.0:
        executor.spin_once(timeout_sec=10.0)
    assert seen == [7]
    assert time.monotonic() < begin + 5.0


def test_it_waits_no_longer_than_asked(node):
    executor = OneThreadExecutor()
    executor.add_node(node)
    for _ in range(20):
        executor.spin_once(timeout_sec=0.01)
    executor.spin_once(timeout_sec=0.0)


def test_a_timer_that_is_cancelled_calls_no_more(node):
    executor, calls = OneThreadExecutor(), []
    executor.add_node(node)
    timer = node.create_timer(0.01, lambda: calls.append(1))
    _spin_until(executor, lambda: len(calls) > 2)
    timer.cancel()
    calls.clear()
    for _ in range(10):
        executor.spin_once(timeout_sec=0.02)
    assert not calls
    timer.reset()
    _spin_until(executor, lambda: calls)


def test_after_its_shutdown_it_calls_nothing(node):
    executor, calls = OneThreadExecutor(), []
    executor.add_node(node)
    node.create_timer(0.01, lambda: calls.append(1))
    _spin_until(executor, lambda: calls)
    executor.shutdown()
    calls.clear()
    for _ in range(3):
        executor.spin_once(timeout_sec=0.02)
    assert not calls


def test_a_task_that_resumes_itself_is_not_called_meanwhile(node, monkeypatch):
    # As those of rclpy from 7.1.9 on.
    monkeypatch.setattr(executor_module, 'RESUMES', True)
    executor, is_there, seen = OneThreadExecutor(), [], []
    executor.add_node(node)

    class Awaited:
        def __await__(self):
            yield self
            assert is_there, 'called too early'

    async def work():
        await Awaited()
        seen.append(1)

    task = executor.create_task(work)
    for _ in range(5):
        executor.wake()
        executor.spin_once(timeout_sec=0.01)
    assert not task.done()
    is_there.append(1)
    executor._call_task_in_next_spin(task)
    _spin_until(executor, task.done)
    assert seen == [1]


def test_a_callback_that_waits_lets_others_run_and_ends(node):
    future, seen = Future(), []

    async def respond(_, response):
        response.success = await future
        return response

    node.create_service(Trigger, 'slow', respond)
    client = node.create_client(Trigger, 'slow', callback_group=MutuallyExclusiveCallbackGroup())
    node.create_subscription(
        Int32,
        'numbers',
        lambda msg: seen.append(msg.data),
        10,
        callback_group=MutuallyExclusiveCallbackGroup(),
    )
    out = node.create_publisher(Int32, 'numbers', 10)
    executor = OneThreadExecutor()
    executor.add_node(node)
    _spin_until(executor, client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    for k in range(3):
        out.publish(Int32(data=k))
    _spin_until(executor, lambda: len(seen) == 3)
    assert not answer.done()
    future.set_result(True)
    _spin_until(executor, answer.done)
    assert answer.result().success


def test_what_waits_for_its_group_runs_once_that_is_free(node):
    group, future, order = MutuallyExclusiveCallbackGroup(), Future(), []

    async def first(_):
        order.append('begun')
        await future
        order.append('ended')

    node.create_subscription(Int32, 'a', first, 10, callback_group=group)
    node.create_subscription(
        Int32, 'b', lambda _: order.append('second'), 10, callback_group=group
    )
    a, b = node.create_publisher(Int32, 'a', 10), node.create_publisher(Int32, 'b', 10)
    executor = OneThreadExecutor()
    executor.add_node(node)
    a.publish(Int32())
    _spin_until(executor, lambda: order)
    b.publish(Int32())
    for _ in range(20):
        executor.spin_once(timeout_sec=0.01)
    assert order == ['begun']
    future.set_result(None)
    _spin_until(executor, lambda: len(order) == 3)
    assert order == ['begun', 'ended', 'second']


def test_an_error_of_a_callback_reaches_whoever_spins(node):
    def fail(_):
        raise ValueError('of the callback')

    node.create_subscription(Int32, 'numbers', fail, 10)
    out = node.create_publisher(Int32, 'numbers', 10)
    executor = OneThreadExecutor()
    executor.add_node(node)
    out.publish(Int32())
    with pytest.raises(ValueError, match='of the callback'):
        _spin_until(executor, lambda: False)


def test_an_error_in_the_report_of_an_error_does_not_end_the_node(node):
    seen = []

    def fail():
        raise ValueError('of the callback')

    def on_error(what):
        seen.append(what)
        raise ValueError('of the report')

    timer = node.create_timer(0.001, fail)
    try:
        spin(node, on_error, is_over=lambda: len(seen) > 2)
    finally:
        node.destroy_timer(timer)
    assert seen[:2] == ['ValueError: of the callback'] * 2


def test_an_error_is_acted_on_before_it_is_logged_and_where_it_cannot_be_logged(node):
    order = []

    def fail():
        raise ValueError('of the callback')

    class BrokenLogger:
        def error(self, _):
            order.append('log')
            raise OSError('no space left')

    node.get_logger = BrokenLogger
    timer = node.create_timer(0.001, fail)
    try:
        spin(node, lambda _: order.append('act'), is_over=lambda: len(order) > 3)
    finally:
        node.destroy_timer(timer)
    assert order[:4] == ['act', 'log'] * 2
