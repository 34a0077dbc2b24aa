# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of the reproduction, drawn from its rows and from a few plans of their own."""

from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from rrth_planner.io.arm_file import load_arm
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
from rrth_planner.reproduction.problems import (
    CERTIFIED,
    load_problem,
    load_wearer,
    RAY,
    TARGETS,
)
from rrth_planner.reproduction.statistics import Rows

FOLDER = 'images/reproduction'
SEED = 1
# Targets whose motions Figure 21 shows, at most.
N_MOTIONS = 4


def draw_pictures(rows: Rows, extent: Extent, output: Path) -> dict[str, list[str]]:
    """Draw all pictures into a folder; return where they are, by caption."""
    (output / FOLDER).mkdir(parents=True, exist_ok=True)
    maps, n = extent.maps, extent.many
    captions: dict[str, list[str]] = {}

    def save(caption: str, name: str, figure: Figure) -> None:
        FigureCanvasAgg(figure)
        figure.savefig(output / FOLDER / f'{name}.png', facecolor='white', bbox_inches='tight')
        captions.setdefault(caption, []).append(f'{FOLDER}/{name}.png')

    results: dict[tuple[str, str], Any] = {
        (problem, name): plan(
            load_problem(problem).problem, ALGORITHMS[name], np.random.default_rng(SEED)
        )
        for problem in maps
        for name in FIVE
    }
    save(
        'Figure 9: trees and paths of the five planners',
        'figure_09',
        trees_figure([load_map(problem) for problem in maps], results, FIVE),
    )
    note = f'medians and quartiles of {n} runs'
    caption = f'Figure 10a: cost against the number of P_random, {note}'
    save(caption, 'figure_10a', convergence_figure(rows, maps, DRAWS, n))
    if NEAR in with_near(maps):
        caption = f'Figure 10b: the same, start and goal in favour of Informed RRT*, {note}'
        save(caption, 'figure_10b', convergence_figure(rows, (NEAR,), DRAWS, n))
    caption = f'Figure 11: cost against time, {note}'
    save(caption, 'figure_11', convergence_figure(rows, maps, TIME, n))
    caption = f'Figure 12: histograms of cost and of time, {n} runs (triangles: medians)'
    save(caption, 'figure_12', histogram_figure(rows, maps, n))
    shares = {
        label: both_ways_shares(rows, name, n)
        for label, name in (('with the path club', SCATTERED_CLUB), ('without', SCATTERED_PLAIN))
    }
    save(
        'Figure 14: the escape from local traps',
        'figure_14',
        escape_figure(
            load_map(TWO_WAYS),
            _scattered(SCATTERED_CLUB),
            _scattered(SCATTERED_PLAIN),
            shares,
        ),
    )
    pairs = {target: _pair(rows, target) for target in extent.targets}
    save(
        'Figure 20: joint paths to the targets, the run of median length',
        'figure_20',
        joint_paths_figure(pairs),
    )
    shown = dict(list(pairs.items())[:: max(1, len(pairs) // N_MOTIONS)])
    save(
        "Figure 21: the arm's motion",
        'figure_21',
        motions_figure(load_arm(), load_wearer(), shown, TARGETS, RAY),
    )
    return captions


def _scattered(name: str) -> list[Array | None]:
    """Return the paths of growths after each other, of one seed."""
    growths = scattered_growths(load_problem(TWO_WAYS).problem, SCATTERED[name], SEED)
    return [None if g.path is None else g.path.waypoints for g in growths]


def _pair(rows: Rows, target: str) -> tuple[JointPath, JointPath]:
    """Return the paths of RRT and RRT-H of the seed whose RRT path is of median length."""
    name = f'arm/{target}'
    some = rows.where(problem=name, algorithm=RRT, collision=CERTIFIED)
    costs = some.aligned('cost_final')
    seed = some.rows[int(np.argsort(costs)[(len(costs) - 1) // 2])]['seed']
    problem = load_problem(name).problem
    paths = [
        plan(problem, ARM_ALGORITHMS[planner], np.random.default_rng(seed)).path
        for planner in (RRT, RRT_H)
    ]
    assert paths[0] is not None
    assert paths[1] is not None
    return paths[0], paths[1]
