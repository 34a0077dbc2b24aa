# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner: from a problem and options to a result, for all algorithms."""

from collections.abc import Callable
import functools
from importlib import import_module

import numpy as np
from rrth_planner.model.errors import check_type, OptionsError, RrthError, shown
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import (
    InformedRRTStarOptions,
    PrintedRRTHOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
    TreeOptions,
)
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult

# The module that searches by these options. It is imported when first needed: each compiles its
# own kernels, and a node that plans by RRT-H need not wait for those of RRT*.
_SEARCH = {
    RRTOptions: 'rrt',
    RRTStarOptions: 'rrt_star',
    InformedRRTStarOptions: 'rrt_star',
    RRTStarSmartOptions: 'rrt_star',
    RRTHOptions: 'rrt_h',
    PrintedRRTHOptions: 'rrt_h_published',
}


@functools.cache
def _search_of(home: str) -> Callable[..., PlanResult]:
    search: Callable[..., PlanResult] = import_module(f'rrth_planner.planning.{home}').search
    return search


def plan(
    problem: PlanningProblem,
    options: TreeOptions,
    rng: np.random.Generator,
    should_stop: Callable[[], bool] = lambda: False,
    previous: PlanResult | None = None,
) -> PlanResult:
    """
    Return the best path found to any of the goals.

    Parameters
    ----------
    options : TreeOptions
        Its class is the choice of the algorithm.
    rng : numpy.random.Generator
        The only random source.
    should_stop : callable
        Polled between batches; returns True to cancel.
    previous : PlanResult
        Result of an earlier plan with a similar start and obstacles: growth begins with the
        branches of its trees that are still free.

    Raises
    ------
    OptionsError
        Options of an unknown algorithm.
    RrthError
        An argument of another type, as a whole number for rng; an earlier plan with another
        number of joints.

    """
    check_type(problem, PlanningProblem, 'problem')
    home = _SEARCH.get(type(options))
    if home is None:
        names = ', '.join(kind.__name__ for kind in _SEARCH)
        raise OptionsError(f'options: {type(options).__name__}, expected one of {names}')
    if not isinstance(rng, np.random.Generator):
        raise RrthError(
            f'rng: {shown(rng)}, expected a numpy.random.Generator, as from '
            'numpy.random.default_rng(1)'
        )
    check_type(should_stop, Callable, 'should_stop')
    if previous is not None:
        check_type(previous, PlanResult, 'previous')
    # Compiling, the first time, is not planning: the clock starts afterwards.
    search = _search_of(home)
    deadline = Deadline(options.time_limit, should_stop)
    return search(problem, options, rng, deadline, () if previous is None else previous.trees)


__all__ = ['plan', 'PlanResult']
