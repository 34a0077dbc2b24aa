# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of timed motions: one in full, and how all compare with stopping and with toppra."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np
from rrth_planner.io.replaced_file import replace_file
from rrth_planner.model.trajectory import MotionLimits, Trajectory

from benchmarks.common.controller_curve import curve_of, derivative, instants
from benchmarks.common.task import Row
from benchmarks.motions.table import OPTIMUM, ratios, STOPPING, with_corners

# Corners that the motion in the picture shall have.
SHOWN = 3
LABELS = ('position [rad]', 'velocity [rad/s]', 'acceleration [rad/s²]', 'jerk [rad/s³]')
COLOURS = ('tab:blue', 'tab:orange', 'tab:green', 'tab:red', 'tab:purple', 'tab:brown')


def draw_figures(rows: Sequence[Row], limits: MotionLimits, folder: Path) -> dict[str, str]:
    """Draw what there are motions for; return the file names by caption."""
    bent = with_corners(rows)
    figures: dict[str, tuple[str, Figure]] = {}
    rounded = [row for row in bent if not row['is_stopping'] and row['times']]
    if rounded:
        shown = min(rounded, key=lambda row: abs(row['n_corners'] - row['n_stops'] - SHOWN))
        caption = f'A motion round {shown["n_corners"]} corners, within its limits (dashed)'
        figures[caption] = 'motion.png', motion_figure(_trajectory(shown), limits)
        caption = 'Duration against stopping at each corner'
        figures[caption] = 'stopping.png', stopping_figure(bent)
    if any(row['duration_toppra'] for row in rows):
        figures["Duration over toppra's, without a limit of jerk"] = (
            'toppra.png',
            toppra_figure(rows),
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.values():
        replace_file(
            folder / name,
            lambda path, figure=figure: figure.savefig(path, dpi=130, format='png'),
        )
    return {caption: name for caption, (name, _) in figures.items()}


def _trajectory(row: Row) -> Trajectory:
    names = ('times', 'positions', 'velocities', 'accelerations')
    return Trajectory(**{name: row[name] for name in names})


def motion_figure(trajectory: Trajectory, limits: MotionLimits) -> Figure:
    """Return position, velocity, acceleration and jerk of the controller's curve, a row each."""
    curve = curve_of(trajectory)
    places = instants(curve, 1e-3)
    figure = Figure(figsize=(8.0, 9.0), layout='constrained')
    panels = figure.subplots(4, 1, sharex=True)
    bounds = (None, limits.velocity, limits.acceleration, limits.jerk)
    for order, (panel, label, bound) in enumerate(zip(panels, LABELS, bounds, strict=True)):
        for joint, values in enumerate(derivative(curve, places, order).T):
            colour = COLOURS[joint % len(COLOURS)]
            panel.plot(
                places.times, values, color=colour, linewidth=1.2, label=f'joint {joint + 1}'
            )
            if bound is not None:
                # One for all is nobody's own.
                shown = 'grey' if (bound == bound[0]).all() else colour
                for side in (-bound[joint], bound[joint]):
                    panel.axhline(side, color=shown, linewidth=0.9, linestyle='--')
        _clean(panel)
        panel.set_ylabel(label)
    panels[0].plot(
        np.repeat(trajectory.times, trajectory.positions.shape[1]),
        trajectory.positions.ravel(),
        linestyle='none',
        marker='.',
        markersize=3,
        color='black',
        label='points of the message',
    )
    panels[-1].set_xlabel('time [s]')
    panels[-1].set_xlim(0.0, trajectory.duration)
    figure.legend(*panels[0].get_legend_handles_labels(), loc='outside upper center', ncols=5)
    return figure


def stopping_figure(bent: Sequence[Row]) -> Figure:
    """Return the duration of each motion with corners beside that of stopping at each."""
    figure = Figure(figsize=(5.5, 5.0), layout='constrained')
    panel = figure.subplots()
    pairs = np.array([(row['duration_stopping'], row['duration']) for row in bent])
    dots = panel.scatter(
        *pairs.T, c=[row['n_corners'] for row in bent], cmap='viridis', s=14, linewidths=0.0
    )
    top = 1.05 * pairs.max()
    for share, style in ((1.0, '-'), (STOPPING, '--')):
        panel.plot(
            [0, top],
            [0, share * top],
            color='grey',
            linewidth=0.9,
            linestyle=style,
            label=f'{100 * share:.0f} %',
        )
    figure.colorbar(dots, label='corners', ticks=MaxNLocator(integer=True))
    panel.set(
        xlim=(0, top), ylim=(0, top), xlabel='stopping at each corner [s]', ylabel='duration [s]'
    )
    panel.legend(frameon=False, loc='upper left')
    _clean(panel)
    return figure


def toppra_figure(rows: Sequence[Row]) -> Figure:
    """Return how the durations over toppra's are spread."""
    figure = Figure(figsize=(6.5, 3.6), layout='constrained')
    panel = figure.subplots()
    straight = [row for row in rows if row['is_solved'] and row['n_corners'] == 0]
    groups = {'with corners': with_corners(rows), 'straight': straight}
    values = {
        f'{name}, mean {found.mean():.4f}': found
        for name, group in groups.items()
        if len(found := ratios(group, 'duration_unlimited', 'duration_toppra'))
    }
    every = np.concatenate(list(values.values()))
    bins = np.linspace(min(0.999, every.min()), max(1.001, every.max()), 61)
    for label, found in values.items():
        panel.hist(found, bins, histtype='stepfilled', alpha=0.6, label=label)
    panel.axvline(OPTIMUM, color='grey', linewidth=0.9, linestyle='--', label='target of the mean')
    panel.set(xlabel="duration over toppra's [-]", ylabel='motions', yscale='log')
    panel.legend(frameon=False)
    _clean(panel)
    return figure


def _clean(panel: Any) -> None:
    panel.spines[['top', 'right']].set_visible(False)
    panel.grid(alpha=0.25, linewidth=0.6)
