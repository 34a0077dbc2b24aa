# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of the reproduction, drawn from its rows and from a few plans of their own."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from rrth_planner.io.map_file import load_map
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path as JointPath
from rrth_planner.planning.planner import plan
from rrth_planner.reproduction.claims.path_club import both_ways_shares
from rrth_planner.reproduction.experiments import (
    ALGORITHMS,
    ARM_ALGORITHMS,
    Extent,
    FIVE,
    NEAR,
    RRT,
    RRT_H,
    SCATTERED,
    SCATTERED_CLUB,
    SCATTERED_PLAIN,
    TWO_WAYS,
    with_near,
)
from rrth_planner.reproduction.figures.arm import joint_paths_figure, motions_figure
from rrth_planner.reproduction.figures.costs import (
    convergence_figure,
    DRAWS,
    histogram_figure,
    TIME,
)
from rrth_planner.reproduction.figures.maps import escape_figure, trees_figure
from rrth_planner.reproduction.path_club import scattered_growths
from rrth_planner.reproduction.problems import CERTIFIED, load_problem
from rrth_planner.reproduction.statistics import Rows

FOLDER = 'images/reproduction'
SEED = 1
# Targets whose motions Figure 21 shows, at most.
N_MOTIONS = 4


def draw_pictures(rows: Rows, extent: Extent, output: Path) -> dict[str, str]:
    """Draw all pictures into a folder; return where they are, by caption."""
    (output / FOLDER).mkdir(parents=True, exist_ok=True)
    paths = {}
    for name, caption, figure in _pictures(rows, extent):
        paths[caption] = f'{FOLDER}/figure_{name}.png'
        figure.savefig(output / paths[caption], facecolor='white', bbox_inches='tight')
    return paths


def _pictures(rows: Rows, extent: Extent) -> Iterator[tuple[str, str, Figure]]:
    """Yield the number, the caption and the picture of each figure."""
    maps, n = extent.maps, extent.many
    results: dict[tuple[str, str], Any] = {
        (problem, name): plan(
            load_problem(problem).problem, ALGORITHMS[name], np.random.default_rng(SEED)
        )
        for problem in maps
        for name in FIVE
    }
    trees = trees_figure([load_map(problem) for problem in maps], results, FIVE)
    yield '09', 'Figure 9: trees and paths of the five planners', trees
    note = f'medians and quartiles of {n} runs'
    caption = f'Figure 10a: cost against the number of P_random, {note}'
    yield '10a', caption, convergence_figure(rows, maps, DRAWS, n)
    if NEAR in with_near(maps):
        caption = f'Figure 10b: the same, start and goal in favour of Informed RRT*, {note}'
        yield '10b', caption, convergence_figure(rows, (NEAR,), DRAWS, n)
    yield '11', f'Figure 11: cost against time, {note}', convergence_figure(rows, maps, TIME, n)
    caption = f'Figure 12: histograms of cost and of time, {n} runs (triangles: medians)'
    yield '12', caption, histogram_figure(rows, maps, n)
    shares = {
        label: both_ways_shares(rows, name, n)
        for label, name in (('with the path club', SCATTERED_CLUB), ('without', SCATTERED_PLAIN))
    }
    escape = escape_figure(
        load_map(TWO_WAYS), _scattered(SCATTERED_CLUB), _scattered(SCATTERED_PLAIN), shares
    )
    yield '14', 'Figure 14: the escape from local traps', escape
    pairs = {target: _pair(rows, target) for target in extent.targets}
    caption = 'Figure 20: joint paths to the targets, the run of median length'
    yield '20', caption, joint_paths_figure(pairs)
    shown = dict(list(pairs.items())[:: max(1, len(pairs) // N_MOTIONS)])
    yield '21', "Figure 21: the arm's motion", motions_figure(shown)


def _scattered(name: str) -> list[Array | None]:
    """Return the paths of growths after each other, of one seed."""
    growths = scattered_growths(load_problem(TWO_WAYS).problem, SCATTERED[name], SEED)
    return [growth.waypoints for growth in growths]


def _pair(rows: Rows, target: str) -> tuple[JointPath, JointPath]:
    """Return the paths of RRT and RRT-H of the seed whose RRT path is of median length."""
    name = f'arm/{target}'
    some = rows.where(problem=name, algorithm=RRT, collision=CERTIFIED)
    costs = some.aligned('cost_final')
    seed = some.rows[int(np.argsort(costs)[(len(costs) - 1) // 2])]['seed']
    problem = load_problem(name).problem
    rrt, rrt_h = (
        plan(problem, ARM_ALGORITHMS[planner], np.random.default_rng(seed)).path
        for planner in (RRT, RRT_H)
    )
    assert rrt is not None and rrt_h is not None
    return rrt, rrt_h
