# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Moments in which a processor ran nothing at all: its host, or its kernel, held it up."""

from collections.abc import Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from threading import get_native_id
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.common.processors import OnEachProcessor
from benchmarks.common.real_time import put_ahead

# The clock is read so often; the machine stood still where that was so late [ns].
READ_PERIOD, STANDSTILL = 1_000_000, 1_000_000
# Between two looks at whether it is over, which take much longer: they would be felt.
LOOKS = 100
# Above the nodes, which are themselves ahead of the client.
AHEAD = 2

Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Standstills:
    """
    When one of the processors, or several, ran nothing.

    Parameters
    ----------
    begins, ends : ndarray, shape (n,)
        One after the other [ns, `time.time_ns`].
    span : int
        How long the processors were watched [ns].

    """

    begins: Times
    ends: Times
    span: int

    def within(self, begin: int, end: int) -> int:
        """Return for how long nothing ran between two times [ns]."""
        shared = np.minimum(self.ends, end) - np.maximum(self.begins, begin)
        return int(shared.clip(min=0).sum())

    def longest(self, n: int) -> list[tuple[int, int]]:
        """Return begin and end of the n longest, one after the other [ns]."""
        chosen = np.sort(np.argsort(self.begins - self.ends, kind='stable')[:n])
        return [(int(self.begins[k]), int(self.ends[k])) for k in chosen]

    def sentence(self) -> str:
        """Return how still the machine stood."""
        lengths = (self.ends - self.begins) * 1e-6
        share = 1e2 * self.within(0, 2**62) / self.span
        return (
            'Threads of the highest priority, one for each processor, read the clock every '
            f'millisecond: {len(lengths)} times one of them was a millisecond late or more, '
            f'{share:.2f} % of the time in all and at most {lengths.max(initial=0.0):.1f} ms. '
            'In such moments the machine is stalled for every process.'
        )


def united(found: Iterable[tuple[int, int]], span: int) -> Standstills:
    """Return the moments of all processors, those that overlap as one."""
    times: list[list[int]] = []
    for begin, end in sorted(found):
        if times and begin <= times[-1][1]:
            times[-1][1] = max(times[-1][1], end)
        else:
            times.append([begin, end])
    begins, ends = np.array(times, dtype=np.int64).reshape(-1, 2).T
    return Standstills(begins, ends, span)


class StandstillWatch:
    """Watches each processor from a process of its own, while it is entered."""

    def __init__(self) -> None:
        """Begin with nobody who watches."""
        self.found: Standstills | None = None
        self._watchers = OnEachProcessor(watch)

    def __enter__(self) -> 'StandstillWatch':
        """Begin to watch."""
        self._watchers.__enter__()
        self._begin = time.time_ns()
        return self

    def __exit__(self, *_: Any) -> None:
        """End it; then it is known what was found."""
        span = time.time_ns() - self._begin
        self._watchers.__exit__()
        self.found = united((moment for found in self._watchers.results for moment in found), span)

    @property
    def pids(self) -> list[int]:
        """The numbers of the processes that watch."""
        return self._watchers.pids


def watch(pipe: Connection) -> list[tuple[int, int]]:
    """Look at the clock until something comes through a pipe; return when it was late [ns]."""
    put_ahead(get_native_id(), by=AHEAD)
    found = []
    before = time.monotonic_ns()
    pipe.send(None)
    while not pipe.poll():
        for _ in range(LOOKS):
            time.sleep(READ_PERIOD * 1e-9)
            now = time.monotonic_ns()
            if now - before > READ_PERIOD + STANDSTILL:
                present = time.time_ns()
                found.append((present - (now - before), present))
            before = now
    return found
