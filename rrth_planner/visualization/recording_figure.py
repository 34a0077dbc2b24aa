# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The figure of a recorded run: the arm as commanded and measured, and its clearance."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from rrth_planner.execution.recording import (
    at,
    commanded_at,
    commanded_stops,
    measured_clearances,
    Recording,
)
from rrth_planner.io.settings import PlanSettings
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.visualization.arm_view import arm_points, draw_configurations, N_DRAWN, STOP
from rrth_planner.visualization.motion_figure import (
    DASHES,
    draw_limits,
    JOINT_COLOURS,
    LIMIT,
    TIME_STEP,
)
from rrth_planner.visualization.occlusion import best_view

SIZE = (14.0, 8.6)
# Of the view of the arm: its width over its height.
VIEW_SHAPE = 0.94
# A longer time between two joint states is a gap in the recording [s].
GAP = 0.25
N_DENSE = 300
# Most changes of the body that are marked one by one.
MOST_MARKS = 40
MONITOR_COLOURS = {
    'no motion': '#dfe3e8',
    'monitoring': '#8cc5a3',
    'stopping': '#e07a2f',
    'holding': '#b5838d',
}
OTHER, CLEARANCE = '#c3b5d9', '#30506e'


def recording_figure(
    recording: Recording, arm: ArmModel, settings: PlanSettings, title: str
) -> Figure:
    """
    Return the figure of a run.

    Left, the motion of the arm with the wearer as at the end; right, over time, joint positions
    and velocities as commanded and as measured, the arm's distance to the wearer, and the state of
    the monitor.

    Parameters
    ----------
    recording : Recording
    arm : ArmModel
    settings : PlanSettings
        For the margin, the length of the ray that must stay clear, and the limits.
    title : str
        Title above the curves.

    """
    figure = Figure(figsize=SIZE, facecolor='white')
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        1, 2, width_ratios=(1.0, 1.05), left=0.02, right=0.985, top=0.91, bottom=0.07, wspace=0.24
    )
    view = figure.add_subplot(grid[0], projection='3d')
    curves = grid[1].subgridspec(4, 1, height_ratios=(1.25, 1.0, 0.9, 0.16), hspace=0.13)
    position = figure.add_subplot(curves[0])
    others = [figure.add_subplot(curves[i], sharex=position) for i in (1, 2, 3)]
    velocity, distance, monitor = others
    _draw_joints(position, velocity, recording, arm, settings)
    clearances = measured_clearances(recording, arm, settings.ray_guard_length)
    _draw_distance(distance, recording, clearances, settings.margin)
    _draw_monitor(monitor, recording)
    begin, end = _span(recording)
    stops = [stop for stop in commanded_stops(recording) if begin <= stop.begin <= end]
    for axes in (position, velocity, distance):
        axes.tick_params(labelbottom=False)
        axes.grid(color='#e4e6ea', lw=0.8)
        axes.set_axisbelow(True)
        for side in ('top', 'right'):
            axes.spines[side].set_visible(False)
        for stop in stops:
            rest = stop.begin + stop.trajectory.duration
            axes.axvspan(stop.begin, rest, color=STOP, alpha=0.18, lw=0)
    position.set_xlim(begin, end)
    position.set_title(
        f'{title}\n{_caption(recording, clearances, len(stops))}',
        loc='left',
        fontsize=11,
        fontweight='bold',
    )
    _draw_space(
        view,
        recording,
        arm,
        settings.ray_guard_length,
        [stop.trajectory.positions[-1] for stop in stops],
    )
    key = 'blue: start    red: end    violet: path of the tool    orange: stopped by the monitor'
    figure.text(0.03, 0.965, key, fontsize=9, color=LIMIT)
    return figure


def _span(recording: Recording) -> tuple[float, float]:
    begin, end = float(recording.times[0]), float(recording.times[-1])
    return begin, max(end, begin + TIME_STEP)


def _caption(recording: Recording, clearances: Array, n_stops: int) -> str:
    begin, end = _span(recording)
    n = sum(begin <= motion.begin <= end for motion in recording.commanded) - n_stops
    parts = [_count(n, 'motion'), _count(n_stops, 'stop')]
    known = clearances[np.isfinite(clearances)]
    if len(known):
        parts.append(f'{1e3 * float(known.min()):.0f} mm least distance to the wearer')
    return ', '.join(parts)


def _count(n: int, what: str) -> str:
    return f'{n} {what}' if n == 1 else f'{n} {what}s'


def _draw_space(
    axes: Any,
    recording: Recording,
    arm: ArmModel,
    ray_guard_length: float,
    q_stops: Sequence[Array],
) -> None:
    _, end = _span(recording)
    q = recording.positions
    # The arm is at rest most of the time: drawn at equal steps of its path, not of time.
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))])
    scene = at(recording.bodies, end) or Scene(())
    q_drawn, target = q[_equal_steps(path, N_DRAWN)], at(recording.targets, end)
    first, last = tool_pose(arm, q[[0, -1]])
    rays = [first[:3, 3] + ray_guard_length * first[:3, 2], first[:3, 3], last[:3, 3]]
    draw_configurations(
        axes,
        arm,
        scene,
        q_drawn,
        q[_equal_steps(path, N_DENSE)],
        target,
        ray_guard_length,
        q_stops,
        names=('start', 'end'),
        shape=VIEW_SHAPE,
        # A motion may be short: the first ray counts too.
        towards=best_view(
            scene,
            np.array([arm_points(arm, row) for row in q_drawn]),
            np.array([*rays, rays[-1] + last[:3, 2] if target is None else target]),
        ),
    )


def _equal_steps(path: Array, n: int) -> Any:
    """Return the indices of n instants at equal steps of a path length, (m,), ends included."""
    found = np.searchsorted(path, np.linspace(0.0, path[-1], n)).clip(0, len(path) - 1)
    found[0], found[-1] = 0, len(path) - 1
    return found


def _with_gaps(times: Array, values: Array) -> tuple[Array, Array]:
    """Return a curve, (n,) twice, that is interrupted where nothing was recorded."""
    after = np.flatnonzero(np.diff(times) > GAP) + 1
    return np.insert(times, after, np.nan), np.insert(values, after, np.nan)


def _draw_joints(
    position: Axes,
    velocity: Axes,
    recording: Recording,
    arm: ArmModel,
    settings: PlanSettings,
) -> None:
    begin, end = _span(recording)
    times = np.linspace(begin, end, int(min(20_000, 2 + (end - begin) / TIME_STEP)))
    q, v = commanded_at(recording, times)
    for i, name in enumerate(arm.joint_names):
        colour = JOINT_COLOURS[i % len(JOINT_COLOURS)]
        for axes, commanded, measured in (
            (position, q, recording.positions),
            (velocity, v, recording.velocities),
        ):
            axes.plot(times, commanded[:, i], color=colour, lw=5.0, alpha=0.3)
            label = name.replace('_', ' ') if axes is position else None
            axes.plot(
                *_with_gaps(recording.times, measured[:, i]), color=colour, lw=1.3, label=label
            )
    position.plot([], [], color=LIMIT, lw=5.0, alpha=0.3, label='commanded')
    position.plot([], [], color=LIMIT, lw=1.3, label='measured')
    unit = 'rad' if not any(arm.is_prismatic) else 'rad or m'
    position.set_ylabel(f'position [{unit}]')
    velocity.set_ylabel(f'velocity [{unit}/s]'.replace('rad or m/s', 'rad/s or m/s'))
    draw_limits(velocity, np.stack([-settings.limits.velocity, settings.limits.velocity]))
    low, high = position.get_ylim()
    position.set_ylim(low - 0.2 * (high - low), high)
    position.legend(
        loc='lower left',
        ncols=arm.dof + 2,
        fontsize=8,
        frameon=False,
        handlelength=1.4,
        columnspacing=1.2,
    )


def _draw_distance(axes: Axes, recording: Recording, clearances: Array, margin: float) -> None:
    begin, end = _span(recording)
    axes.plot(*_with_gaps(recording.times, clearances), color=CLEARANCE, lw=1.6)
    axes.axhline(margin, color=LIMIT, lw=1.0, ls=DASHES)
    axes.annotate(
        f'margin {margin:g} m',
        (0.0, margin),
        (4.0, 3.0),
        xycoords=('axes fraction', 'data'),
        textcoords='offset points',
        fontsize=8,
        color=LIMIT,
    )
    axes.set_ylabel('distance to\nthe wearer [m]')
    least = clearances[np.isfinite(clearances)]
    if len(least):
        axes.set_ylim(min(0.0, 1.1 * float(least.min())), 1.2 * max(float(least.max()), 0.05))
    changes = [time for time, _ in recording.bodies if begin <= time <= end]
    if 0 < len(changes) <= MOST_MARKS:
        axes.plot(
            changes,
            np.full(len(changes), 0.96),
            ls='',
            marker='v',
            color=CLEARANCE,
            transform=axes.get_xaxis_transform(),
        )


def _draw_monitor(axes: Axes, recording: Recording) -> None:
    begin, end = _span(recording)
    steps = [*recording.monitor_states, (end, '')]
    shown: dict[str, str] = {}
    for (since, state), (until, _) in pairwise(steps):
        left, right = max(since, begin), min(until, end)
        if left < right:
            colour = shown[state] = MONITOR_COLOURS.get(state, OTHER)
            axes.axvspan(left, right, color=colour, lw=0)
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    axes.set_ylabel('monitor', rotation=0, ha='right', va='center')
    axes.set_xlabel('time [s]', loc='left')
    handles = [axes.plot([], [], lw=6, color=colour)[0] for colour in shown.values()]
    handles += axes.plot([], [], ls='', marker='v', color=CLEARANCE)
    axes.legend(
        handles,
        [*shown, 'update of the wearer'],
        loc='upper right',
        bbox_to_anchor=(1.0, -0.95),
        ncols=len(handles),
        fontsize=8,
        frameon=False,
        handlelength=1.0,
        columnspacing=1.2,
        borderpad=0.0,
    )
