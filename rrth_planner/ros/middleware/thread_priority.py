# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whoever holds the wearer against a motion goes before whoever plans the next one."""

from contextlib import suppress
import os
from threading import Event
import time
from types import TracebackType

# Longer than this the planner does not wait [s].
LONGEST = 0.02
# Nor again so soon: bodies that come one upon another would keep it from planning [s].
APART = 5e-3
# Who has run all of a stretch of time, but for so small a share of it, and that in so many
# stretches one after the other, rests after each of them [s, -, -, s].
STRETCH, SHARE, STRETCHES, REST = 5e-3, 0.2, 4, 5e-3


class RightOfWay:
    """
    Lets one thread hold up another that works beside it, at places where that one gives way.

    Both share an interpreter, which each of them hands to the other again and again: both then
    take twice as long and more. What is entered is a few milliseconds of work that a person waits
    for.
    """

    def __init__(self) -> None:
        """Begin with the way free."""
        self._is_free = Event()
        self._is_free.set()
        self._given = -APART

    def __enter__(self) -> None:
        """Take the way."""
        self._is_free.clear()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave it."""
        self._is_free.set()

    def give(self) -> None:
        """Return when the way is free, or soon; never to be called while a lock is held."""
        if not self._is_free.is_set() and time.monotonic() - self._given > APART:
            self._is_free.wait(LONGEST)
            self._given = time.monotonic()


class Breather:
    """
    Has the thread that hears messages rest where they come without end.

    It goes before the one that plans; on a processor that both share that one would never run.
    """

    def __init__(self) -> None:
        """Begin rested."""
        self._since = self._ran = 0.0
        self._n_full = 0

    def __call__(self) -> None:
        """Rest if need be; called by that thread, after each message."""
        now = time.monotonic()
        if now - self._since < STRETCH:
            return
        ran = time.thread_time()
        is_full = ran - self._ran > (1.0 - SHARE) * (now - self._since)
        # A single one may be a brake, or what a motion begins with.
        self._n_full = self._n_full + 1 if is_full else 0
        if self._n_full >= STRETCHES:
            time.sleep(REST)
            now = time.monotonic()
        self._since, self._ran = now, ran


def stand_back() -> None:
    """
    Let threads of the same process go before this one, where the system runs them in real time.

    Among equals this one would keep its processor until it sleeps, whoever else wakes up.
    """
    if not hasattr(os, 'sched_setparam'):
        return
    # A system that forbids it leaves all as it is.
    with suppress(OSError):
        priority = os.sched_getparam(0).sched_priority
        if priority > 1:
            os.sched_setparam(0, os.sched_param(priority - 1))
