# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planning in another process, with an interpreter of its own."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
import io
from multiprocessing.connection import Connection, Pipe
import os
import pickle
import select
import signal
import subprocess
import sys
from typing import Any, Protocol

from rrth_planner.collision.violation import Violation
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import RrthError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import TreeOptions

# Period of the check for cancellation [s].
POLL_PERIOD = 2e-2
# What is sent once; a channel remembers so many of them, more than any message holds.
SENT_ONCE, REMEMBERED = (ArmModel, Scene, MotionLimits, TreeOptions), 64
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
        """Return once plans need no time to load; raise ModelError where the arm cannot point."""

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """
        Return what `plan_question` returns, without the search behind it.

        should_stop: polled while it plans; True cancels.
        """

    def violation_seen(
        self,
        arm: ArmModel,
        scene: Scene,
        trajectory: Trajectory,
        margin: float,
        ray_guard_length: float,
        reach: float,
        escape_time: float = 0.0,
    ) -> Violation | None:
        """Return what `trajectory_validation.violation_seen` returns for the same arguments."""

    def close(self) -> None:
        """Release its resources."""


class PlanningProcess:
    """
    A planner in a process of its own.

    It starts at once, ends with this process in any case, and is restarted where it has died: the
    call that it died in raises PlanningProcessError. For one caller at a time.

    Parameters
    ----------
    arm, options
        The kernels are loaded for these.
    on_death : callable
        Called with a sentence after the process has died.

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
        """As of `Planner`."""
        if self._warm_up != (arm, options):
            self._warm_up = arm, options
            self._begin('warm_up', arm, options)
        self._require_ready()

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """As of `Planner`."""
        plan: MotionPlan = self._ask('plan', question, should_stop=should_stop)
        return plan

    def violation_seen(self, *arguments: Any) -> Violation | None:
        """As of `Planner`."""
        violation: Violation | None = self._ask('violation_seen', *arguments)
        return violation

    def close(self) -> None:
        """End it."""
        self._channel.line.close()
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
        line, end = Pipe()
        self._channel = Channel(line)
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
        self._n_asked, self._is_busy = 0, False
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
        self._n_asked += 1
        # A dead process is detected while waiting for the answer.
        with suppress(OSError):
            self._channel.send((self._n_asked, name, arguments))
        self._is_busy = True

    def _end(self, should_stop: Callable[[], bool]) -> Any:
        """Return the answer to the last call, or raise its error."""
        is_stopped, number, answer = False, 0, None
        try:
            # The answer to an earlier call, which nobody waited for, may come first.
            while number != self._n_asked:
                while not self._channel.is_readable(POLL_PERIOD):
                    if not is_stopped and should_stop():
                        is_stopped = True
                        self._channel.send(STOP)
                number, answer = self._channel.receive()
        except Exception as problem:
            raise PlanningProcessError(self._restart('while working')) from problem
        self._is_busy = False
        if isinstance(answer, Raised):
            raise answer.problem from PlanningTraceback(answer.where)
        return answer

    def _restart(self, when: str) -> str:
        """Replace a process that has died; return the sentence for the log."""
        self._channel.line.close()
        try:
            code = self._process.wait(LONGEST_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        sentence = f'the planning process ended with code {code} {when}; another one is started'
        self._on_death(sentence)
        self._start()
        return sentence


class Channel:
    """
    One end of a pipe to another process.

    What lasts from question to question, `SENT_ONCE`, is sent once, and then named by its identity
    at the sender. So the receiver has the same object each time, and keeps what it derives from
    it.

    Parameters
    ----------
    line : Connection
        It is written and read only here.

    """

    def __init__(self, line: Connection) -> None:
        """Begin with nothing sent."""
        self.line = line
        self._readable = select.poll()
        self._readable.register(line, select.POLLIN)
        self._sent: dict[int, Any] = {}
        self._received: dict[int, Any] = {}

    def send(self, value: Any) -> None:
        """Send a value."""
        out = io.BytesIO()
        pickler = _Pickler(out, self._sent)
        pickler.dump(value)
        # In one call: each one releases the interpreter, and waits for it again.
        self.line.send_bytes(pickle.dumps((pickler.news, out.getvalue()), protocol=5))
        self._sent.update(pickler.news)
        _forget_first(self._sent)

    def is_readable(self, timeout: float) -> bool:
        """
        Return whether a value or the end of the line is there, or comes within a time [s].

        A hundred times as fast as the connection's own `poll`: planning asks it often.
        """
        return bool(self._readable.poll(1e3 * timeout))

    def receive(self) -> Any:
        """Return the next value; what was read-only is read-only."""
        news, data = pickle.loads(self.line.recv_bytes())
        self._received.update(news)
        value = _Unpickler(data, self._received).load()
        _forget_first(self._received)
        return value


class _Pickler(pickle.Pickler):
    """Writes identities of what is sent once; `news` are those objects that were not sent yet."""

    def __init__(self, out: io.BytesIO, sent: dict[int, Any]) -> None:
        super().__init__(out, protocol=5)
        self._sent = sent
        self.news: dict[int, Any] = {}

    def persistent_id(self, part: Any) -> int | None:
        if not isinstance(part, SENT_ONCE):
            return None
        if id(part) not in self._sent:
            # Kept alive, so that nothing else can have its identity.
            self.news[id(part)] = part
        return id(part)


class _Unpickler(pickle.Unpickler):
    """Reads what `_Pickler` writes."""

    def __init__(self, data: bytes, received: dict[int, Any]) -> None:
        super().__init__(io.BytesIO(data))
        self._received = received

    def persistent_load(self, identity: int) -> Any:
        return self._received[identity]


def _forget_first(parts: dict[int, Any]) -> None:
    """Forget what was sent first, beyond what is remembered."""
    while len(parts) > REMEMBERED:
        del parts[next(iter(parts))]
