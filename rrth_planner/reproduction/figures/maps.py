# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of maps with trees and paths, as the paper's Figures 9 and 14."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
import numpy as np
from rrth_planner.io.map_file import load_map
from rrth_planner.model.arrays import Array
from rrth_planner.planning.box_map import BoxMap
from rrth_planner.planning.options import Options
from rrth_planner.reproduction.claims.path_club import both_ways_shares
from rrth_planner.reproduction.experiments import (
    LATTICES,
    SCATTERED,
    SCATTERED_CLUB,
    SCATTERED_PLAIN,
    TWO_WAYS,
)
from rrth_planner.reproduction.path_club import goes_over_the_top, scattered_growths
from rrth_planner.reproduction.problems import load_problem
from rrth_planner.reproduction.relatives.search import find_path
from rrth_planner.reproduction.statistics import Rows
from rrth_planner.visualization.motion_figure import GRID

WALL, FRAME, TREE = '#4c5560', '#30343b', '#9fb4c9'
FIRST, FINAL, START, GOAL = '#d9822b', '#c2185b', '#2f9e6e', '#1b6ca8'
BEFORE = "RRT-H's path before shortening"
# Of the plans that are drawn.
SEED = 1


def trees_figure(
    maps: Sequence[str], planners: Mapping[str, Options], before: str = BEFORE
) -> Figure:
    """
    Return the trees and paths of one seed: a row a map, a column a planner.

    before: what the legend calls the path that RRT-H's final one was made of.
    """
    figure = Figure(
        figsize=(2.75 * len(planners), 2.95 * len(maps) + 0.5), layout='constrained', dpi=100
    )
    grid = figure.subplots(len(maps), len(planners), squeeze=False)
    for row, problem in zip(grid, maps, strict=True):
        for axes, (name, options) in zip(row, planners.items(), strict=True):
            rng = np.random.default_rng(SEED)
            result = find_path(load_problem(problem).problem, options, rng)
            _draw_map(axes, load_map(problem))
            for tree in result.trees:
                children = np.flatnonzero(tree.parents >= 0)
                edges = tree.nodes[np.stack([tree.parents[children], children], axis=1)]
                lines = LineCollection(list(edges), colors=TREE, linewidths=0.5, zorder=1)
                axes.add_collection(lines)
            if result.raw_path is not None and name.startswith('RRT-H'):
                _draw_path(axes, result.raw_path.waypoints, FIRST, 1.4)
            note = 'no path'
            if result.path is not None:
                _draw_path(axes, result.path.waypoints, FINAL, 2.2)
                note = f'cost {result.path.length:.1f}'
            unit = 'nodes' if name in LATTICES else 'P_random'
            axes.set_title(f'{name}\n{note}, {result.n_samples} {unit}', fontsize=9)
        row[0].set_ylabel(problem.replace('_', ' '), fontsize=11, fontweight='bold')
    _legend(figure, ('tree', TREE), (before, FIRST), ('path', FINAL))
    return figure


def escape_figure(rows: Rows, n: int) -> Figure:
    """
    Return what the escape does: paths of growths with a path club and without, and its success.

    The paths are first ones, before shortening, of one seed; the success is the share of n runs
    that have found both homotopy classes after 1, 2, ... growths.
    """
    box_map, problem = load_map(TWO_WAYS), load_problem(TWO_WAYS).problem
    figure = Figure(figsize=(12.5, 4.6), layout='constrained', dpi=100)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15))
    for axes, name, title, label, colour, mark in (
        (left, SCATTERED_CLUB, 'that avoid the path club', 'with the path club', FINAL, 'o'),
        (middle, SCATTERED_PLAIN, 'without a club', 'without', GOAL, 's'),
    ):
        _draw_map(axes, box_map)
        growths = scattered_growths(problem, SCATTERED[name], SEED)
        paths = [growth.path.waypoints for growth in growths if growth.path is not None]
        for i, path in enumerate(paths):
            shade = i / max(1, len(paths) - 1)
            _draw_path(axes, path, (0.76, 0.1 + 0.6 * shade, 0.36 - 0.26 * shade), 1.6)
        n_above = sum(goes_over_the_top(path) for path in paths)
        axes.set_title(
            f'{len(growths)} growths {title}:\n{len(paths)} paths, {n_above} over the top',
            fontsize=10,
        )
        shares = 100 * np.array(both_ways_shares(rows, name, n))
        after = np.arange(1, len(shares) + 1)
        right.plot(after, shares, marker=mark, color=colour, lw=2, label=label)
    left.set_xlabel('from the first growth (red) to the last (yellow)')
    right.set_xlabel('growths')
    right.set_ylabel('runs that have found both ways round [%]')
    right.set_ylim(-2.0, 103.0)
    right.grid(color=GRID)
    right.legend(frameon=False, loc='center right')
    return figure


def _draw_map(axes: Any, box_map: BoxMap) -> None:
    """Draw the frame, the walls, the start and the goal of a map in the plane."""
    (x0, y0), (x1, y1) = box_map.bounds
    for lower, upper in box_map.obstacles:
        axes.add_patch(Rectangle(lower, *(upper - lower), color=WALL, lw=0, zorder=2))
    margin = 0.01 * (x1 - x0)
    axes.set(xlim=(x0 - margin, x1 + margin), ylim=(y0 - margin, y1 + margin), aspect='equal')
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(FRAME)
    for q, colour, mark, size in ((box_map.start, START, 'o', 7), (box_map.goal, GOAL, '*', 12)):
        axes.plot(*q, ls='', marker=mark, ms=size, color=colour, mec='white', zorder=4)


def _draw_path(axes: Any, waypoints: Array, colour: Any, width: float) -> None:
    """Draw a path, shape (n, 2)."""
    axes.plot(*waypoints.T, color=colour, lw=width, zorder=3, solid_joinstyle='round')


def _legend(figure: Figure, *entries: tuple[str, str]) -> None:
    axes: Any = figure.axes[0]
    for label, colour in entries:
        axes.plot([], [], color=colour, lw=2, label=label)
    for label, colour, mark in (('start', START, 'o'), ('goal', GOAL, '*')):
        axes.plot([], [], ls='', marker=mark, color=colour, ms=9, label=label)
    n = len(entries) + 2
    figure.legend(loc='outside lower center', ncols=n, frameon=False, fontsize=9)
