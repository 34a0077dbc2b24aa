# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plans for the page in a thread; only the newest request counts."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Condition, Thread
import traceback
from typing import Any

from rrth_planner.model.errors import RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.status import PlanStatus
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_question
from rrth_planner.pipeline.request import PlanQuestion


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Response:
    """
    Response to one request: the figures of a motion, or a sentence why there is none.

    Parameters
    ----------
    number : int
        Number of the request, from 1; 0: none yet.
    question : PlanQuestion or None
        None where the request was invalid.
    plan : MotionPlan or None
        None where nothing was planned.

    """

    number: int = 0
    sentence: str = 'no request yet'
    question: PlanQuestion | None = None
    plan: MotionPlan | None = None


class ViewerModel:
    """
    Plan for the newest request; the plan of an outdated request is cancelled.

    Parameters
    ----------
    question : PlanQuestion
        The first request, which later ones change; requested by `ask()`.
    on_response : callable
        Called with each response that is not outdated, in the planning thread.

    """

    def __init__(
        self,
        question: PlanQuestion,
        on_response: Callable[[Response], None] = lambda response: None,
    ) -> None:
        """Start the thread that plans."""
        self.question, self.response = question, Response()
        self._on_response = on_response
        self._condition = Condition()
        self._n_asked, self._wanted, self._is_closed = 0, False, False
        self._thread = Thread(target=self._work, name='viewer plans', daemon=True)
        self._thread.start()

    def ask(self, **changes: Any) -> int:
        """
        Request a plan with some changes and return the number of the request; does not wait.

        Parameters
        ----------
        **changes
            Fields of the question; `target`, shape (3,) in the base frame [m]; `step_size`, the
            longest extension of a tree [rad].

        """
        rejection: Response | None = None
        with self._condition:
            self._n_asked += 1
            number = self._n_asked
            try:
                if 'target' in changes:
                    changes['goal'] = PointingGoal(changes.pop('target'))
                if 'step_size' in changes:
                    options = replace(self.question.options, step_size=changes.pop('step_size'))
                    changes['options'] = options
                self.question = replace(self.question, **changes)
                self._wanted = True
                self._condition.notify_all()
            except RrthError as problem:
                # The page keeps its last valid request.
                self._wanted = False
                rejection = Response(number=number, sentence=str(problem))
        if rejection is not None:
            self._respond(rejection)
        return number

    def wait(self, number: int, timeout: float) -> Response:
        """Return the response to a request or to a newer one; the last one after a time [s]."""
        with self._condition:
            self._condition.wait_for(lambda: self.response.number >= number, timeout)
            return self.response

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
            self._plan(question, number)

    def _plan(self, question: PlanQuestion, number: int) -> None:
        """Respond to a request, unless a newer one is made meanwhile."""

        def is_outdated() -> bool:
            return self._is_closed or self._n_asked != number

        plan = None
        try:
            plan = plan_question(question, is_outdated)
            if plan.status is PlanStatus.CANCELLED and is_outdated():
                return
            sentence = plan.sentence
        except RrthError as problem:
            sentence = str(problem)
        except Exception as problem:
            # The page shows it and continues; the traceback is printed.
            traceback.print_exc()
            sentence = f'unexpected error: {type(problem).__name__}: {problem}'
        self._respond(Response(number=number, sentence=sentence, question=question, plan=plan))

    def _respond(self, response: Response) -> None:
        with self._condition:
            if response.number < self.response.number:
                return
            self.response = response
            self._condition.notify_all()
        self._on_response(response)
