# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The runs behind the paper's figures and numbers: which options, which problems, which seeds."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rrth_planner.planning.options import (
    InformedRRTStarOptions,
    PrintedRRTHOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
    TreeOptions,
)
from rrth_planner.reproduction.path_club import ScatterOptions
from rrth_planner.reproduction.problems import CERTIFIED, TARGETS
from rrth_planner.reproduction.run import Run

MAPS = ('c_shape', 'spiral', 'fence')
NEAR, TWO_WAYS = 'c_shape_near', 'two_ways'
STEPS = 2000
LONG = 20_000
# As section 2 describes them: one tree, uniform draws. No clock ends a run, its draws do.
_BASE: dict[str, Any] = {
    'step_size': 10.0,
    'goal_bias': 0.0,
    'is_bidirectional': False,
    'max_samples': 100_000,
    'time_limit': 600.0,
}
_GROWTH: dict[str, Any] = {**_BASE, 'near_bias': 0.0}
_STAR: dict[str, Any] = {**_BASE, 'max_samples': STEPS, 'improve_time': 600.0}
# The three steps alone, after one growth. k and the spacings of P_T and P_C in map units: a
# hundredth of a map is 1.
_RRT_H: dict[str, Any] = {
    **_GROWTH,
    'corner_spacing': 0.05,
    'corner_moves': 0,
    'club_attempts': 0,
    'improve_time': 600.0,
}
# Of the printed steps, sparse and dense.
SPARSE, DENSE = 1.0, 0.2
_PRINTED: dict[str, Any] = {
    **_RRT_H,
    'corner_spacing': SPARSE,
    'target_spacing': SPARSE,
    'check_spacing': SPARSE,
}

RRT, RRT_STAR, INFORMED, SMART, RRT_H = (
    'RRT',
    'RRT*',
    'Informed RRT*',
    'RRT*-Smart',
    'RRT-H',
)
FIVE = (RRT, RRT_STAR, INFORMED, SMART, RRT_H)
PRINTED, PRINTED_FINE = 'RRT-H as printed', 'RRT-H as printed, fine'
PRINTED_DENSE, PRINTED_SMALL = 'RRT-H as printed, dense P_C', 'RRT-H as printed, small k'
PRINTED_OTHERS = (PRINTED_FINE, PRINTED_DENSE, PRINTED_SMALL)
LONG_STEP, BIASED = 'RRT, step 20', 'RRT, goal bias 5 %'
CLUB, NO_CLUB = 'RRT-H, path club', 'RRT-H, no club'
ALGORITHMS: dict[str, TreeOptions] = {
    RRT: RRTOptions(**_GROWTH),
    RRT_STAR: RRTStarOptions(**_STAR),
    INFORMED: InformedRRTStarOptions(**_STAR),
    SMART: RRTStarSmartOptions(**_STAR),
    RRT_H: RRTHOptions(**_RRT_H),
    PRINTED: PrintedRRTHOptions(**_PRINTED),
    PRINTED_FINE: PrintedRRTHOptions(
        **{**_PRINTED, 'corner_spacing': DENSE, 'target_spacing': DENSE, 'check_spacing': DENSE}
    ),
    PRINTED_DENSE: PrintedRRTHOptions(**{**_PRINTED, 'check_spacing': DENSE}),
    PRINTED_SMALL: PrintedRRTHOptions(**{**_PRINTED, 'corner_spacing': DENSE}),
    LONG_STEP: RRTOptions(**{**_GROWTH, 'step_size': 20.0}),
    BIASED: RRTOptions(**{**_GROWTH, 'goal_bias': 0.05}),
}
# Growths after the first one that the escape may make, and the draws of each at most.
ATTEMPTS = (0, 1, 2, 3, 4, 6)
CLUB_BUDGET = 400
# More club points than this, so near [map units], turn a new point away with this chance.
CLUB_COUNT, CLUB_RADIUS, CLUB_PROBABILITY = 2, 10.0, 0.9
# Growths alone, after each other, and the draws of each at most: with the path club and without.
SCATTERED_CLUB, SCATTERED_PLAIN = 'growths, path club', 'growths, no club'
N_GROWTHS, SCATTER_BUDGET = 8, 1000
_SCATTER: dict[str, Any] = {
    **_RRT_H,
    'club_attempts': N_GROWTHS - 1,
    'club_budget': SCATTER_BUDGET,
    'club_count': CLUB_COUNT,
    'club_probability': CLUB_PROBABILITY,
}
SCATTERED = {
    SCATTERED_CLUB: ScatterOptions(**{**_SCATTER, 'club_radius': CLUB_RADIUS}),
    SCATTERED_PLAIN: ScatterOptions(**{**_SCATTER, 'club_radius': 0.0}),
}
# The arm's step [rad]: the paper gives none; with this one RRT's paths wind as much as its do.
ARM_STEP = 0.6
_ARM: dict[str, Any] = {'step_size': ARM_STEP, 'max_samples': 200_000}
ARM_ALGORITHMS: dict[str, TreeOptions] = {
    RRT: RRTOptions(**{**_GROWTH, **_ARM}),
    RRT_H: RRTHOptions(**{**_RRT_H, **_ARM}),
}
# The paper's test, and an exact one, every 0.02 rad along an edge.
CHECK_POINTS, SAMPLED = 'check_points:0.02', 'sampled:0.02'


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """
    How many runs stand behind each number.

    Parameters
    ----------
    few, many : int
        Runs of each planner on each map in the two columns of the table, timed.
    seeds : int
        Runs behind what needs more of them: shares, medians of draws.
    long : int
        Runs of 20,000 steps.
    arm, arm_modes : int
        Runs for each target of the arm, and in each other collision mode.
    maps, targets : tuple of str
        Which problems.

    """

    few: int = 10
    many: int = 100
    seeds: int = 1000
    long: int = 50
    arm: int = 100
    arm_modes: int = 50
    maps: tuple[str, ...] = MAPS
    targets: tuple[str, ...] = tuple(TARGETS)


QUICK = Extent(few=10, many=20, seeds=50, long=3, arm=4, arm_modes=4)


def timed_runs(extent: Extent) -> list[Run]:
    """Return the runs whose times are reported, to be done one after another."""
    wanted = [
        *(
            (problem, name, seed)
            for problem in with_near(extent.maps)
            for name in FIVE
            for seed in range(extent.many)
        ),
        # Compared seed by seed: one right after the other, so that the machine is the same.
        *(
            (problem, name, seed)
            for problem in with_near(extent.maps)
            for seed in range(extent.many)
            for name in (PRINTED, *(PRINTED_OTHERS if problem in extent.maps else ()))
        ),
    ]
    return [
        Run(problem=problem, algorithm=name, options=ALGORITHMS[name], seed=seed)
        for problem, name, seed in wanted
    ]


def spread_runs(extent: Extent) -> list[Run]:
    """Return the other runs, which may be done beside each other."""
    runs = [*_long_runs(extent), *_arm_runs(extent), *_club_runs(extent), *_map_runs(extent)]
    # Long and short ones mixed: the progress bar is realistic, and no worker is left with all
    # the long ones.
    return [runs[i] for i in np.random.default_rng(0).permutation(len(runs))]


def club_options(attempts: int, *, probability: float) -> RRTHOptions:
    """Return RRT-H with the escape: so many further growths, club points avoided or not."""
    options = ALGORITHMS[RRT_H]
    assert isinstance(options, RRTHOptions)
    return replace(
        options,
        club_attempts=attempts,
        club_budget=CLUB_BUDGET,
        club_count=CLUB_COUNT,
        club_radius=CLUB_RADIUS,
        club_probability=probability,
    )


def with_near(maps: Sequence[str]) -> tuple[str, ...]:
    """Return the maps and, beside the C, the one of Figure 10b."""
    return (*maps, NEAR) if 'c_shape' in maps else tuple(maps)


def _map_runs(extent: Extent) -> Iterable[Run]:
    for problem in extent.maps:
        for name in (RRT, RRT_H, PRINTED, PRINTED_FINE, LONG_STEP, BIASED):
            # Seeds that the timed runs have are not done twice.
            first = 0 if name in (LONG_STEP, BIASED) else extent.many
            for seed in range(first, extent.seeds):
                yield Run(problem=problem, algorithm=name, options=ALGORITHMS[name], seed=seed)


def _long_runs(extent: Extent) -> Iterable[Run]:
    for problem in (name for name in extent.maps if name != 'fence'):
        for name in (RRT_STAR, INFORMED):
            options = replace(ALGORITHMS[name], max_samples=LONG)
            for seed in range(extent.long):
                yield Run(problem=problem, algorithm=long_label(name), options=options, seed=seed)


def long_label(name: str) -> str:
    """Return what a planner with 20,000 steps is called."""
    return f'{name}, {LONG} steps'


def club_label(name: str, attempts: int) -> str:
    """Return what RRT-H with so many further growths is called."""
    return f'{name}, {attempts}'


def _club_runs(extent: Extent) -> Iterable[Run]:
    for attempts in ATTEMPTS:
        for name, probability in ((CLUB, CLUB_PROBABILITY), (NO_CLUB, 0.0)):
            options = club_options(attempts, probability=probability)
            for seed in range(extent.seeds):
                yield Run(
                    problem=TWO_WAYS,
                    algorithm=club_label(name, attempts),
                    options=options,
                    seed=seed,
                )
    for name, scatter in SCATTERED.items():
        for seed in range(extent.many):
            yield Run(problem=TWO_WAYS, algorithm=name, options=scatter, seed=seed)


def _arm_runs(extent: Extent) -> Iterable[Run]:
    for target in extent.targets:
        for collision in (CERTIFIED, CHECK_POINTS, SAMPLED):
            is_proof = collision == CERTIFIED
            for name in ARM_ALGORITHMS if is_proof else (RRT_H,):
                for seed in range(extent.arm if is_proof else extent.arm_modes):
                    yield Run(
                        problem=f'arm/{target}',
                        algorithm=name,
                        options=ARM_ALGORITHMS[name],
                        seed=seed,
                        collision=collision,
                    )
