# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planning in another process, with an interpreter of its own."""

from collections.abc import Callable
from contextlib import suppress
import math
import time
from typing import Any, Protocol

from rrth_planner.collision.violation import Violation
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import RrthError
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.channel import Channel, Raised, STOP
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import parts_of, PlanQuestion
from rrth_planner.pipeline.worker_process import WorkerProcess
from rrth_planner.planning.options import TreeOptions

# Period of the check for cancellation [s].
POLL_PERIOD = 2e-2
# As `longest_stop` of a planning process [s].
LONGEST_STOP = 4.0
# So does one that has not warmed up for so long; what is compiled in memory takes minutes [s].
LONGEST_WARM_UP = 600.0
# What is said of one then.
HANGS = 'while working, since it had not answered in time'


class PlanningProcessError(RrthError):
    """The planning process ended while it worked, or gave no answer in time."""


class PlanningTraceback(Exception):
    """The traceback in the planning process, as the cause of the same error here."""


class Planner(Protocol):
    """Plans, and runs the second collision checker, in this process or in another one."""

    def warm_up(self, arm: ArmModel, options: TreeOptions, second_checker: str = 'fcl') -> None:
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
        required: RequiredClearance,
        scene: Scene,
        trajectory: Trajectory,
        reach: float,
        escape_time: float = 0.0,
    ) -> Violation | None:
        """Return what `trajectory_validation.violation_seen` returns for the same arguments."""

    def close(self) -> None:
        """Release its resources."""


class PlanningProcess:
    """
    A planner in a process of its own.

    It starts at once, ends with this process in any case, and is restarted where it has died or
    hangs: the call that it did so in raises PlanningProcessError. For one caller at a time.

    Parameters
    ----------
    arm, options, second_checker
        Kernels and library are loaded for these.
    on_death : callable
        Called with a sentence after the process has died, or was killed since it hangs.
    worker : WorkerProcess, optional
        One that is started already.
    longest_stop : float
        It hangs where it has not answered so long after a cancellation, the time limit of a plan,
        or any other question [s]. To end it and to answer for it takes less than a second more.

    """

    def __init__(
        self,
        arm: ArmModel,
        options: TreeOptions,
        on_death: Callable[[str], None] = lambda sentence: None,
        worker: WorkerProcess | None = None,
        second_checker: str = 'fcl',
        longest_stop: float = LONGEST_STOP,
    ) -> None:
        """Start it."""
        self._longest_stop = longest_stop
        self._warm_up, self._on_death = (arm, options, second_checker), on_death
        self._start(worker or WorkerProcess())

    def warm_up(self, arm: ArmModel, options: TreeOptions, second_checker: str = 'fcl') -> None:
        """As of `Planner`."""
        if self._warm_up != (arm, options, second_checker):
            self._warm_up = arm, options, second_checker
            self._begin('warm_up', *self._warm_up)
        self._require_ready()

    def plan(
        self, question: PlanQuestion, should_stop: Callable[[], bool] = lambda: False
    ) -> MotionPlan:
        """As of `Planner`."""
        longest = question.options.time_limit + self._longest_stop
        plan: MotionPlan = self._ask(longest, 'plan', *parts_of(question), should_stop=should_stop)
        return plan

    def violation_seen(self, required: RequiredClearance, *others: Any) -> Violation | None:
        """As of `Planner`."""
        # Its arm is a part of the message, and sent once.
        parts = required.arm, required.margin, required.ray_guard_length, required.library
        violation: Violation | None = self._ask(
            self._longest_stop, 'violation_seen', *parts, *others
        )
        return violation

    def close(self) -> None:
        """End it."""
        self._worker.end()

    @property
    def pid(self) -> int:
        """The number of the process."""
        return self._worker.pid

    def _start(self, worker: WorkerProcess) -> None:
        self._worker, self._channel = worker, Channel(worker.line)
        self._n_asked, self._is_busy = 0, False
        self._begin('warm_up', *self._warm_up)

    def _require_ready(self, end: float = math.inf) -> None:
        """Wait for the end of the warm-up, unless it has ended, until a monotonic time [s]."""
        if self._is_busy:
            self._end(lambda: False, end)

    def _ask(
        self,
        longest: float,
        name: str,
        *arguments: Any,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> Any:
        """Return the answer to a question, or raise PlanningProcessError after a time [s]."""
        end = time.monotonic() + longest
        if not self._worker.is_alive():
            self._restart('while idle')
        self._require_ready(end)
        self._begin(name, *arguments, longest=longest)
        return self._end(should_stop)

    def _begin(self, name: str, *arguments: Any, longest: float = LONGEST_WARM_UP) -> None:
        """Ask a question; a process that has not answered after a time [s] hangs."""
        self._n_asked += 1
        self._hangs = time.monotonic() + longest
        # A dead process is detected while waiting for the answer.
        with suppress(OSError):
            self._channel.send(self._n_asked, name, *arguments)
        self._is_busy = True

    def _end(self, should_stop: Callable[[], bool], end: float = math.inf) -> Any:
        """
        Return the answer to the last question, or raise its error.

        end: until when to wait for a process that does not hang, by the monotonic clock [s].
        """
        number, answer, is_stopped = 0, None, False
        try:
            # The answer to an earlier call, which nobody waited for, may come first.
            while number != self._n_asked:
                while not self._channel.is_readable(POLL_PERIOD):
                    present = time.monotonic()
                    if not is_stopped and should_stop():
                        is_stopped, self._hangs = (
                            True,
                            min(self._hangs, present + self._longest_stop),
                        )
                        self._channel.send(STOP)
                    if present > self._hangs:
                        self._worker.kill()
                        raise PlanningProcessError(self._restart(HANGS))
                    if present > end:
                        raise PlanningProcessError('the planning process still loads: ask again')
                number, answer = self._channel.receive()
        except PlanningProcessError:
            raise
        except Exception as problem:
            raise PlanningProcessError(self._restart('while working')) from problem
        self._is_busy = False
        if isinstance(answer, Raised):
            raise answer.problem from PlanningTraceback(answer.where)
        return answer

    def _restart(self, when: str) -> str:
        """Replace a process that has died or hangs; return the sentence for the log."""
        code = self._worker.end()
        sentence = f'the planning process ended with code {code} {when}; another one is started'
        self._on_death(sentence)
        self._start(WorkerProcess())
        return sentence
