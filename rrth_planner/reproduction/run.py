# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One run of a planner, and its row of results."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
import hashlib
from importlib.metadata import PackageNotFoundError, version
import json
import pathlib
import platform
import subprocess
from time import perf_counter
from typing import Any

import numpy as np
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.options import Options
from rrth_planner.reproduction.path_club import (
    goes_over_the_top,
    scattered_growths,
    ScatterOptions,
)
from rrth_planner.reproduction.problems import CERTIFIED, load_problem, NamedProblem
from rrth_planner.reproduction.relatives.search import find_path

Row = dict[str, Any]
# Sources that determine a row, besides the run itself.
_SOURCES = (
    *('kernels', 'planning', 'collision/world.py', 'collision/box_tree.py'),
    *('collision/reference_checker.py', 'model/reach.py', 'reproduction/problems.py'),
    *('reproduction/run.py', 'reproduction/path_club.py', 'reproduction/relatives'),
    'io/map_file.py',
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """
    One run of a planner on a problem.

    Parameters
    ----------
    problem : str
        A name that `load_problem` knows.
    algorithm : str
        What tables and pictures call these options.
    collision : str
        As for `load_problem`.

    """

    problem: str
    algorithm: str
    options: Options
    seed: int
    collision: str = CERTIFIED

    def key(self) -> str:
        """Return what two runs have in common if one need not be done again."""
        parts = (self.problem, self.algorithm, options_digest(self.options), self.seed)
        return _digest(json.dumps([*parts, self.collision, source_digest()]))


def options_digest(options: Options) -> str:
    """Return a short digest of the kind and the values of options."""
    return _digest(json.dumps([type(options).__name__, asdict(options)], sort_keys=True))


@cache
def source_digest() -> str:
    """Return a short digest of the sources that determine the result of a run."""
    root = pathlib.Path(__file__).parent.parent
    places = [root / name for name in _SOURCES]
    files = [f for p in places for f in ([p] if p.is_file() else sorted(p.rglob('*.py')))]
    return _digest(''.join(file.read_text(encoding='utf-8') for file in files))


@cache
def provenance() -> Mapping[str, str | None]:
    """Return the versions and the kind of machine that a row comes from."""
    return {
        'package_version': _version('rrth_planner'),
        'numpy_version': _version('numpy'),
        'numba_version': _version('numba'),
        'python_version': platform.python_version(),
        'machine': f'{processor_name()}, {platform.system()}',
        'commit': _commit(),
        'source_digest': source_digest(),
    }


def processor_name() -> str:
    """Return the name of the processor, if the system provides it."""
    with suppress(OSError):
        for line in pathlib.Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines():
            if line.startswith('model name'):
                return line.partition(':')[2].strip()
    return platform.processor() or platform.machine()


_warm: set[tuple[str, str, bool]] = set()


def execute(run: Run, timing: str) -> Row:
    """Return the row of a run; timing: where it is timed, SERIAL or CLUSTER of `row_store`."""
    named = load_problem(run.problem, run.collision)
    if isinstance(run.options, ScatterOptions):
        found = _scattered(named, run.options, run.seed)
    else:
        found = _planned(named, run)
    return {
        'key': run.key(),
        'problem': run.problem,
        'algorithm': run.algorithm,
        'options_class': type(run.options).__name__,
        'options': json.dumps(asdict(run.options), sort_keys=True),
        'options_digest': options_digest(run.options),
        'seed': run.seed,
        'collision': run.collision,
        'timing': timing,
        **found,
        **provenance(),
    }


def _planned(named: NamedProblem, run: Run) -> Row:
    """Return the columns of a plan; omitted ones are null."""
    kind = (type(run.options).__name__, run.collision, run.problem.startswith('arm/'))
    if kind not in _warm:
        # Kernels are loaded by the first plan that uses them: that is not its planning time.
        find_path(named.problem, run.options, np.random.default_rng(run.seed))
        _warm.add(kind)
    result = find_path(named.problem, run.options, np.random.default_rng(run.seed))
    row: Row = {
        'status': result.status.value,
        'time_total': result.planning_time,
        'draws_total': result.n_samples,
        'history_cost': list(result.cost_history),
        'history_draws': list(result.sample_history),
        'history_time': list(result.time_history),
    }
    if result.cost_history:
        row |= {
            'time_first': result.time_history[0],
            'draws_first': result.sample_history[0],
            # RRT*-Smart's first path as it shortened it at once, others' as they were grown.
            'cost_first': result.cost_history[0],
        }
    if result.raw_path is not None:
        row['cost_first'] = result.raw_path.length
    if result.path is not None:
        waypoints = result.path.waypoints
        is_valid = named.is_path_valid(waypoints)
        row |= {
            'cost_final': result.path.length,
            'n_waypoints': len(waypoints),
            'joint_travel': np.abs(np.diff(waypoints, axis=0)).sum(axis=0).tolist(),
            'is_valid': is_valid,
            # A path clear of the grown boxes is clear of the body too.
            'is_body_clear': is_valid or named.is_body_clear(waypoints),
        }
    return row


def _scattered(named: NamedProblem, options: ScatterOptions, seed: int) -> Row:
    """Return the columns of successive growths; omitted ones are null."""
    start = perf_counter()
    growths = scattered_growths(named.problem, options, seed)
    elapsed = perf_counter() - start
    paths = [g.path for g in growths if g.path is not None]
    row: Row = {
        'status': (PlanStatus.SOLVED if paths else PlanStatus.SAMPLE_LIMIT).value,
        'time_total': elapsed,
        'draws_total': sum(g.n_samples for g in growths),
        'ways': [None if g.path is None else goes_over_the_top(g.path.waypoints) for g in growths],
    }
    if paths:
        row |= {
            'cost_first': paths[0].length,
            'cost_final': min(path.length for path in paths),
            'is_valid': all(named.is_path_valid(path.waypoints) for path in paths),
        }
    return row


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        # The source tree itself.
        return 'source'


def _commit() -> str | None:
    command = ['git', 'rev-parse', '--short', 'HEAD']
    options: dict[str, Any] = {'cwd': pathlib.Path(__file__).parent, 'stderr': subprocess.DEVNULL}
    try:
        return subprocess.check_output(command, text=True, timeout=10.0, **options).strip() or None
    except (OSError, subprocess.SubprocessError):
        return None
