# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An executor for a node that one thread spins, and what such a process needs besides."""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
import gc
from inspect import iscoroutinefunction
import sys
import traceback
from typing import Any

import rclpy
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Task
from rclpy.utilities import timeout_sec_to_nsec
from rclpy.waitable import NumberOfEntities
from rrth_planner.model.errors import one_line

# After so long a thread lets another one run [s].
SWITCH_INTERVAL = 5e-4
# What a wait set calls its entities, in the order in which their callbacks are called, and those
# of a node.
WAITABLE, CONDITION = 'waitable', 'guard_condition'
KINDS: dict[str, Callable[[Node], Iterable[Any]]] = {
    WAITABLE: lambda node: node.waitables,
    'timer': lambda node: node.timers,
    'subscription': lambda node: node.subscriptions,
    CONDITION: lambda node: node.guards,
    'client': lambda node: node.clients,
    'service': lambda node: node.services,
}
# Those that it counts, in its order.
COUNTED = ('subscription', CONDITION, 'timer', 'client', 'service')
# From rclpy 7.1.9 on a task that waits for something is called again once that is there. Before,
# it has to be called to see whether it is.
RESUMES = hasattr(Task, '_add_resume_callback')


class _WaitSet:
    """A wait set of some entities, which are in use until it is closed."""

    def __init__(self, executor: 'OneThreadExecutor', entities: list[tuple[str, Any]]) -> None:
        """Use the entities, each with its kind; what is destroyed already is left out."""
        self._stack = ExitStack()
        own = [(CONDITION, one) for one in (executor._guard, executor._sigint_gc)]
        used = [found for found in (*own, *entities) if self._use(*found)]
        self._waitables = [entity for kind, entity in used if kind == WAITABLE]
        others = [(kind, entity) for kind, entity in used if kind != WAITABLE]
        # By where they are in the memory.
        self._entities = {
            (kind, entity.handle.pointer): (kind, entity)
            for kind, entity in others
            if (kind, entity) not in own
        }
        n = Counter(kind for kind, _ in others)
        numbers = NumberOfEntities(*(n[kind] for kind in COUNTED))
        for waitable in self._waitables:
            numbers += waitable.get_num_entities()
        handle = executor.context.handle
        assert handle is not None
        self._stack.enter_context(handle)
        self._set = rclpy_implementation.WaitSet(
            *(getattr(numbers, name) for name in NumberOfEntities.__slots__), handle
        )
        self._add = [
            partial(getattr(self._set, f'add_{kind}'), entity.handle) for kind, entity in others
        ]

    def _use(self, kind: str, entity: Any) -> bool:
        try:
            self._stack.enter_context(entity if kind == WAITABLE else entity.handle)
        except rclpy_implementation.InvalidHandle:
            return False
        return True

    def close(self) -> None:
        """Use the entities no longer."""
        self._stack.close()

    def wait(self, timeout: int) -> list[tuple[str, Any]]:
        """Return what is ready, after a time at the latest [ns]; negative: without a limit."""
        self._set.clear_entities()
        for add in self._add:
            add()
        for waitable in self._waitables:
            waitable.add_to_wait_set(self._set)
        self._set.wait(timeout)
        ready = [(WAITABLE, w) for w in self._waitables if w.is_ready(self._set)]
        for kind in KINDS:
            if kind != WAITABLE:
                pointers = self._set.get_ready_entities(kind)
                ready += [self._entities[kind, p] for p in pointers if (kind, p) in self._entities]
        return ready


class OneThreadExecutor(Executor):
    """
    Runs callbacks in the one thread that spins, with little to do for each.

    For each message rclpy's own builds a wait set anew, makes a task of the callback, and wakes
    itself up twice, which other threads may wait for. Here the wait set is kept as long as there
    is the same to wait for, and a callback that waits for nothing is simply called.
    """

    def __init__(self) -> None:
        """Begin without nodes."""
        super().__init__()
        # Tasks to be called, those that wait for something, and what is left of this round.
        self._called: deque[Task] = deque()
        self._waiting: list[Task] = []
        self._round: Iterator[Callable[[], None]] = iter(())
        # Of these entities.
        self._wait_set: _WaitSet | None = None
        self._entities: list[tuple[str, Any]] = []
        self._take: dict[str, Callable[[Any], Any]] = {
            kind: getattr(self, f'_take_{kind}') for kind in KINDS
        }

    def create_task(self, callback: Any, *args: Any, **kwargs: Any) -> Task:
        """Have something called, or a coroutine run, by the thread that spins."""
        task = Task(callback, args, kwargs, executor=self)
        self._call_task_in_next_spin(task)
        return task

    def _call_task_in_next_spin(self, task: Task) -> None:
        # Tasks of rclpy call this, too.
        self._called.append(task)
        self.wake()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """
        Do one thing, or be woken up; wait for that for a time at most [s], None: without a limit.

        Raise what a callback raises, and ExternalShutdownException once ROS is shut down.
        """
        step = next(self._round, None)
        if step is None:
            self._round = self._steps(timeout_sec_to_nsec(timeout_sec))
            step = next(self._round, None)
        if step is not None:
            step()

    def close(self) -> None:
        """Use the entities of the nodes no longer; called by the thread that spins."""
        if self._wait_set is not None:
            self._wait_set.close()
        self._wait_set, self._entities = None, []

    def _steps(self, timeout: int) -> Iterator[Callable[[], None]]:
        """Yield what is to do in a round: tasks, and what is ready after a time at most [ns]."""
        tasks = [self._called.popleft() for _ in range(len(self._called))]
        for task in (*tasks, *(() if RESUMES else self._waiting)):
            yield partial(self._call, task)
        if self._is_shutdown:
            self.close()
            return
        if not self.context.ok():
            raise ExternalShutdownException
        entities = [
            (kind, entity)
            for node in self.get_nodes()
            for kind, entities_of in KINDS.items()
            for entity in entities_of(node)
        ]
        if self._waiting:
            entities = [e for e in entities if e[1].callback_group.can_execute(e[1])]
        if self._wait_set is None or entities != self._entities:
            self.close()
            self._wait_set, self._entities = _WaitSet(self, entities), entities
        found = self._wait_set.wait(timeout)
        if not self.context.ok():
            raise ExternalShutdownException
        for kind, entity in found:
            yield partial(self._run, kind, entity)

    def _run(self, kind: str, entity: Any) -> None:
        """Call the callback of an entity that is ready."""
        if kind == 'timer' and not entity.handle.is_timer_ready():
            # It was cancelled meanwhile.
            return
        group = entity.callback_group
        if not group.beginning_execution(entity):
            # A callback of its group waits since this round began: what is ready stays so.
            if kind == CONDITION:
                entity.trigger()
            return
        callback = getattr(entity, 'callback', None)
        may_wait = kind == WAITABLE if callback is None else iscoroutinefunction(callback)

        async def handle() -> None:
            try:
                call = self._take[kind](entity)
                if call is not None:
                    await call()
            finally:
                group.ending_execution(entity)

        if may_wait:
            self._call(Task(handle, executor=self))
        else:
            with suppress(StopIteration):
                handle().send(None)

    def _call(self, task: Task) -> None:
        """Call a task; raise what it raises, or what a task raises that it resumes."""
        task()
        tasks = dict.fromkeys((*self._waiting, task))
        ended = [t for t in tasks if t.done() or t.cancelled()]
        self._waiting = [t for t in tasks if t not in ended]
        for one in ended:
            one.result()


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
    try:
        while rclpy.ok() and not is_over():
            try:
                executor.spin_once()
            except ExternalShutdownException:
                return
            except Exception as problem:
                if not rclpy.ok():
                    return
                problems = [problem]
                try:
                    on_error(one_line(f'{type(problem).__name__}: {problem}'))
                except Exception as other:
                    problems.append(other)
                for one in problems:
                    with suppress(Exception):
                        node.get_logger().error(''.join(traceback.format_exception(one)))
    finally:
        executor.close()


def settle_interpreter() -> None:
    """Shorten the pauses of garbage collector and thread switches."""
    # Half a million objects of numba and ROS live as long as the node: the collector skips them.
    gc.collect()
    gc.freeze()
    # Threads share the interpreter; the default is 5 ms.
    sys.setswitchinterval(SWITCH_INTERVAL)
