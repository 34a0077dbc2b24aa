# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the process behind `PlanningProcess` does: it plans for its parent, and ends with it."""

from collections.abc import Callable, Mapping
from contextlib import suppress
import functools
from multiprocessing.connection import Connection
import os
import pickle
import sys
import traceback
from typing import Any, TYPE_CHECKING

from rrth_planner.kernels.jit import is_compiled
from rrth_planner.model.errors import one_line
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.pipeline.channel import Channel, Raised, STOP
from rrth_planner.pipeline.request import asked

# Loading it compiles kernels that are not compiled yet.
if TYPE_CHECKING:
    from rrth_planner.pipeline.in_process_planner import InProcessPlanner


def main() -> None:
    """Serve the connection of the given file descriptor until it is closed."""
    _lower_priority()
    channel = Channel(Connection(int(sys.argv[1])))
    if is_compiled():
        _planner()
    # Otherwise the owner compiles all kernels before it asks for anything.
    work: dict[str, Callable[..., Any]] = {
        'warm_up': lambda *arguments: _planner().warm_up(*arguments),
        # Whatever comes meanwhile is a STOP, or the end of the owner.
        'plan': lambda *parts: _planner().plan(asked(parts), lambda: channel.is_readable(0.0)),
        'violation_seen': lambda arm, margin, ray, library, *others: _planner().violation_seen(
            RequiredClearance(arm, margin, ray, library), *others
        ),
    }
    serve(channel, work)


@functools.cache
def _planner() -> 'InProcessPlanner':
    from rrth_planner.pipeline.in_process_planner import InProcessPlanner

    return InProcessPlanner()


def serve(channel: Channel, work: Mapping[str, Callable[..., Any]]) -> None:
    """Serve requests, functions by their names, one after the other."""
    while True:
        try:
            request = channel.receive()
            if request == (STOP,):
                # It came after the answer was sent.
                continue
            number, name, *arguments = request
            try:
                answer = work[name](*arguments)
            except Exception as problem:
                answer = _portable(problem)
            channel.send(number, answer)
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
