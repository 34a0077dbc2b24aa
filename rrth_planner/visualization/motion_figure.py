# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of motions: the arm round its wearer, and what the joints do, a row a motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.joint_range import turns_near
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, sample, Trajectory
from rrth_planner.visualization.arm_view import draw_motion, SHAPE
from rrth_planner.visualization.separation_view import draw_instant, draw_spans, Instant, Span

JOINT_COLOURS = ('#1b6ca8', '#d1495b', '#2f9e6e', '#c98a1b', '#7a4fa3', '#4c5560')
LIMIT, GRID, DASHES = '#30343b', '#e4e6ea', (0, (5, 3))
# Of a motion, and of what was seen beside a person [inch].
ROW_SIZE = (13.0, 5.4)
TIME_STEP = 0.005
LEGEND: dict[str, Any] = {'fontsize': 8, 'frameon': False, 'columnspacing': 1.2}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Motion:
    """One motion to a labelled target, (3,) in the base frame [m]; the caption may be empty."""

    label: str
    trajectory: Trajectory
    target: Array
    caption: str = ''


def motion_figure(
    arm: ArmModel,
    scene: Scene,
    motions: Sequence[Motion],
    limits: MotionLimits,
    ray_guard_length: float,
    beside: tuple[Instant, list[Span]] | None = None,
) -> Figure:
    """
    Return a figure of motions, a row each: left the arm on its wearer, right the joints' curves.

    Parameters
    ----------
    limits : MotionLimits
        Drawn as dashed lines, in the colours of the joints.
    ray_guard_length : float
        How much of the pointing ray stays clear in motion [m].
    beside : (Instant, list of Span), optional
        What was seen beside a wearer who moves: an instant, and how fast the arm was; drawn below.

    """
    n = len(motions) + (beside is not None)
    figure = Figure(figsize=(ROW_SIZE[0], ROW_SIZE[1] * n), facecolor='white')
    FigureCanvasAgg(figure)
    height = figure.get_figheight()
    rows = figure.add_gridspec(
        n,
        2,
        width_ratios=(1.3, 1.0),
        left=0.0,
        right=0.985,
        top=1.0 - 0.75 / height,
        bottom=0.6 / height,
        wspace=0.1,
        hspace=0.3,
    )
    key = 'blue: start    red: goal    violet: path of the tool    thin: pointing ray'
    figure.text(0.03, 1.0 - 0.32 / height, key, fontsize=9, color=LIMIT)
    for row, motion in enumerate(motions):
        view = figure.add_subplot(rows[row, 0], projection='3d')
        draw_motion(view, arm, scene, motion.trajectory, motion.target, ray_guard_length)
        curves = rows[row, 1].subgridspec(2, 1, height_ratios=(1.15, 1.0), hspace=0.12)
        panels: Any = curves.subplots(sharex=True)
        position, velocity = panels
        _draw_curves(position, velocity, arm, motion.trajectory, limits)
        title = f'Pointing at "{motion.label}"\n{motion.caption}'.rstrip()
        position.set_title(title, loc='left', fontsize=11, fontweight='bold')
    if beside is not None:
        instant, spans = beside
        view = figure.add_subplot(rows[-1, 0], projection='3d')
        draw_instant(view, arm, instant, ray_guard_length, SHAPE)
        explained = 'orange: how far the nearest parts may get before the arm is at rest'
        view.set_title(explained, fontsize=9, color=LIMIT, y=1.04)
        rate = figure.add_subplot(rows[-1, 1])
        draw_spans(rate, spans)
        title = (
            'Beside a person at work: how fast the arm may go on,\n'
            f'and which part slows it; left at {instant.time:.1f} s'
        )
        rate.set_title(title, loc='left', fontsize=11, fontweight='bold')
        plain(rate)
    return figure


def _draw_curves(
    position: Axes, velocity: Axes, arm: ArmModel, trajectory: Trajectory, limits: MotionLimits
) -> None:
    duration = trajectory.duration
    times = np.linspace(0.0, duration, max(2, int(duration / TIME_STEP) + 1))
    q, v, _ = sample(trajectory, times)
    for i, name in enumerate(arm.joint_names):
        colour = joint_colour(i)
        position.plot(times, q[:, i], color=colour, lw=2.0, label=name.replace('_', ' '))
        velocity.plot(times, v[:, i], color=colour, lw=2.0)
    position.plot([], [], color=LIMIT, lw=1.0, ls=DASHES, label='limits')
    draw_limits(position, arm.bounds)
    draw_limits(velocity, np.stack([-limits.velocity, limits.velocity]))
    velocity.set_xlabel('time [s]')
    explain_joints(position, velocity, arm)
    # Of the limits of a continuous joint those that are near.
    near = np.concatenate([turns_near(arm, arm.bounds, q.mean(axis=0), 1), q])
    low, high = float(near.min()), float(near.max())
    position.set_ylim(low - 0.22 * (high - low), high + 0.08 * (high - low))
    fastest = 1.15 * float(limits.velocity.max())
    velocity.set_ylim(-fastest, fastest)
    for axes in (position, velocity):
        axes.set_xlim(0.0, max(duration, TIME_STEP))
        plain(axes)


def joint_colour(joint: int) -> str:
    """Return the colour of a joint, from 0."""
    return JOINT_COLOURS[joint % len(JOINT_COLOURS)]


def plain(axes: Any) -> None:
    """Give axes a pale grid behind their curves, and no frame at the top and the right."""
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    axes.spines[['top', 'right']].set_visible(False)


def explain_joints(position: Axes, velocity: Axes, arm: ArmModel) -> None:
    """Write what the curves of the joints show: units, and a legend of the labelled ones."""
    unit = 'rad' if not any(arm.is_prismatic) else 'rad or m'
    position.set_ylabel(f'position [{unit}]')
    velocity.set_ylabel(f'velocity [{unit}/s]'.replace('rad or m/s', 'rad/s or m/s'))
    labels = position.get_legend_handles_labels()[1]
    position.legend(loc='lower left', ncols=len(labels), handlelength=1.4, **LEGEND)


def draw_limits(axes: Any, limits: Array) -> None:
    """
    Draw each joint's limits in its colour, dash by dash where several have it, grey where all do.

    Parameters
    ----------
    limits : ndarray, shape (n, dof)
        A row a limit, such as the lower and the upper ones.

    """
    rounded, dof = np.round(limits, 6), limits.shape[1]
    on, off = DASHES[1]
    for value in np.unique(rounded):
        joints = np.flatnonzero((rounded == value).any(axis=0))
        if len(joints) == dof:
            axes.axhline(float(value), color=LIMIT, lw=1.0, ls=DASHES, alpha=0.75)
            continue
        gap = (on + off) * len(joints) - on
        for turn, joint in enumerate(joints):
            style = (turn * (on + off), (on, gap))
            axes.axhline(float(value), color=joint_colour(int(joint)), lw=1.2, ls=style, alpha=0.9)
