# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT-H with its three steps as printed, to check the paper by; its paths may touch."""

import numpy as np
from rrth_planner import rrt_h
from rrth_planner.arrays import Array
from rrth_planner.deadline import Deadline
from rrth_planner.growth import MAX_WAYPOINTS
from rrth_planner.kernels import rrt_h_printed
from rrth_planner.options import PrintedRRTHOptions, RRTHOptions
from rrth_planner.problem import PlanningProblem
from rrth_planner.result import PlanResult, Tree


def search(
    problem: PlanningProblem,
    options: PrintedRRTHOptions,
    rng: np.random.Generator,
    deadline: Deadline,
    previous: tuple[Tree, ...],
) -> PlanResult:
    """Return the shortest path of some growths, each shortened as printed."""
    return rrt_h.search(problem, options, rng, deadline, previous, shorten)


def shorten(problem: PlanningProblem, waypoints: Array, options: RRTHOptions) -> Array:
    """Return a path after steps 1, 2 and 3 of the paper, once each, shape (n, dof) [rad]."""
    assert isinstance(options, PrintedRRTHOptions)
    world, n = problem.world, len(waypoints)
    path = np.empty((max(MAX_WAYPOINTS, 2 * n), waypoints.shape[1]))
    path[:n] = waypoints
    n = rrt_h_printed.shorten(
        world.edge_check,
        world.resolution,
        world.chain,
        world.robot,
        world.obstacles,
        path,
        n,
        options.target_spacing,
        options.check_spacing,
        options.corner_spacing,
    )
    return path[:n].copy()
