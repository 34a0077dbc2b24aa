# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of maps with trees and paths, as the paper's Figures 9 and 14."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.planning.box_map import BoxMap
from rrth_planner.planning.result import PlanResult, Tree
from rrth_planner.reproduction.path_club import goes_over_the_top
from rrth_planner.visualization.motion_figure import GRID

WALL, FRAME, TREE = '#4c5560', '#30343b', '#9fb4c9'
FIRST, FINAL, START, GOAL = '#d9822b', '#c2185b', '#2f9e6e', '#1b6ca8'


def trees_figure(
    maps: Sequence[BoxMap], results: Mapping[tuple[str, str], PlanResult], names: Sequence[str]
) -> Figure:
    """
    Return the trees and paths of planners on maps: a row a map, a column a planner.

    Parameters
    ----------
    results : mapping
        By name of the map and of the planner.
    names : sequence of str
        Of the planners.

    """
    figure = Figure(
        figsize=(2.75 * len(names), 2.95 * len(maps) + 0.5), layout='constrained', dpi=100
    )
    grid = figure.subplots(len(maps), len(names), squeeze=False)
    for row, box_map in zip(grid, maps, strict=True):
        for axes, name in zip(row, names, strict=True):
            result = results[box_map.name, name]
            draw_map(axes, box_map)
            for tree in result.trees:
                draw_tree(axes, tree)
            if result.raw_path is not None and name.startswith('RRT-H'):
                draw_path(axes, result.raw_path.waypoints, FIRST, 1.4)
            note = 'no path'
            if result.path is not None:
                draw_path(axes, result.path.waypoints, FINAL, 2.2)
                note = f'cost {result.path.length:.1f}'
            draw_ends(axes, box_map)
            axes.set_title(f'{name}\n{note}, {result.n_samples} P_random', fontsize=9)
        row[0].set_ylabel(box_map.name.replace('_', ' '), fontsize=11, fontweight='bold')
    _legend(figure, ('tree', TREE), ("RRT-H's path before shortening", FIRST), ('path', FINAL))
    return figure


def escape_figure(
    box_map: BoxMap,
    with_club: Sequence[Array | None],
    without: Sequence[Array | None],
    shares: Mapping[str, Sequence[float]],
) -> Figure:
    """
    Return what the escape does: paths of growths with a path club and without, and its success.

    Parameters
    ----------
    with_club, without : sequence of ndarray, shape (n, 2), or None
        First paths of successive growths, before shortening [map units].
    shares : mapping
        By label, the share of runs that have found both homotopy classes after 1, 2, ... growths.

    """
    figure = Figure(figsize=(12.5, 4.6), layout='constrained', dpi=100)
    left, middle, right = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.15))
    for axes, growths, title in (
        (left, with_club, 'growths that avoid the path club'),
        (middle, without, 'growths without a club'),
    ):
        draw_map(axes, box_map)
        paths = [path for path in growths if path is not None]
        for i, path in enumerate(paths):
            shade = i / max(1, len(paths) - 1)
            draw_path(axes, path, (0.76, 0.1 + 0.6 * shade, 0.36 - 0.26 * shade), 1.6)
        draw_ends(axes, box_map)
        n_above = sum(goes_over_the_top(path) for path in paths)
        axes.set_title(
            f'{len(growths)} {title}:\n{len(paths)} paths, {n_above} over the top', fontsize=10
        )
    for (label, values), colour, mark in zip(
        shares.items(), (FINAL, GOAL), ('o', 's'), strict=False
    ):
        n = np.arange(1, len(values) + 1)
        right.plot(n, 100 * np.array(values), marker=mark, color=colour, lw=2, label=label)
    left.set_xlabel('from the first growth (red) to the last (yellow)')
    right.set_xlabel('growths')
    right.set_ylabel('runs that have found both ways round [%]')
    right.set_ylim(-2.0, 103.0)
    right.grid(color=GRID)
    right.legend(frameon=False, loc='center right')
    return figure


def draw_map(axes: Any, box_map: BoxMap) -> None:
    """Draw the frame and the walls of a map in the plane."""
    (x0, y0), (x1, y1) = box_map.bounds
    for lower, upper in box_map.obstacles:
        axes.add_patch(Rectangle(lower, *(upper - lower), color=WALL, lw=0, zorder=2))
    margin = 0.01 * (x1 - x0)
    axes.set(xlim=(x0 - margin, x1 + margin), ylim=(y0 - margin, y1 + margin), aspect='equal')
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_color(FRAME)


def draw_tree(axes: Any, tree: Tree) -> None:
    """Draw the edges of a tree."""
    children = np.flatnonzero(tree.parents >= 0)
    edges = np.stack([tree.nodes[tree.parents[children]], tree.nodes[children]], axis=1)
    axes.add_collection(LineCollection(list(edges), colors=TREE, linewidths=0.5, zorder=1))


def draw_path(axes: Any, waypoints: Array, colour: Any, width: float) -> None:
    """Draw a path, shape (n, 2)."""
    axes.plot(*waypoints.T, color=colour, lw=width, zorder=3, solid_joinstyle='round')


def draw_ends(axes: Any, box_map: BoxMap) -> None:
    """Draw start and goal."""
    for q, colour, mark in ((box_map.start, START, 'o'), (box_map.goal, GOAL, '*')):
        size = 7 if mark == 'o' else 12
        axes.plot(*q, ls='', marker=mark, ms=size, color=colour, mec='white', zorder=4)


def _legend(figure: Figure, *entries: tuple[str, str]) -> None:
    axes: Any = figure.axes[0]
    for label, colour in entries:
        axes.plot([], [], color=colour, lw=2, label=label)
    for label, colour, mark in (('start', START, 'o'), ('goal', GOAL, '*')):
        axes.plot([], [], ls='', marker=mark, color=colour, ms=9, label=label)
    n = len(entries) + 2
    figure.legend(loc='outside lower center', ncols=n, frameon=False, fontsize=9)
