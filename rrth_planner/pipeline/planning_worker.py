# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The process that `PlanningProcess` starts: it plans for its parent, and ends with it."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
import os
import pickle
import sys
import traceback
from typing import Any

from rrth_planner.model.errors import one_line
from rrth_planner.pipeline.in_process_planner import InProcessPlanner
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.planning_process import Channel, Raised, STOP
from rrth_planner.pipeline.request import PlanQuestion


def main() -> None:
    """Serve the connection of the given file descriptor until it is closed."""
    _lower_priority()
    channel, planner = Channel(Connection(int(sys.argv[1]))), InProcessPlanner()

    def plan(question: PlanQuestion) -> MotionPlan:
        # Whatever comes meanwhile is a STOP, or the end of the owner.
        return planner.plan(question, lambda: channel.is_readable(0.0))

    work: dict[str, Callable[..., Any]] = {
        'warm_up': planner.warm_up,
        'plan': plan,
        'violation_seen': planner.violation_seen,
    }
    serve(channel, work)


def serve(channel: Channel, work: Mapping[str, Callable[..., Any]]) -> None:
    """Serve requests, functions by their names, one after the other."""
    while True:
        try:
            request = channel.receive()
            if request is STOP:
                # It came after the answer was sent.
                continue
            number, name, arguments = request
            try:
                answer = work[name](*arguments)
            except Exception as problem:
                answer = _portable(problem)
            channel.send((number, answer))
        except (EOFError, OSError):
            return


def _portable(problem: Exception) -> Raised:
    """Return an error as it can be sent."""
    where = ''.join(traceback.format_exception(problem))
    try:
        pickle.loads(pickle.dumps(problem))
    except Exception:
        problem = RuntimeError(one_line(f'{type(problem).__name__}: {problem}'))
    return Raised(problem, where)


def _lower_priority() -> None:
    """
    Lower the real-time priority, if any, below that of the parent.

    At equal priority this process would keep its processor until it sleeps.
    """
    if not hasattr(os, 'sched_setparam'):
        return
    # Without the permission the priority stays.
    with suppress(OSError):
        priority = os.sched_getparam(0).sched_priority
        if priority > 1:
            os.sched_setparam(0, os.sched_param(priority - 1))


if __name__ == '__main__':
    main()
