# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Nodes as processes of their own, forked from one that has loaded what they load.

A node that is started takes seconds of a processor to load its modules and kernels; where many
tests need a fresh one, that is most of what they take.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import Thread

from rrth_planner.ros.middleware.child_process import LONGEST_END, PREFIX

# Nothing of ROS may have begun before the fork: its threads would be missing.
SERVER = """
import gc, importlib, json, os, sys, traceback
node, *modules = sys.argv[1:]
for name in (node, *modules):
    importlib.import_module(name)
gc.collect()
gc.freeze()
print('ready', flush=True)
n_alive = 0
for line in sys.stdin:
    while n_alive and os.waitpid(-1, os.WNOHANG)[0]:
        n_alive -= 1
    arguments, words = json.loads(line)
    if child := os.fork():
        print(child, flush=True)
        n_alive += 1
        continue
    code = 1
    try:
        output = os.open(words, os.O_WRONLY)
        for place in (1, 2):
            os.dup2(output, place)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.argv = [node, *arguments]
        code = importlib.import_module(node).main()
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else code is not None)
for _ in range(n_alive):
    os.wait()
"""
# Nodes, each with what it loads late, and the environment of one.
PLANNER = (
    'rrth_planner.ros.planner_node',
    'rrth_planner.ros.planner',
    'rrth_planner.execution.warm_up',
    'rrth_planner.pipeline.planning_process',
    'rrth_planner.kernels.precompile',
    'rrth_planner.ros.monitor.execution_monitor',
)
PLAYBACK = ('rrth_planner.ros.playback_node', 'rrth_planner.timing.fast_stop')
PLAIN = {'NUMBA_DISABLE_JIT': '1'}


class ForkedProcess:
    """A node that runs during a `with` block: as a `ChildProcess`, which starts anew."""

    def __init__(self, pid: int, words: Path, on_line: Callable[[str], None]) -> None:
        """Listen to what it writes, in another thread."""
        self.pid, self._words, self._on_line = pid, words, on_line
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> 'ForkedProcess':
        """Return it: it runs already."""
        return self

    def __exit__(self, *_: object) -> None:
        """End it by SIGINT, later by SIGKILL."""
        # What it writes ends with it.
        if self._reader.is_alive():
            os.kill(self.pid, signal.SIGINT)
            self._reader.join(LONGEST_END)
        if self._reader.is_alive():
            os.kill(self.pid, signal.SIGKILL)
            self._reader.join(LONGEST_END)
        self._words.unlink()

    def check(self) -> None:
        """Fail when it has ended."""
        assert self._reader.is_alive(), 'the node ended unexpectedly'

    def _read(self) -> None:
        with self._words.open(encoding='utf-8', errors='replace') as lines:
            for line in lines:
                words = PREFIX.sub(r'\1: ', line).removeprefix('INFO: ').strip()
                if words:
                    self._on_line(words)


@contextmanager
def nodes_of(
    folder: Path, modules: tuple[str, ...], **environment: str
) -> Iterator[Callable[..., ForkedProcess]]:
    """Give what starts the first one of some modules, again and again; they are loaded once."""
    numbers = count()
    with subprocess.Popen(
        [sys.executable, '-c', SERVER, *modules],
        env=os.environ | {'PYTHONPATH': os.pathsep.join(sys.path)} | environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        assert server.stdin is not None and server.stdout is not None
        assert server.stdout.readline() == 'ready\n'

        def start(arguments: list[str], on_line: Callable[[str], None]) -> ForkedProcess:
            words = folder / f'words-{os.getpid()}-{next(numbers)}'
            os.mkfifo(words)
            print(json.dumps([arguments, str(words)]), file=server.stdin, flush=True)
            return ForkedProcess(int(server.stdout.readline()), words, on_line)

        yield start
