# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Informed RRT*: RRT* that, once it has a path, draws only where a shorter one can lead."""

import math

from numba.core.types import int64
import numpy as np
from rrth_planner.kernels.jit import kernel, N_GOALS
from rrth_planner.kernels.search.random import uniform
from rrth_planner.kernels.search.rrt_star import extend, STAR_SIGNATURE
from rrth_planner.kernels.search.sampling import draw_informed, draw_uniform
from rrth_planner.kernels.search.space import BIAS, borrowed, TWO_TREES
from rrth_planner.kernels.vectors import copy


@kernel(STAR_SIGNATURE)
def advance(space, settings, shortened, rng, tree_q, links, costs, sizes, meetings, best, history):
    """
    Make n draws, informed ones from the first path on.

    They come straight from the ellipsoid between the start and one of the goals (Gammell et al.
    2014, algorithm 2). history (n,): cost of the best path after each draw.
    `shortened` is not used.
    """
    space, is_bidirectional = borrowed(space), settings[TWO_TREES] != 0.0
    q = np.empty(tree_q.shape[2])
    for draw in range(history.shape[0]):
        side = draw & 1 if is_bidirectional else 0
        goal = int64(uniform(rng) * sizes[N_GOALS])
        history[draw] = best[0]
        if best[0] < math.inf:
            if not draw_informed(space.bounds, tree_q[0, 0], tree_q[1, goal], best[0], rng, q):
                continue
        elif uniform(rng) < settings[BIAS]:
            copy(tree_q[1, goal] if side == 0 else tree_q[0, 0], q)
        else:
            draw_uniform(space.bounds, rng, q)
        extend(space, settings, side, q, tree_q, links, costs, sizes, meetings, best)
        history[draw] = best[0]
