# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Times on one core, without the garbage collector."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import gc
import os
import time
from typing import Any


@contextmanager
def pinned() -> Iterator[None]:
    """Keep this process, and those that it starts, on one core while the block runs."""
    if not hasattr(os, 'sched_setaffinity'):
        yield
        return
    before = os.sched_getaffinity(0)
    # The first core takes most of the interrupts.
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


@contextmanager
def uncollected() -> Iterator[None]:
    """Hold the garbage collector while the block runs."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Return how long a call takes [s], and what it returns."""
    begin = time.perf_counter()
    result = call()
    return time.perf_counter() - begin, result


def repeated(call: Callable[[], Any], repeats: int) -> list[float]:
    """Return how long a call takes each of some times, after one that does not count [s]."""
    call()
    with uncollected():
        return [timed(call)[0] for _ in range(repeats)]
