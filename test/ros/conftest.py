# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the nodes share: a ROS context, and waiting on conditions."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import signal
import subprocess
import sys
import threading
import time
import weakref

import pytest

LONGEST_WAIT = 30.0
# Answers of a planner that still lacks an input, or whose machine is too busy to plan in
# time for an arm that moves.
AGAIN = ('UNABLE_TO_AQUIRE_SENSOR_DATA', 'TIMED_OUT')


def wait_until(condition: Callable[[], object], timeout: float = LONGEST_WAIT) -> None:
    """Return as soon as a condition holds; fail when it does not within a time [s]."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, 'the condition did not come true in time'
        time.sleep(0.005)


def send(node, publisher, message) -> None:
    """Publish a message, by a latched publisher; return once all have it who are reliable."""
    from rclpy.duration import Duration
    from rrth_planner.ros.client.planner_client import is_matched

    wait_until(lambda: is_matched(node, publisher))
    publisher.publish(message)
    assert publisher.wait_for_all_acked(Duration(seconds=LONGEST_WAIT))


def ask(plan, note=lambda: None):
    """Return the answer of a planner's service; asked again while a busy machine is the reason."""
    end = time.monotonic() + LONGEST_WAIT
    while True:
        note()
        future = plan.call_async(plan.srv_type.Request())
        wait_until(future.done)
        if not future.result().message.startswith(AGAIN) or time.monotonic() > end:
            return future.result()
        time.sleep(0.05)


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


@pytest.fixture(name='call')
def _call(monkeypatch: pytest.MonkeyPatch, capfd) -> Callable[..., subprocess.CompletedProcess]:
    """
    Give what runs a `main` with some arguments in this process, and returns how it ended.

    Its own process would take seconds to load what this one has. It has a default context of ROS
    for itself, so that it may begin and end with one as processes do.
    """
    utilities = pytest.importorskip('rclpy.utilities')

    def ended(main: Callable[..., int], *arguments: object) -> subprocess.CompletedProcess:
        capfd.readouterr()
        with monkeypatch.context() as patch:
            # The handlers of the tests stay.
            patch.setattr(signal, 'signal', lambda *_: None)
            patch.setattr(utilities, 'g_default_context', None)
            try:
                code = main([*map(str, arguments)])
            except SystemExit as end:
                code = end.code
            # It leaves nothing behind.
            assert not utilities.ok()
        return subprocess.CompletedProcess(arguments, code, *capfd.readouterr())

    return ended


@pytest.fixture(autouse=True)
def _destroyed_nodes(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """
    Destroy what nodes a test has made and left, whether it passed or not.

    A node outlives its context. Its publishers would give their last body to each
    planner of the tests after it, whose own body that may replace.
    """
    if 'rclpy.node' not in sys.modules:
        yield
        return
    from rclpy.exceptions import InvalidHandle
    from rclpy.node import Node

    made, begin = weakref.WeakSet(), Node.__init__

    def noted(self, *args: object, **options: object) -> None:
        made.add(self)
        begin(self, *args, **options)

    monkeypatch.setattr(Node, '__init__', noted)
    yield
    for node in list(made):
        # One that has been destroyed, or was rejected before it had begun.
        with suppress(InvalidHandle, AttributeError), node.handle:
            node.destroy_node()


@pytest.fixture(name='wait_until')
def _wait_until() -> Callable[..., None]:
    """Give `wait_until` to tests, which cannot import this file."""
    return wait_until


@pytest.fixture(name='send')
def _send() -> Callable[..., None]:
    """Give `send` to tests."""
    return send


@pytest.fixture(name='ask')
def _ask() -> Callable[..., object]:
    """Give `ask` to tests."""
    return ask


@pytest.fixture(name='spinning')
def _spinning() -> Callable[..., object]:
    """Give `spinning` to tests."""
    return spinning
