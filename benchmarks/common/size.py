# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How many runs stand behind each figure."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """
    The size of a run of the benchmarks; times are in seconds.

    Parameters
    ----------
    repeats : int
        Timings of each compiled loop.
    n_edges : int
        Edges, or configurations, in such a loop.
    n_shortcut : int
        Blocked queries whose shortcut paths give edges in contact.
    seeds : int
        Runs of our planners on each problem.
    improve_time : float
        How long each of them improves its path.
    n_queries, n_bodies : int
        Full queries, and wearers that they are spread over.
    n_long : int
        Runs that the best known cost of each full query comes from.
    peer_seeds, peer_time : int, float
        Runs of each peer on each problem, and how long one that improves its path runs.
    n_certified, n_judged : int
        Certified edges that are checked densely, and those that the reference checker checks too.
    n_plans : int
        Requests to one node.
    cold_starts, warm_starts : int
        Starts of a node without and with compiled kernels.
    n_pointing : int
        Pointing goals for each other arm.

    """

    repeats: int = 30
    n_edges: int = 4000
    n_shortcut: int = 300
    seeds: int = 100
    improve_time: float = 0.1
    n_queries: int = 1000
    n_bodies: int = 100
    n_long: int = 3
    peer_seeds: int = 8
    peer_time: float = 1.0
    n_certified: int = 1_000_000
    n_judged: int = 3000
    n_plans: int = 10_000
    cold_starts: int = 1
    warm_starts: int = 5
    n_pointing: int = 20


QUICK = Extent(
    repeats=5,
    n_edges=1000,
    n_shortcut=10,
    seeds=4,
    improve_time=0.05,
    n_queries=20,
    n_bodies=5,
    n_long=2,
    peer_seeds=1,
    peer_time=0.2,
    n_certified=20_000,
    n_judged=50,
    n_plans=200,
    cold_starts=0,
    warm_starts=1,
    n_pointing=3,
)
