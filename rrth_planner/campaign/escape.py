# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where growths go with the path club and without: the paper's Figures 13 and 14."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.campaign.paper_runs import (
    club_options,
    CLUB_PROBABILITY,
    CLUB_RADIUS,
    TWO_WAYS,
)
from rrth_planner.campaign.problems import load_problem
from rrth_planner.deadline import Deadline
from rrth_planner.growth import grow

# Growths after each other, and the draws of each at most.
N_GROWTHS, BUDGET = 8, 1000
# Above this height a path goes round by the top of the map.
TOP = 85.0


def scattered_paths(seed: int, *, club_radius: float) -> list[Array | None]:
    """
    Return the first paths of growths, each kept away from those before it.

    Parameters
    ----------
    seed : int
    club_radius : float
        0: the growths know nothing of each other [map units].

    Returns
    -------
    list of ndarray, shape (n, 2), or None
        None where a growth spent its draws.

    """
    problem = load_problem(TWO_WAYS).problem
    options = replace(
        club_options(N_GROWTHS - 1, probability=CLUB_PROBABILITY), club_radius=club_radius
    )
    rng, club = np.random.default_rng(seed), np.empty((0, 2))
    paths: list[Array | None] = []
    for _ in range(N_GROWTHS):
        deadline = Deadline(options.time_limit, lambda: False)
        grown = grow(problem, problem.q_goals, options, rng, deadline, club=club, budget=BUDGET)
        paths.append(grown.waypoints)
        if grown.waypoints is not None and club_radius > 0.0:
            club = np.concatenate([club, grown.waypoints[1:-1]])
    return paths


def goes_over_the_top(path: Array) -> bool:
    """Return whether a path, shape (n, 2), takes the longer way of the map."""
    return bool(path[:, 1].max() > TOP)


def both_ways_shares(seeds: Sequence[int], *, has_club: bool) -> list[float]:
    """Return the share of seeds whose first 1, 2, ... growths have found both ways round."""
    radius = CLUB_RADIUS if has_club else 0.0
    found = np.zeros((len(seeds), N_GROWTHS), dtype=bool)
    for i, seed in enumerate(seeds):
        ways: set[bool] = set()
        for j, path in enumerate(scattered_paths(seed, club_radius=radius)):
            if path is not None:
                ways.add(goes_over_the_top(path))
            found[i, j] = len(ways) == 2
    return [float(share) for share in found.mean(axis=0)]
