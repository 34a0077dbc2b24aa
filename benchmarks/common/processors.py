# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Something that a process of its own does on each processor, until it is asked to end."""

from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
import os
from pathlib import Path
import signal
from typing import Any

# Of nothing at all between two looks at whether it is over.
SPINS = 100_000
# What the kernel says of the processors, and of what a container may have of them.
CPUINFO, CPU_MAX = Path('/proc/cpuinfo'), Path('/sys/fs/cgroup/cpu.max')


class OnEachProcessor:
    """
    Has something done on each processor while it is entered.

    Parameters
    ----------
    work : callable
        Of a module, so that another process finds it; called there with a pipe. It sends None
        once it has begun, and returns once something comes through it, or its other end is gone.

    """

    def __init__(self, work: Callable[[Connection], Any]) -> None:
        """Begin with nothing done."""
        self.results: list[Any] = []
        self._work = work
        self._processes: list[tuple[Any, Connection]] = []

    def __enter__(self) -> 'OnEachProcessor':
        """Return once it is done on all of them."""
        context = get_context('spawn')
        for core in sorted(os.sched_getaffinity(0)):
            ours, theirs = context.Pipe()
            process = context.Process(target=_do, args=(core, self._work, theirs), daemon=True)
            process.start()
            theirs.close()
            self._processes.append((process, ours))
        for _, pipe in self._processes:
            pipe.recv()
        return self

    def __exit__(self, *_: Any) -> None:
        """End it; `results` are what it returned."""
        for process, pipe in self._processes:
            # It may be over by itself.
            with suppress(BrokenPipeError):
                pipe.send(None)
            self.results.append(pipe.recv())
            process.join()

    @property
    def pids(self) -> list[int]:
        """The numbers of the processes."""
        return [process.pid for process, _ in self._processes]


def _do(core: int, work: Callable[[Connection], Any], pipe: Connection) -> None:
    # Whoever interrupts all of it wants to hear of it, too.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.sched_setaffinity(0, {core})
    # Perhaps nobody is left who would want it.
    with suppress(BrokenPipeError):
        pipe.send(work(pipe))


def stay_awake(pipe: Connection) -> None:
    """Keep a processor from sleeping; whatever else is to run on it goes first."""
    is_last = True
    try:
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    except OSError:
        # A container may forbid it, and at any other priority others would have to wait.
        is_last = False
    pipe.send(None)
    while is_last and not pipe.poll():
        for _ in range(SPINS):
            pass


def lose_time_asleep(cpuinfo: Path = CPUINFO, cpu_max: Path = CPU_MAX) -> bool:
    """
    Return whether processors that sleep come back late, and may be kept awake.

    The host of a virtual machine hands a halted processor to others, and takes up to tens of
    milliseconds to give it back. In a container with a quota keeping awake would use that up.
    """
    if not hasattr(os, 'SCHED_IDLE') or not cpuinfo.exists():
        return False
    has_quota = cpu_max.exists() and not cpu_max.read_text().startswith('max')
    return not has_quota and ' hypervisor' in cpuinfo.read_text()
