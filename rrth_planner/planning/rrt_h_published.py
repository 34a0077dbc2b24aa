# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H with its three steps as printed, to reproduce the paper; its paths may collide."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rrth_planner.kernels import jit
from rrth_planner.kernels.search import rrt_h_published
from rrth_planner.planning import rrt_h
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import PrintedRRTHOptions
from rrth_planner.planning.problem import PlanningProblem, STAY
from rrth_planner.planning.result import PlanResult, Tree

SHORTEN = jit.first_class(rrt_h_published.shorten)


def search(
    problem: PlanningProblem,
    options: PrintedRRTHOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: Sequence[Tree],
) -> PlanResult:
    """Return the shortest path of some growths, each shortened as printed."""
    fixed = replace(problem, slide_goal=STAY)
    return rrt_h.search(fixed, options, rng, deadline, previous, SHORTEN)
