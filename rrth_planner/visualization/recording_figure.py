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
from rrth_planner.visualization.arm_view import (
    draw_configurations,
    N_DRAWN,
    ray_of,
    STOP,
)
from rrth_planner.visualization.motion_figure import (
    DASHES,
    draw_limits,
    explain_joints,
    joint_colour,
    LEGEND,
    LIMIT,
    plain,
    TIME_STEP,
)

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
    the monitor. Margin, limits and the length of the ray that must stay clear are of the settings.
    """
    figure = Figure(figsize=SIZE, facecolor='white')
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        1, 2, width_ratios=(1.0, 1.05), left=0.02, right=0.985, top=0.91, bottom=0.07, wspace=0.24
    )
    view = figure.add_subplot(grid[0], projection='3d')
    curves = grid[1].subgridspec(4, 1, height_ratios=(1.25, 1.0, 0.9, 0.16), hspace=0.13)
    panels: Any = curves.subplots(sharex=True)
    position, velocity, distance, monitor = panels
    begin, end = float(recording.times[0]), float(recording.times[-1])
    end = max(end, begin + TIME_STEP)
    position.set_xlim(begin, end)
    _draw_joints(position, velocity, recording, arm, settings)
    clearances = measured_clearances(recording, arm, settings.ray_guard_length)
    _draw_distance(distance, recording, clearances, settings.margin)
    _draw_monitor(monitor, recording)
    is_drawn = [begin <= motion.begin <= end for motion in recording.commanded]
    stops = [stop for stop in commanded_stops(recording) if begin <= stop.begin <= end]
    for axes in panels[:3]:
        plain(axes)
        for stop in stops:
            rest = stop.begin + stop.trajectory.duration
            axes.axvspan(stop.begin, rest, color=STOP, alpha=0.18, lw=0)
    caption = [_count(sum(is_drawn) - len(stops), 'motion'), _count(len(stops), 'stop')]
    if np.isfinite(clearances).any():
        caption.append(f'{1e3 * np.nanmin(clearances):.0f} mm least distance to the wearer')
    title += f'\n{", ".join(caption)}'
    position.set_title(title, loc='left', fontsize=11, fontweight='bold')
    q_stops = [stop.trajectory.positions[-1] for stop in stops]
    _draw_space(view, recording, arm, settings.ray_guard_length, q_stops, end)
    key = 'blue: start    red: end    violet: path of the tool    orange: stopped by the monitor'
    figure.text(0.03, 0.965, key, fontsize=9, color=LIMIT)
    return figure


def _count(n: int, what: str) -> str:
    return f'{n} {what}' if n == 1 else f'{n} {what}s'


def _draw_space(
    axes: Any,
    recording: Recording,
    arm: ArmModel,
    ray_guard_length: float,
    q_stops: Sequence[Array],
    end: float,
) -> None:
    q = recording.positions
    # The arm is at rest most of the time: drawn at equal steps of its path, not of time.
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))])
    scene = at(recording.bodies, end) or Scene(())
    target = at(recording.targets, end)
    first, last = tool_pose(arm, q[[0, -1]])
    begin, tip = ray_of(first, ray_guard_length)
    aim = ray_of(last, 1.0)
    if target is not None:
        aim[1] = target
    draw_configurations(
        axes,
        arm,
        scene,
        q[_equal_steps(path, N_DRAWN)],
        q[_equal_steps(path, N_DENSE)],
        target,
        ray_guard_length,
        q_stops,
        names=('start', 'end'),
        shape=VIEW_SHAPE,
        # A motion may be short: the first ray counts too.
        looked_at=np.array([tip, begin, *aim]),
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
    position: Axes, velocity: Axes, recording: Recording, arm: ArmModel, settings: PlanSettings
) -> None:
    begin, end = position.get_xlim()
    times = np.linspace(begin, end, int(min(20_000, 2 + (end - begin) / TIME_STEP)))
    q, v = commanded_at(recording, times)
    for i, name in enumerate(arm.joint_names):
        colour = joint_colour(i)
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
    draw_limits(velocity, np.stack([-settings.limits.velocity, settings.limits.velocity]))
    low, high = position.get_ylim()
    position.set_ylim(low - 0.2 * (high - low), high)
    explain_joints(position, velocity, arm)


def _draw_distance(axes: Axes, recording: Recording, clearances: Array, margin: float) -> None:
    begin, end = axes.get_xlim()
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
    if np.isfinite(clearances).any():
        least, most = np.nanmin(clearances), np.nanmax(clearances)
        axes.set_ylim(min(0.0, 1.1 * least), 1.2 * max(most, 0.05))
    changes = [time for time, _ in recording.bodies if begin <= time <= end]
    if 0 < len(changes) <= MOST_MARKS:
        above: Any = {'color': CLEARANCE, 'transform': axes.get_xaxis_transform()}
        axes.plot(changes, np.full(len(changes), 0.96), ls='', marker='v', **above)


def _draw_monitor(axes: Axes, recording: Recording) -> None:
    begin, end = axes.get_xlim()
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
        handlelength=1.0,
        borderpad=0.0,
        **LEGEND,
    )
