# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the nodes share: a ROS context, and waiting on conditions."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import threading
import time

import pytest

LONGEST_WAIT = 30.0


def wait_until(condition: Callable[[], object], timeout: float = LONGEST_WAIT) -> None:
    """Return as soon as a condition holds; fail when it does not within a time [s]."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, 'the condition did not come true in time'
        time.sleep(0.005)


def tell(node, publisher, message) -> None:
    """Publish a message, by a latched publisher; return once all have it who are reliable."""
    from rclpy.duration import Duration
    from rrth_planner.ros.planner_client import is_heard

    wait_until(lambda: is_heard(node, publisher))
    publisher.publish(message)
    assert publisher.wait_for_all_acked(Duration(seconds=LONGEST_WAIT))


@contextmanager
def spinning(*nodes):
    """Spin nodes in a thread of their own while the block runs."""
    executors = pytest.importorskip('rclpy.executors')
    executor = executors.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        yield executor
    finally:
        executor.shutdown()
        thread.join(LONGEST_WAIT)


@pytest.fixture(scope='module')
def ros_context() -> Iterator[None]:
    """Have rclpy initialised while the tests of a module run."""
    rclpy = pytest.importorskip('rclpy')
    # One that a command run in this process has left behind cannot be initialised again.
    rclpy.utilities.get_default_context(shutting_down=True).try_shutdown()
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture(name='wait_until')
def _wait_until() -> Callable[..., None]:
    """Give `wait_until` to tests, which cannot import this file."""
    return wait_until


@pytest.fixture(name='tell')
def _tell() -> Callable[..., None]:
    """Give `tell` to tests."""
    return tell


@pytest.fixture(name='spinning')
def _spinning() -> Callable[..., object]:
    """Give `spinning` to tests."""
    return spinning
