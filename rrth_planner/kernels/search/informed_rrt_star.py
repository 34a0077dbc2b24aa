# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Informed RRT*: RRT* that, once it has a path, draws only where a shorter one can lead."""

import math

from numba.core.types import int64
import numpy as np
from rrth_planner.kernels.jit import (
    as_chain,
    as_edge_check,
    as_free_radius,
    CHAIN_AT,
    EDGE_CHECK_AT,
    FREE_RADIUS_AT,
    kernel,
    N_GOALS,
)
from rrth_planner.kernels.search.random import uniform
from rrth_planner.kernels.search.rrt_star import extend, STAR_SIGNATURE
from rrth_planner.kernels.search.sampling import draw_informed, draw_uniform
from rrth_planner.kernels.vectors import copy


@kernel(STAR_SIGNATURE)
def advance(
    functions,
    resolution,
    robot,
    obstacles,
    bounds,
    step_size,
    clearance_gain,
    goal_bias,
    rewire_radius,
    is_bidirectional,
    bias,
    shortened,
    n_draws,
    rng,
    tree_q,
    links,
    costs,
    sizes,
    meetings,
    best,
    history,
):
    """
    Make n_draws draws, informed ones from the first path on; return how many were made.

    They come straight from the ellipsoid between the start and one of the goals (Gammell et al.
    2014, algorithm 2). history (n_draws,): cost of the best path after each draw. `bias` and
    `shortened` are not used.
    """
    is_edge_free, chain = as_edge_check(functions[EDGE_CHECK_AT]), as_chain(functions[CHAIN_AT])
    free_radius = as_free_radius(functions[FREE_RADIUS_AT])
    q = np.empty(tree_q.shape[2])
    for draw in range(n_draws):
        side = draw & 1 if is_bidirectional else 0
        goal = int64(uniform(rng) * sizes[N_GOALS])
        history[draw] = best[0]
        if best[0] < math.inf:
            if not draw_informed(bounds, tree_q[0, 0], tree_q[1, goal], best[0], rng, q):
                continue
        elif uniform(rng) < goal_bias:
            copy(tree_q[1, goal] if side == 0 else tree_q[0, 0], q)
        else:
            draw_uniform(bounds, rng, q)
        extend(
            is_edge_free,
            free_radius,
            resolution,
            chain,
            robot,
            obstacles,
            step_size,
            clearance_gain,
            rewire_radius,
            is_bidirectional,
            side,
            q,
            tree_q,
            links,
            costs,
            sizes,
            meetings,
            best,
        )
        history[draw] = best[0]
    return n_draws
