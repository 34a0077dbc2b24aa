# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planning in a process of its own, with an interpreter of its own."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
import os
import pickle
import signal
import subprocess
import sys
from typing import Any, Protocol

import numpy as np
from rrth_planner.collision.violation import Violation
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import RrthError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import TreeOptions

# Period of the check for cancellation [s].
POLL_PERIOD = 2e-2
# Of the arrays in a message [bytes].
ALIGNMENT = 16
# A process that has not ended by itself after this time is killed [s].
LONGEST_END = 5.0
WORKER = 'rrth_planner.pipeline.planning_worker'
# Sent while the process works, to cancel that.
STOP = None


class PlanningProcessError(RrthError):
    """The planning process ended while it worked."""


class PlanningTraceback(Exception):
    """The traceback in the planning process, as the cause of the same error here."""


@dataclass(frozen=True, slots=True)
class Raised:
    """An error instead of an answer, with its traceback."""

    problem: Exception
    where: str


class Planner(Protocol):
    """Plans, and runs the second collision checker, in this process or in another one."""

    def warm_up(self, arm: ArmModel, options: TreeOptions) -> None:
        """Return once plans with an arm and options need no time to load."""

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """Return what `plan_motion` answers to a question, without the search behind it."""

    def violation_seen(
        self,
        arm: ArmModel,
        scene: Scene,
        trajectory: Trajectory,
        margin: float,
        ray_guard_length: float,
        target_distance: float,
        escape_time: float = 0.0,
    ) -> Violation | None:
        """Return what `trajectory_validation.violation_seen` returns for the same arguments."""

    def close(self) -> None:
        """Release its resources."""


class PlanningProcess:
    """
    Plans, and runs the second collision checker, in a process of its own.

    It starts at once, ends with this one in any case, and is restarted after it died. For one
    caller at a time.

    Parameters
    ----------
    arm : ArmModel
    options : TreeOptions
        The kernels are loaded for these.
    on_death : callable
        Called with a sentence after it died.

    """

    def __init__(
        self,
        arm: ArmModel,
        options: TreeOptions,
        on_death: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        """Start it."""
        self._warm_up, self._on_death = (arm, options), on_death
        self._start()

    def warm_up(self, arm: ArmModel, options: TreeOptions) -> None:
        """
        Return once plans with an arm and options need no time to load.

        Raises
        ------
        RrthError
            The arm cannot point.

        """
        if self._warm_up != (arm, options):
            self._warm_up = arm, options
            self._begin('warm_up', arm, options)
        self._require_ready()

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """
        Return what `plan_motion` answers to a question, without the search behind it.

        Parameters
        ----------
        question : PlanQuestion
        should_stop : callable
            Polled while it plans; True cancels.

        Raises
        ------
        PlanningProcessError
            It died on this question; the next one gets another process.

        """
        answer: MotionPlan = self._ask('plan', question, should_stop=should_stop)
        return answer

    def violation_seen(
        self,
        arm: ArmModel,
        scene: Scene,
        trajectory: Trajectory,
        margin: float,
        ray_guard_length: float,
        target_distance: float,
        escape_time: float = 0.0,
    ) -> Violation | None:
        """
        Return what `trajectory_validation.violation_seen` returns for the same arguments.

        Raises
        ------
        PlanningProcessError
            It died on this motion.

        """
        answer: Violation | None = self._ask(
            'violation_seen',
            arm,
            scene,
            trajectory,
            margin,
            ray_guard_length,
            target_distance,
            escape_time,
        )
        return answer

    def close(self) -> None:
        """End it."""
        self._line.close()
        try:
            self._process.wait(LONGEST_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._process.pid

    def _start(self) -> None:
        self._line, end = Pipe()
        # Ctrl-C is sent to all processes of a terminal; this one, which inherits the signal mask,
        # ends with its parent instead. In a session of its own it would be scheduled apart from
        # its parent, and could starve.
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            # Not by `multiprocessing`, which would import the main script again.
            self._process = subprocess.Popen(
                [sys.executable, '-m', WORKER, str(end.fileno())],
                stdin=subprocess.DEVNULL,
                env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))},
                pass_fds=[end.fileno()],
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        end.close()
        self._is_busy = False
        self._begin('warm_up', *self._warm_up)

    def _require_ready(self) -> None:
        """Wait for the end of the warm-up, unless it has ended."""
        if self._is_busy:
            self._end(lambda: False)

    def _ask(
        self, name: str, *arguments: Any, should_stop: Callable[[], bool] = lambda: False
    ) -> Any:
        if self._process.poll() is not None:
            self._restart('while idle')
        self._require_ready()
        self._begin(name, *arguments)
        return self._end(should_stop)

    def _begin(self, name: str, *arguments: Any) -> None:
        self._is_busy = True
        # A dead process is detected while waiting for the answer.
        with suppress(OSError):
            send(self._line, (name, arguments))

    def _end(self, should_stop: Callable[[], bool]) -> Any:
        """Return the answer to the last call, or raise its error."""
        is_stopped = False
        try:
            while not self._line.poll(POLL_PERIOD):
                if not is_stopped and should_stop():
                    is_stopped = True
                    send(self._line, STOP)
            answer = receive(self._line)
        except (EOFError, OSError) as problem:
            raise PlanningProcessError(self._restart('while working')) from problem
        self._is_busy = False
        if isinstance(answer, Raised):
            raise answer.problem from PlanningTraceback(answer.where)
        return answer

    def _restart(self, when: str) -> str:
        """Replace a process that has died; return the sentence for the log."""
        self._line.close()
        try:
            code = self._process.wait(LONGEST_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        sentence = f'the planning process ended with code {code} {when}; another one is started'
        self._on_death(sentence)
        self._start()
        return sentence


def send(line: Connection, value: Any) -> None:
    """Send a value: its arrays, which a receiver may not write to, follow it in the message."""
    found: list[pickle.PickleBuffer] = []
    data = pickle.dumps(value, protocol=5, buffer_callback=found.append)
    parts = [data, *(buffer.raw() for buffer in found)]
    sizes = [len(part) for part in parts]
    head = np.array([len(parts), *sizes], dtype=np.int64).tobytes()
    # Compiled code takes aligned arrays only.
    padded = (bytes(part) + bytes(-len(part) % ALIGNMENT) for part in (head, *parts))
    # In one call: each one releases the interpreter, and waits for it again.
    line.send_bytes(b''.join(padded))


def receive(line: Connection) -> Any:
    """Return the next value; its arrays are read-only."""
    message = memoryview(line.recv_bytes())
    n_parts = int.from_bytes(message[:8], sys.byteorder)
    sizes = np.frombuffer(message, dtype=np.int64, count=n_parts, offset=8)
    parts, begin = [], 8 * (1 + n_parts)
    for size in sizes.tolist():
        begin += -begin % ALIGNMENT
        parts.append(message[begin : begin + size])
        begin += size
    return pickle.loads(parts[0], buffers=parts[1:])
