# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The runs behind the paper's figures and numbers: which options, which problems, which seeds."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rrth_planner.planning.options import (
    InformedRRTStarOptions,
    Options,
    PrintedRRTHOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
    TreeOptions,
)
from rrth_planner.reproduction.path_club import ScatterOptions
from rrth_planner.reproduction.problems import TARGETS
from rrth_planner.reproduction.relatives.dubins_path import DubinsOptions
from rrth_planner.reproduction.relatives.lattice import LatticeOptions
from rrth_planner.reproduction.relatives.potential_field import PotentialFieldOptions
from rrth_planner.reproduction.relatives.roadmap import RoadmapOptions
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

FIVE = ('RRT', 'RRT*', 'Informed RRT*', 'RRT*-Smart', 'RRT-H')
RRT, RRT_STAR, INFORMED, SMART, RRT_H = FIVE
PRINTED, PRINTED_FINE = 'RRT-H as printed', 'RRT-H as printed, fine'
PRINTED_DENSE, PRINTED_SMALL = 'RRT-H as printed, dense P_C', 'RRT-H as printed, small k'
PRINTED_OTHERS = (PRINTED_FINE, PRINTED_DENSE, PRINTED_SMALL)
LONG_STEP, BIASED = 'RRT, step 20', 'RRT, goal bias 5 %'
CLUB, NO_CLUB = 'RRT-H, path club', 'RRT-H, no club'


def _printed(corners: float, target: float, check: float) -> PrintedRRTHOptions:
    """Return the options of the printed steps: k, spacings of P_T and of P_C [map units]."""
    spacings = {'corner_spacing': corners, 'target_spacing': target, 'check_spacing': check}
    return PrintedRRTHOptions(**{**_RRT_H, **spacings})


ALGORITHMS: dict[str, TreeOptions] = {
    RRT: RRTOptions(**_GROWTH),
    RRT_STAR: RRTStarOptions(**_STAR),
    INFORMED: InformedRRTStarOptions(**_STAR),
    SMART: RRTStarSmartOptions(**_STAR),
    RRT_H: RRTHOptions(**_RRT_H),
    PRINTED: _printed(SPARSE, SPARSE, SPARSE),
    PRINTED_FINE: _printed(DENSE, DENSE, DENSE),
    PRINTED_DENSE: _printed(SPARSE, SPARSE, DENSE),
    PRINTED_SMALL: _printed(DENSE, SPARSE, SPARSE),
    LONG_STEP: RRTOptions(**{**_GROWTH, 'step_size': 20.0}),
    BIASED: RRTOptions(**{**_GROWTH, 'goal_bias': 0.05}),
}
# What the paper names beside the five, and references; in the plane only.
FIELD, NO_FIELD = 'RRT, potential field', 'RRT, steps of one length'
RADII = (2.0, 5.0, 10.0)
DUBINS = tuple(f'RRT-H, Dubins, radius {radius:g}' for radius in RADII)
HALVED = 'RRT-H, Dubins, radius 10, halved where it must be'
LATTICES = COARSE, FINE = 'A*, spacing 5', 'A*, spacing 1'
ROADMAPS = SPARSE_ROADMAP, DENSE_ROADMAP = 'PRM, 200 draws', 'PRM, 2000 draws'
RELATIVES: dict[str, Options] = {
    # With the constants of that class, and without any force but that to the draw.
    FIELD: PotentialFieldOptions(),
    NO_FIELD: PotentialFieldOptions(attraction=0.0, repulsion=0.0),
    **{
        name: DubinsOptions(**{**_RRT_H, 'radius': radius})
        for name, radius in zip(DUBINS, RADII, strict=True)
    },
    HALVED: DubinsOptions(**{**_RRT_H, 'radius': RADII[-1], 'halvings': 2}),
    COARSE: LatticeOptions(spacing=5.0),
    FINE: LatticeOptions(spacing=1.0),
    SPARSE_ROADMAP: RoadmapOptions(n_samples=200),
    DENSE_ROADMAP: RoadmapOptions(n_samples=STEPS),
}
# Growths after the first one that the escape may make.
ATTEMPTS = (0, 1, 2, 3, 4, 6)
# More club points than `club_count`, so near [map units], turn a new point away with this chance.
_CLUB: dict[str, Any] = {
    **_RRT_H,
    'club_budget': 400,
    'club_count': 2,
    'club_radius': 10.0,
    'club_probability': 0.9,
}
# Eight growths alone, after each other: with the path club and without.
SCATTERED_CLUB, SCATTERED_PLAIN = 'growths, path club', 'growths, no club'
_SCATTER: dict[str, Any] = {**_CLUB, 'club_attempts': 7, 'club_budget': 1000}
SCATTERED = {
    SCATTERED_CLUB: ScatterOptions(**_SCATTER),
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
        Runs of each planner on each map in the two columns of the table, timed but for relatives.
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
    runs: list[Run] = []
    for problem in with_near(extent.maps):
        for name in FIVE:
            runs += _runs(problem, name, range(extent.many))
    # Compared seed by seed: one right after the other, so that the machine is the same.
    for problem in with_near(extent.maps):
        for seed in range(extent.many):
            for name in (PRINTED, *(PRINTED_OTHERS if problem in extent.maps else ())):
                runs += _runs(problem, name, [seed])
    return runs


def spread_runs(extent: Extent) -> list[Run]:
    """Return the other runs, which may be done beside each other."""
    runs = [
        *(*_long_runs(extent), *_arm_runs(extent), *_club_runs(extent), *_map_runs(extent)),
        *_relative_runs(extent),
    ]
    # Long and short ones mixed: the progress bar is realistic, and no worker is left with all
    # the long ones.
    return [runs[i] for i in np.random.default_rng(0).permutation(len(runs))]


def with_near(maps: Sequence[str]) -> tuple[str, ...]:
    """Return the maps and, beside the C, the one of Figure 10b."""
    return (*maps, NEAR) if 'c_shape' in maps else tuple(maps)


def long_maps(extent: Extent) -> list[str]:
    """Return the maps of the runs of 20,000 steps."""
    return [name for name in extent.maps if name != 'fence']


def long_label(name: str) -> str:
    """Return what a planner with 20,000 steps is called."""
    return f'{name}, {LONG} steps'


def club_label(name: str, attempts: int) -> str:
    """Return what RRT-H with so many further growths is called."""
    return f'{name}, {attempts}'


def _runs(
    problem: str, name: str, seeds: Iterable[int], options: Options | None = None
) -> list[Run]:
    """Return a run a seed, of a planner of ALGORITHMS or of other options."""
    options = options or ALGORITHMS[name]
    return [Run(problem=problem, algorithm=name, options=options, seed=seed) for seed in seeds]


def _map_runs(extent: Extent) -> Iterator[Run]:
    for problem in extent.maps:
        # Seeds that the timed runs have are not done twice.
        for name in (RRT, RRT_H, PRINTED, PRINTED_FINE):
            yield from _runs(problem, name, range(extent.many, extent.seeds))
        for name in (LONG_STEP, BIASED):
            yield from _runs(problem, name, range(extent.seeds))


def _relative_runs(extent: Extent) -> Iterator[Run]:
    for problem in with_near(extent.maps):
        for name, options in RELATIVES.items():
            # A lattice leaves nothing to chance.
            yield from _runs(problem, name, range(1 if name in LATTICES else extent.many), options)


def _long_runs(extent: Extent) -> Iterator[Run]:
    for problem in long_maps(extent):
        for name in (RRT_STAR, INFORMED):
            options = replace(ALGORITHMS[name], max_samples=LONG)
            yield from _runs(problem, long_label(name), range(extent.long), options)


def _club_runs(extent: Extent) -> Iterator[Run]:
    for attempts in ATTEMPTS:
        for name, changes in ((CLUB, {}), (NO_CLUB, {'club_probability': 0.0})):
            options = RRTHOptions(**{**_CLUB, 'club_attempts': attempts, **changes})
            yield from _runs(TWO_WAYS, club_label(name, attempts), range(extent.seeds), options)
    for name, scatter in SCATTERED.items():
        yield from _runs(TWO_WAYS, name, range(extent.many), scatter)


def _arm_runs(extent: Extent) -> Iterator[Run]:
    for target in extent.targets:
        for name, options in ARM_ALGORITHMS.items():
            yield from _runs(f'arm/{target}', name, range(extent.arm), options)
        for collision in (CHECK_POINTS, SAMPLED):
            for run in _runs(
                f'arm/{target}', RRT_H, range(extent.arm_modes), ARM_ALGORITHMS[RRT_H]
            ):
                yield replace(run, collision=collision)
