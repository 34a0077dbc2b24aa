# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H: grow, shortcut, and repeat while avoiding earlier paths (Zou et al. 2024)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rrth_planner.kernels import jit
from rrth_planner.kernels.search import elastic_band, rrt_h
from rrth_planner.kernels.search.random import random_state
from rrth_planner.kernels.search.shortcut import LEAST_GAIN
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.planning.buffers import Workspace, workspace
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import PrintedRRTHOptions, RRTHOptions
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult, Tree
from rrth_planner.planning.rrt import grown_trees, growth_settings, plant, room_for

SHORTEN = jit.first_class(elastic_band.shorten)
# Time between two checks of the deadline [s].
SLICE = 0.005


def search(
    problem: PlanningProblem,
    options: RRTHOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: Sequence[Tree],
    shorten: Any = SHORTEN,
) -> PlanResult:
    """
    Return the shortest path of some growths, each with shortcuts.

    The straight edges to the goals come first, nearest goal first: a length that no path to a
    later goal can beat ends the search. `shorten` is the seam `kernels.jit.SHORTEN`.
    """
    stopped = deadline.status()
    if stopped is not None:
        return PlanResult(status=stopped, path=None, is_reproducible=False)
    n_roots = min(len(problem.q_goals), rrt_h.MAX_ROOTS)
    budget = max(options.max_samples, options.club_budget)
    room = workspace(len(problem.q_start), room_for(n_roots, previous, budget))
    settings = _settings(options, deadline)
    given = (
        problem.world.space,
        jit.address(shorten),
        jit.address(problem.slide_goal),
        problem.target,
        problem.q_start,
        problem.q_goals,
        settings,
    )
    left = room.paths, room.state, room.history
    rrt_h.go_straight(*given, problem.n_bent, *left)
    is_straight = room.state[rrt_h.N_BEST] > 0
    settings[rrt_h.ATTEMPTS] = options.club_attempts + (not is_straight)
    is_done = room.state[rrt_h.END] == rrt_h.DONE
    if previous and not is_done and settings[rrt_h.ATTEMPTS] > 0:
        plant(problem, n_roots, options, room, previous)
        room.state[rrt_h.GROWING] = room.state[rrt_h.BEGUN] = 1
    bits = None if is_done else random_state(rng)
    growth = room.tree_q, room.parents, room.sizes, room.meeting, room.club
    while room.state[rrt_h.END] == rrt_h.RUNNING:
        stopped = deadline.status()
        if stopped is not None:
            break
        settings[rrt_h.UNTIL] = deadline.within(SLICE)
        rrt_h.advance(*given, bits, growth, *left)
    return _result(options, deadline, room, stopped, previous if is_straight else ())


def _settings(options: RRTHOptions, deadline: Deadline) -> Array:
    """Return the entries of `settings` of the kernel."""
    how = (options.corner_spacing, float(options.corner_moves), LEAST_GAIN, 0.0, 0.0)
    if isinstance(options, PrintedRRTHOptions):
        how = (options.corner_spacing, 0.0, 0.0, options.target_spacing, options.check_spacing)
    return np.array(
        [
            *growth_settings(options),
            options.max_samples,
            options.club_budget,
            0.0,
            deadline.start + options.improve_time if options.improve_time > 0.0 else -np.inf,
            0.0,
            *how,
        ]
    )


def _result(
    options: RRTHOptions,
    deadline: Deadline,
    room: Workspace,
    stopped: PlanStatus | None,
    trees: Sequence[Tree],
) -> PlanResult:
    """Return what the kernels left behind."""
    state = room.state.tolist()
    is_solved = state[rrt_h.N_BEST] > 0 and stopped is not PlanStatus.CANCELLED
    is_clocked = state[rrt_h.END] == rrt_h.CLOCK and options.improve_time > 0.0
    n_raw = state[rrt_h.N_RAW]
    if state[rrt_h.BEGUN] > 0:
        pair = state[rrt_h.BEST_PAIR if state[rrt_h.N_BEST] > 0 else rrt_h.PAIR]
        trees = grown_trees(room, pair, options)
    history = room.history[: state[rrt_h.N_HISTORY]].tolist()
    return PlanResult(
        status=PlanStatus.SOLVED if is_solved else (stopped or PlanStatus.SAMPLE_LIMIT),
        path=Path(room.paths[rrt_h.BEST, : state[rrt_h.N_BEST]]) if is_solved else None,
        raw_path=Path(room.paths[rrt_h.RAW, :n_raw]) if n_raw else None,
        trees=trees,
        cost_history=tuple([row[rrt_h.COST] for row in history]),
        sample_history=tuple([int(row[rrt_h.DRAWS]) for row in history]),
        time_history=tuple([row[rrt_h.TIME] - deadline.start for row in history]),
        n_samples=state[rrt_h.SAMPLES],
        planning_time=deadline.elapsed(),
        is_reproducible=stopped is None and not is_clocked,
    )
