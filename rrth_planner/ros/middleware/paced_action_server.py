# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A server of an action that answers by `Answers`."""

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer
from rclpy.node import Node
from rclpy.task import Future
from rrth_planner.ros.middleware.answers import Answers


class _Handle:
    """The handle of an action's server, but for the one method that sends an answer."""

    def __init__(self, handle: Any, name: str, send: Callable[[Any, Any], None]) -> None:
        """Take the handle, and what is called in place of its method of that name."""
        self._handle = handle
        setattr(self, name, send)

    def __getattr__(self, name: str) -> Any:
        """Return what the handle has of this name."""
        return getattr(self._handle, name)


class PacedActionServer(ActionServer):
    """
    A server of an action whose answers are paced.

    Its callbacks for goals and cancellations await nothing. A goal begins once its answer leaves:
    not for a client that has left. A cancellation is done at once.
    """

    def __init__(
        self, answers: Answers, node: Node, kind: Any, name: str, *rest: Any, **options: Any
    ) -> None:
        """Offer the action; the arguments are those of rclpy's."""
        self._answers = answers
        self._services = {
            what: node.resolve_service_name(f'{name}/_action/{what}')
            for what in ('send_goal', 'cancel_goal', 'get_result')
        }
        super().__init__(node, kind, name, *rest, **options)

    async def _execute_goal_request(self, request: Any) -> None:
        begin = super()._execute_goal_request
        executor = self._node.executor
        self._answers.put(
            self._services['send_goal'], request[0], lambda: executor.create_task(begin, request)
        )

    async def _execute_cancel_request(self, request: Any) -> None:
        execute = super()._execute_cancel_request
        await self._answering('cancel_goal', 'send_cancel_response', execute, request)

    async def _execute_get_result_request(self, request: Any) -> None:
        # Of a goal that is not known; of others the answer comes later, by what follows.
        execute = super()._execute_get_result_request
        await self._answering('get_result', 'send_result_response', execute, request)

    def _send_result_response(self, header: Any, future: Future) -> None:
        send = super()._send_result_response
        self._answers.put(self._services['get_result'], header, lambda: send(header, future))

    async def _answering(
        self, what: str, name: str, execute: Callable[[Any], Any], request: Any
    ) -> None:
        """Execute a request, which sends its answer by a method of that name."""
        handle = self._handle

        def send(header: Any, response: Any) -> None:
            self._answers.put(
                self._services[what], header, lambda: getattr(handle, name)(header, response)
            )

        self._handle = _Handle(handle, name, send)
        try:
            await execute(request)
        finally:
            self._handle = handle
