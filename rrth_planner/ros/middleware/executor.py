# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for a node that one thread spins."""

from collections.abc import Callable
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

    def _make_handler(self, entity: Any, node: Node, take_from_wait_list: Callable) -> Task:
        """Return the task that takes what an entity has, and calls its callback with it."""
        entity._executor_event = True

        async def handle() -> None:
            is_begun = not self._is_shutdown and entity.callback_group.beginning_execution(entity)
            try:
                call = take_from_wait_list(entity) if is_begun else None
            finally:
                # From here on the entity is waited for again.
                entity._executor_event = False
            try:
                if call is not None:
                    await call()
            finally:
                if is_begun:
                    entity.callback_group.ending_execution(entity)

        task = Task(handle, executor=self)
        with self._tasks_lock:
            self._tasks.append((task, entity, node))
        return task
