# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for a node that one thread spins, and what such a process needs besides."""

from collections.abc import Callable
import gc
import sys
import traceback
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Task
from rrth_planner.model.errors import one_line

# After so long a thread lets another one run [s].
SWITCH_INTERVAL = 5e-4


class OneThreadExecutor(SingleThreadedExecutor):
    """
    Runs callbacks in the thread that spins, and waits once for each message.

    rclpy's own wakes itself up at the beginning and at the end of each callback, which other
    threads may wait for; here there are none, and each time costs a round without work.
    """

    def _make_handler(self, entity: Any, node: Node, take_from_wait_list: Any) -> Task:
        entity._executor_event = True

        async def handle() -> None:
            if self._is_shutdown or not entity.callback_group.beginning_execution(entity):
                entity._executor_event = False
                return
            try:
                try:
                    call = take_from_wait_list(entity)
                finally:
                    entity._executor_event = False
                if call is not None:
                    await call()
            finally:
                entity.callback_group.ending_execution(entity)

        task = Task(handle, executor=self)
        with self._tasks_lock:
            self._tasks.append((task, entity, node))
        return task


def spin(
    node: Node,
    on_error: Callable[[str], None] = lambda what: None,
    is_over: Callable[[], bool] = lambda: False,
) -> None:
    """
    Run a node until ROS is shut down, or something is over; no error in a callback ends it.

    Parameters
    ----------
    on_error : callable, optional
        Called with the name and message of each error in a callback, once it is logged.
    is_over : callable, optional
        Looked up whenever something woke the node up.

    """
    executor = OneThreadExecutor()
    executor.add_node(node)
    while rclpy.ok() and not is_over():
        try:
            executor.spin_once()
        except ExternalShutdownException:
            return
        except Exception as problem:
            if not rclpy.ok():
                return
            node.get_logger().error(traceback.format_exc())
            on_error(one_line(f'{type(problem).__name__}: {problem}'))


def settle_interpreter() -> None:
    """Shorten the pauses of garbage collector and thread switches."""
    # Half a million objects of numba and ROS live as long as the node: the collector skips them.
    gc.collect()
    gc.freeze()
    # Worker and executor share the interpreter; the default is 5 ms.
    sys.setswitchinterval(SWITCH_INTERVAL)
