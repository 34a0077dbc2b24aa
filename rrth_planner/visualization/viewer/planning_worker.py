# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the page asks and what it is answered: plans in a thread, of which the newest counts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Condition, Thread
import time
import traceback
from typing import Any

from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_motion
from rrth_planner.pipeline.request import PlanQuestion

# Waiting for an answer looks at the clock so often [s].
LONGEST_NAP = 0.5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Answer:
    """
    What came of one question.

    Parameters
    ----------
    number : int
        Of the question, counted from 1; 0: none was asked yet.
    sentence : str
        What happened: the figures of a motion, or why there is none.
    question : PlanQuestion or None
        None where what was asked is no question.
    plan : MotionPlan or None
        None where nothing was planned.

    """

    number: int = 0
    sentence: str = 'nothing was asked yet'
    question: PlanQuestion | None = None
    plan: MotionPlan | None = None

    @property
    def is_solved(self) -> bool:
        """Whether there is a motion."""
        return self.plan is not None and self.plan.trajectory is not None


class ViewerModel:
    """
    Plan for the newest question; a plan whose question is outdated is cancelled.

    Parameters
    ----------
    question : PlanQuestion
        What later questions change; it is asked by `ask()`.
    on_answer : callable
        Gets each answer that is not outdated, in the thread that plans.

    """

    def __init__(
        self, question: PlanQuestion, on_answer: Callable[[Answer], None] = lambda answer: None
    ) -> None:
        """Start the thread that plans."""
        self.question, self.answer = question, Answer()
        self._on_answer = on_answer
        self._condition = Condition()
        self._n_asked, self._wanted, self._is_closed = 0, False, False
        self._thread = Thread(target=self._work, name='viewer plans', daemon=True)
        self._thread.start()

    def ask(
        self,
        *,
        target: Array | None = None,
        scene: Scene | None = None,
        q_start: Array | None = None,
        margin: float | None = None,
        seed: int | None = None,
        step_size: float | None = None,
    ) -> int:
        """
        Ask anew with some changes and return the question's number; does not wait.

        Parameters
        ----------
        target : ndarray, shape (3,), optional
            In the base frame [m].
        scene : Scene, optional
        q_start : ndarray, shape (dof,), optional
            [rad].
        margin : float, optional
            [m].
        seed : int, optional
        step_size : float, optional
            Longest extension of a tree [rad].

        """
        changes: dict[str, Any] = {
            name: value
            for name, value in (
                ('scene', scene),
                ('q_start', q_start),
                ('margin', margin),
                ('seed', seed),
            )
            if value is not None
        }
        with self._condition:
            answer: Answer | None = None
            self._n_asked += 1
            try:
                if target is not None:
                    changes['goal'] = PointingGoal(target)
                if step_size is not None:
                    changes['options'] = replace(self.question.options, step_size=step_size)
                self.question = replace(self.question, **changes)
            except RrthError as problem:
                # The page goes on with the last question that was one.
                self._wanted = False
                answer = Answer(number=self._n_asked, sentence=str(problem))
            else:
                self._wanted = True
                self._condition.notify_all()
            number = self._n_asked
        if answer is not None:
            self._tell(answer)
        return number

    def wait(self, number: int, timeout: float) -> Answer:
        """Return the answer to a question or to a newer one; the last one after a time [s]."""
        end = time.monotonic() + timeout
        with self._condition:
            while self.answer.number < number and time.monotonic() < end:
                self._condition.wait(LONGEST_NAP)
            return self.answer

    def close(self) -> None:
        """Cancel the plan in progress and end the thread."""
        with self._condition:
            self._is_closed = True
            self._condition.notify_all()
        self._thread.join()

    def _work(self) -> None:
        while True:
            with self._condition:
                while not self._wanted and not self._is_closed:
                    self._condition.wait()
                if self._is_closed:
                    return
                question, number, self._wanted = self.question, self._n_asked, False
            answer = self._answer(question, number)
            if answer is not None:
                self._tell(answer)

    def _answer(self, question: PlanQuestion, number: int) -> Answer | None:
        """Return the answer to a question; None where a newer one was asked meanwhile."""

        def is_outdated() -> bool:
            return self._is_closed or self._n_asked != number

        try:
            plan = plan_motion(**question.arguments, should_stop=is_outdated)
        except RrthError as problem:
            return Answer(number=number, sentence=str(problem), question=question)
        except Exception as problem:
            # The page stays, and says it; what it was goes where the program was started.
            traceback.print_exc()
            sentence = f'nobody expected this: {type(problem).__name__}: {problem}'
            return Answer(number=number, sentence=sentence, question=question)
        if plan.status is PlanStatus.CANCELLED and is_outdated():
            return None
        return Answer(number=number, sentence=plan.sentence, question=question, plan=plan)

    def _tell(self, answer: Answer) -> None:
        with self._condition:
            if answer.number < self.answer.number:
                return
            self.answer = answer
            self._condition.notify_all()
        self._on_answer(answer)
