# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of the arm's plans by RRT and RRT-H, as the paper's Figures 20 and 21."""

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.planning.planner import plan
from rrth_planner.reproduction.experiments import ARM_ALGORITHMS, RRT, RRT_H
from rrth_planner.reproduction.problems import CERTIFIED, load_problem, RAY, TARGETS
from rrth_planner.reproduction.statistics import Rows
from rrth_planner.visualization.arm_view import draw_motion
from rrth_planner.visualization.motion_figure import joint_colour, plain
from rrth_planner.visualization.viewer.examples import example_body

Pair = tuple[Path, Path]


def median_paths(rows: Rows, target: str) -> Pair:
    """Return the paths of RRT and RRT-H of the seed whose RRT path is of median length [rad]."""
    name = f'arm/{target}'
    some = rows.where(problem=name, algorithm=RRT, collision=CERTIFIED)
    costs = some.aligned('cost_final')
    seed = some.rows[int(np.argsort(costs)[(len(costs) - 1) // 2])]['seed']
    rrt, rrt_h = (
        plan(load_problem(name).problem, options, np.random.default_rng(seed)).path
        for options in ARM_ALGORITHMS.values()
    )
    assert rrt is not None and rrt_h is not None
    return rrt, rrt_h


def joint_paths_figure(pairs: Mapping[str, Pair]) -> Figure:
    """Return the joints along the paths to each target, by its name: RRT thin, RRT-H thick."""
    n_columns = min(4, len(pairs))
    n_rows = -(-len(pairs) // n_columns)
    figure = Figure(figsize=(3.6 * n_columns, 3.0 * n_rows + 0.5), layout='constrained', dpi=100)
    grid = figure.subplots(n_rows, n_columns, squeeze=False, sharey=True)
    handles: dict[str, Any] = {}
    for axes in grid.flat[len(pairs) :]:
        axes.set_visible(False)
    for k, (axes, (target, pair)) in enumerate(zip(grid.flat, pairs.items(), strict=False)):
        for name, path in zip(ARM_ALGORITHMS, pair, strict=True):
            along = _distances(path.waypoints)
            for j, values in enumerate(path.waypoints.T):
                (handle,) = axes.plot(
                    along,
                    values,
                    color=joint_colour(j),
                    lw=2.4 if name == RRT_H else 0.9,
                    ls='-' if name == RRT_H else (0, (4, 1.5)),
                )
                handles[f'joint {j + 1}, {name}'] = handle
        lengths = [path.length for path in pair]
        axes.set_title(
            f'{target.replace("_", " ")}\n{lengths[0]:.1f} rad to {lengths[1]:.1f} rad',
            fontsize=9.5,
        )
        plain(axes)
        if k >= len(pairs) - n_columns:
            axes.set_xlabel('length along the path [rad]')
        if k % n_columns == 0:
            axes.set_ylabel('position [rad]')
    labels, lines = zip(*sorted(handles.items()), strict=True)
    figure.legend(lines, labels, loc='outside lower center', ncols=4, frameon=False, fontsize=9)
    return figure


def motions_figure(pairs: Mapping[str, Pair]) -> Figure:
    """Return the arm's motion round its wearer, a row a target: left RRT, right RRT-H."""
    arm, scene = load_arm(), example_body('body')
    figure = Figure(figsize=(12.0, 4.9 * len(pairs)), dpi=80)
    for row, (target, pair) in enumerate(pairs.items()):
        for column, (name, path) in enumerate(zip(ARM_ALGORITHMS, pair, strict=True)):
            height = 1.0 / len(pairs)
            axes: Any = figure.add_axes(
                (0.5 * column + 0.04, 1.0 - (row + 0.9) * height, 0.41, 0.78 * height),
                projection='3d',
            )
            draw_motion(axes, arm, scene, _unhurried(path), np.array(TARGETS[target]), RAY)
            axes.set_title(
                f'{name}, {target.replace("_", " ")}: {path.length:.1f} rad', fontsize=11, y=1.08
            )
    return figure


def _unhurried(path: Path) -> Trajectory:
    """Return a motion along a path that rests at each waypoint: a straight line stays one."""
    times = _distances(path.waypoints)
    # A waypoint on the one before it takes no time, and times must increase.
    keep = np.concatenate([[True], np.diff(times) > 1e-9])
    q = path.waypoints[keep]
    still = np.zeros_like(q)
    return Trajectory(times=times[keep], positions=q, velocities=still, accelerations=still)


def _distances(waypoints: Array) -> Array:
    steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])
