# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node's executor calls what rclpy's does, in fewer rounds."""

import pytest

pytest.importorskip('rclpy')

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.task import Future  # noqa: E402
from rrth_planner.ros.middleware.executor import OneThreadExecutor  # noqa: E402
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


def _rounds_of_a_message(kind, node):
    """Return how often an executor looks for work from a message until there is none."""
    numbers, rounds = [], []

    class Counting(kind):
        def get_nodes(self):
            rounds.append(1)
            return super().get_nodes()

    reader = node.create_subscription(Int32, 'numbers', lambda msg: numbers.append(msg.data), 10)
    out = node.create_publisher(Int32, 'numbers', 10)
    executor = Counting()
    executor.add_node(node)
    for _ in range(20):
        executor.spin_once(timeout_sec=0.05)
    rounds.clear()
    out.publish(Int32(data=7))
    _spin_until(executor, lambda: numbers)
    executor.spin_once(timeout_sec=0.1)
    executor.remove_node(node)
    node.destroy_subscription(reader)
    node.destroy_publisher(out)
    return len(rounds)


def test_a_message_takes_one_round_and_the_wait_for_the_next_one(node):
    assert _rounds_of_a_message(OneThreadExecutor, node) == 2
    assert _rounds_of_a_message(SingleThreadedExecutor, node) > 2


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
