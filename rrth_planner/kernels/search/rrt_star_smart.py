# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RRT*-Smart: RRT* that draws near the corners of its shortened path."""

import math

from numba.core.types import int64
import numpy as np
from rrth_planner.kernels.jit import kernel, N_GOALS, OUT_MAT, SPACE
from rrth_planner.kernels.search.random import uniform
from rrth_planner.kernels.search.rrt_star import extend, PARENT, RATIO, STAR_SIGNATURE
from rrth_planner.kernels.search.sampling import draw_ball, draw_uniform
from rrth_planner.kernels.search.space import BIAS, borrowed, is_free, STEP, TWO_TREES
from rrth_planner.kernels.search.tree import trace_path
from rrth_planner.kernels.vectors import copy, path_length


@kernel(int64(SPACE, OUT_MAT, int64), is_inner=True)
def skip_waypoints(space, path, n):
    """
    Drop the waypoints that are not needed, in place; return how many are left.

    From the end back: each waypoint is joined to the earliest ancestor that it sees (the path
    optimisation of Nasir et al. 2013, seen from the start).
    """
    kept, i = min(n, 1), 0
    while i < n - 1:
        ahead = n - 1
        while ahead > i + 1 and not is_free(space, path[i], path[ahead]):
            ahead -= 1
        copy(path[ahead], path[kept])
        kept += 1
        i = ahead
    return kept


@kernel(STAR_SIGNATURE)
def advance(space, settings, shortened, rng, tree_q, links, costs, sizes, meetings, best, history):
    """
    Make n draws; history (n,): cost of the shortened path after each.

    Whenever the path of the trees improves, it is shortened by skipping waypoints. The best such
    path is kept in `shortened`, its inner waypoints are the beacons: one in settings[RATIO] draws
    of each tree comes from a ball of half a step round one of them (Nasir et al. 2013).
    """
    space, is_bidirectional = borrowed(space), settings[TWO_TREES] != 0.0
    ratio = int64(settings[RATIO])
    q, path = np.empty(tree_q.shape[2]), np.empty(shortened.shape)
    for draw in range(history.shape[0]):
        side = draw & 1 if is_bidirectional else 0
        # Counted for each tree: an even bias would leave one of them without beacons.
        turn = draw // 2 if is_bidirectional else draw
        n_beacons = int64(best[2]) - 2
        if n_beacons > 0 and turn % ratio == 0:
            beacon = 1 + int64(uniform(rng) * n_beacons)
            draw_ball(shortened[beacon], 0.5 * settings[STEP], space.bounds, rng, q)
        elif uniform(rng) < settings[BIAS]:
            goal = int64(uniform(rng) * sizes[N_GOALS])
            copy(tree_q[1, goal] if side == 0 else tree_q[0, 0], q)
        else:
            draw_uniform(space.bounds, rng, q)
        is_better = extend(space, settings, side, q, tree_q, links, costs, sizes, meetings, best)
        # Reused trees may have brought a path along.
        if is_better or best[0] < math.inf and best[3] == math.inf:
            row = int64(best[1])
            n = trace_path(tree_q, links[:, PARENT], meetings[row, 0], meetings[row, 1], path)
            n = skip_waypoints(space, path, n)
            length = path_length(path, n)
            if n > 0 and length < best[3]:
                for i in range(n):
                    copy(path[i], shortened[i])
                best[2], best[3] = n, length
        history[draw] = best[3]
