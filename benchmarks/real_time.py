# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Who goes before whom where the system runs a client and its nodes in real time."""

from contextlib import suppress
import os

REAL_TIME = {os.SCHED_FIFO: 'SCHED_FIFO', os.SCHED_RR: 'SCHED_RR'}


def put_ahead(*threads: int, by: int = 1) -> None:
    """
    Have threads, by their numbers, go before this one where this one runs in real time.

    What asks and judges all the time would else take the processor from what it measures. The
    higher `by`, the further ahead.
    """
    kind, priority = os.sched_getscheduler(0), os.sched_getparam(0).sched_priority
    if kind not in REAL_TIME:
        return
    ahead = os.sched_param(min(priority + by, os.sched_get_priority_max(kind)))
    for thread in threads:
        # One may have ended since somebody listed it.
        with suppress(ProcessLookupError):
            os.sched_setscheduler(thread, kind, ahead)


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
        f'the body {priority + 1})'
    )
