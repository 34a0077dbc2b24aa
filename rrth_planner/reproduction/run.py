# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""One run of a planner, and its row of results."""

from collections.abc import Mapping
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
from rrth_planner.planning.options import TreeOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.result import PlanResult
from rrth_planner.reproduction.path_club import (
    goes_over_the_top,
    scattered_growths,
    ScatterOptions,
)
from rrth_planner.reproduction.problems import CERTIFIED, load_problem, NamedProblem

Row = dict[str, Any]
# Sources that determine a row, besides the run itself.
_SOURCES = (
    *('kernels', 'planning', 'collision/world.py', 'collision/box_tree.py'),
    *('collision/reference_checker.py', 'model/reach.py', 'reproduction/problems.py'),
    *('reproduction/run.py', 'reproduction/path_club.py', 'io/map_file.py'),
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
    options : TreeOptions
    seed : int
    collision : str
        As for `load_problem`.

    """

    problem: str
    algorithm: str
    options: TreeOptions
    seed: int
    collision: str = CERTIFIED

    def key(self) -> str:
        """Return what two runs have in common if one need not be done again."""
        parts = (self.problem, self.algorithm, options_digest(self.options), self.seed)
        return _digest(json.dumps([*parts, self.collision, source_digest()]))


def options_digest(options: TreeOptions) -> str:
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
    try:
        for line in pathlib.Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines():
            if line.startswith('model name'):
                return line.partition(':')[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


_warm: set[tuple[str, str, bool]] = set()


def execute(run: Run, timing: str) -> Row:
    """
    Return the row of a run.

    Parameters
    ----------
    run : Run
    timing : str
        Where its time was taken: `serial`, alone on the machine, or `cluster`, beside others.

    """
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
    """Return the columns of a plan."""
    kind = (type(run.options).__name__, run.collision, run.problem.startswith('arm/'))
    if kind not in _warm:
        # Kernels are loaded by the first plan that uses them: that is not its planning time.
        plan(named.problem, run.options, np.random.default_rng(run.seed))
        _warm.add(kind)
    result = plan(named.problem, run.options, np.random.default_rng(run.seed))
    waypoints = None if result.path is None else result.path.waypoints
    is_valid = None if waypoints is None else named.is_path_valid(waypoints)
    # A path clear of the grown boxes is clear of the body too.
    is_body_clear = is_valid or (None if waypoints is None else named.is_body_clear(waypoints))
    return {**_outcome(result), 'is_valid': is_valid, 'is_body_clear': is_body_clear}


def _scattered(named: NamedProblem, options: ScatterOptions, seed: int) -> Row:
    """Return the columns of successive growths; omitted ones are null."""
    start = perf_counter()
    growths = scattered_growths(named.problem, options, seed)
    elapsed = perf_counter() - start
    paths = [g.path for g in growths if g.path is not None]
    is_valid = all(named.is_path_valid(path.waypoints) for path in paths)
    return {
        'status': (PlanStatus.SOLVED if paths else PlanStatus.SAMPLE_LIMIT).value,
        'time_total': elapsed,
        'cost_first': paths[0].length if paths else None,
        'cost_final': min(path.length for path in paths) if paths else None,
        'draws_total': sum(g.n_samples for g in growths),
        'is_valid': is_valid if paths else None,
        'ways': [None if g.path is None else goes_over_the_top(g.path.waypoints) for g in growths],
    }


def _outcome(result: PlanResult) -> Row:
    """Return the columns of the result of a plan."""
    path, is_improved = result.path, len(result.cost_history) > 0
    travel = None if path is None else np.abs(np.diff(path.waypoints, axis=0)).sum(axis=0)
    return {
        'status': result.status.value,
        'time_first': result.time_history[0] if is_improved else None,
        'time_total': result.planning_time,
        'cost_first': _first_cost(result),
        'cost_final': None if path is None else path.length,
        'draws_first': result.sample_history[0] if is_improved else None,
        'draws_total': result.n_samples,
        'n_waypoints': None if path is None else len(path.waypoints),
        'joint_travel': None if travel is None else travel.tolist(),
        'history_cost': list(result.cost_history),
        'history_draws': list(result.sample_history),
        'history_time': list(result.time_history),
    }


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        # The source tree itself.
        return 'source'


def _commit() -> str | None:
    try:
        found = subprocess.run(
            ['git', 'rev-parse', '--short', 'HEAD'],
            cwd=pathlib.Path(__file__).parent,
            capture_output=True,
            text=True,
            timeout=10.0,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return found.stdout.strip() or None


def _first_cost(result: PlanResult) -> float | None:
    """
    Return the length of the first path, or None.

    RRT-H's before any shortening; RRT*-Smart's after its own, with which its history begins.
    """
    if result.raw_path is not None:
        return result.raw_path.length
    return result.cost_history[0] if result.cost_history else None
