# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Who goes before whom where the system runs a client and its nodes in real time."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
import os

import psutil

REAL_TIME = {os.SCHED_FIFO: 'SCHED_FIFO', os.SCHED_RR: 'SCHED_RR'}
# The controller manager of ros2_control gives itself this priority of SCHED_FIFO by default.
CONTROLLER = 50


def put_ahead(*threads: int, by: int = 1) -> None:
    """
    Have threads, by their numbers, go before this one where this one runs in real time.

    What asks and judges all the time would else take the processor from what it measures. Each
    is put `by` above the priority that it has, or this one has where it has none.
    """
    kind, priority = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    if kind not in REAL_TIME:
        return
    most = os.sched_get_priority_max(kind)
    for thread in threads:
        # One may have ended since somebody listed it.
        with suppress(ProcessLookupError):
            present = os.sched_getparam(thread).sched_priority or priority
            os.sched_setscheduler(thread, kind, os.sched_param(min(present + by, most)))


def run_in_real_time(pid: int, priority: int = CONTROLLER) -> bool:
    """Run a process in real time, as the controllers of ros2_control; return whether it may."""
    try:
        for thread in psutil.Process(pid).threads():
            with suppress(ProcessLookupError):
                os.sched_setscheduler(thread.id, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return False
    return True


def give_way() -> None:
    """
    Run this thread at ordinary priority.

    To work for more than a second in real time would look like a stall of the machine: the kernel
    (Linux 6.12 and later) gives 50 ms of each second to whatever else waits for the processor.
    """
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


@contextmanager
def staying_off(threads: Sequence[int], others: Sequence[int] = ()) -> Iterator[None]:
    """Keep the last processor for some threads; others, and this process, stay off it."""
    cores = sorted(os.sched_getaffinity(0))
    own = [thread.id for thread in psutil.Process().threads()]
    for thread in threads:
        os.sched_setaffinity(thread, cores[-1:])
    # Of a single one nobody can stay off.
    _move([*own, *others], cores[:-1] or cores)
    try:
        yield
    finally:
        _move([thread.id for thread in psutil.Process().threads()], cores)


def _move(threads: Sequence[int], cores: Sequence[int]) -> None:
    for thread in threads:
        with suppress(ProcessLookupError):
            os.sched_setaffinity(thread, cores)


def is_real_time() -> bool:
    """Return whether the system runs this process in real time."""
    return os.sched_getscheduler(0) in REAL_TIME


def scheduling() -> str:
    """Return how the system schedules this process, and what it has put ahead."""
    kind, priority = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    if kind not in REAL_TIME:
        return f'at ordinary priority (nice {os.nice(0)})'
    return (
        f'in real time ({REAL_TIME[kind]}, priority {priority}; nodes and the thread that sends '
        f'the body {priority + 1}, the thread that plans {priority})'
    )
