# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for a node that one thread spins."""

from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Task


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
