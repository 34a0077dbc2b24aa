# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of what many runs cost, as the paper's Figures 10, 11 and 12."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.reproduction.experiments import FIVE, RRT, RRT_H
from rrth_planner.reproduction.problems import exact_length
from rrth_planner.reproduction.statistics import histories_on, quartiles, Rows
from rrth_planner.visualization.motion_figure import plain

COLOURS = dict(zip(FIVE, ('#7a828c', '#1b6ca8', '#2f9e6e', '#c98a1b', '#c2185b'), strict=True))
EXACT = '#30343b'
DRAWS, TIME = 'draws', 'time'
# What a column of these is multiplied by on an axis, which shows milliseconds.
UNITS = {DRAWS: 1.0, TIME: 1e3}
N_BINS = 36


def convergence_figure(rows: Rows, maps: Sequence[str], axis: str, n: int) -> Figure:
    """
    Return the cost of the best path against DRAWS or TIME, medians and quartiles over n runs.

    RRT and RRT-H stop at their first path: a point each, joined to the result of shortening.
    """
    figure = Figure(figsize=(4.9 * len(maps), 4.3), layout='constrained', dpi=100)
    for axes, problem in zip(figure.subplots(1, len(maps), squeeze=False)[0], maps, strict=True):
        some = rows.where(problem=problem, below=n)
        exact = exact_length(problem)
        absent = []
        for name in FIVE:
            mine = some.where(algorithm=name)
            if not mine.n_solved():
                absent.append(name)
            elif name in (RRT, RRT_H):
                _draw_first_path(axes, mine, name, axis)
            else:
                _draw_history(axes, mine, name, axis)
        axes.axhline(exact, color=EXACT, lw=1.0, ls=(0, (5, 3)), label='exact shortest')
        costs = some.where(algorithm=RRT).values('cost_final')
        top = np.percentile(costs, 80) if len(costs) else 2.0 * exact
        axes.set_ylim(exact - 0.06 * (top - exact), 1.04 * top)
        _entitle(axes, problem)
        if axis == TIME:
            _scale_by_logarithm(axes, (1.0, 2.0, 5.0))
            axes.set_xlabel('time [ms]')
        else:
            axes.set_xlim(left=0)
            axes.set_xlabel('number of P_random')
        axes.set_ylabel('cost of the best path')
        plain(axes)
        if absent:
            note = 'no path in 2,000 steps:\n' + '\n'.join(absent)
            axes.text(0.05, 0.3, note, transform=axes.transAxes, fontsize=9, color=EXACT)
    _shared_legend(figure)
    return figure


def _draw_history(axes: Any, rows: Rows, name: str, axis: str) -> None:
    """Draw how the cost falls: the median as a line, the quartiles as a band."""
    if axis == DRAWS:
        grid = np.linspace(0.0, rows.values('draws_total').max(), 400)
    else:
        first, last = rows.values('time_first').min(), np.median(rows.values('time_total'))
        grid = np.geomspace(first, last, 400)
    low, middle, high = quartiles(histories_on(rows, f'history_{axis}', grid))
    shown = UNITS[axis] * grid
    is_drawn = np.isfinite(low) & np.isfinite(high)
    band = {'color': COLOURS[name], 'alpha': 0.18, 'lw': 0}
    axes.fill_between(shown, low, high, where=is_drawn, **band)
    axes.plot(shown, middle, color=COLOURS[name], lw=2.0, label=name)


def _draw_first_path(axes: Any, rows: Rows, name: str, axis: str) -> None:
    """Draw the one path: median and quartiles of when it came and of its cost."""
    at, cost = UNITS[axis] * rows.values(f'{axis}_first'), rows.values('cost_final')
    x, y = (np.percentile(values, [25, 50, 75]) for values in (at, cost))
    axes.errorbar(
        x[1],
        y[1],
        xerr=np.diff(x)[:, None],
        yerr=np.diff(y)[:, None],
        marker='s' if name == RRT_H else 'o',
        ms=8,
        color=COLOURS[name],
        mec='white',
        capsize=3,
        ls='',
        zorder=5,
        label=name,
    )
    if name == RRT_H:
        raw = float(np.median(rows.values('cost_first')))
        axes.annotate(
            '',
            (x[1], y[1]),
            (x[1], raw),
            arrowprops={'arrowstyle': '->', 'color': COLOURS[name], 'ls': ':', 'lw': 1.4},
            zorder=4,
        )


def histogram_figure(rows: Rows, maps: Sequence[str], n: int) -> Figure:
    """Return histograms of cost and of time, a column a map, a strip a planner."""
    figure = Figure(figsize=(4.7 * len(maps), 7.0), layout='constrained', dpi=100)
    grid = figure.subplots(2, len(maps), squeeze=False, sharey=True)
    for k, problem in enumerate(maps):
        exact = exact_length(problem)
        costs, times = {}, {}
        for name in FIVE:
            some = rows.where(problem=problem, algorithm=name, below=n)
            costs[name] = 100.0 * (some.values('cost_final') / exact - 1.0)
            times[name] = 1e3 * some.values('time_total')
        _draw_strips(grid[0, k], costs)
        _draw_strips(grid[1, k], times)
        _entitle(grid[0, k], problem)
        grid[0, k].set_xlabel(f'final cost above the exact shortest, {exact:.1f} [%]')
        grid[1, k].set_xlabel('computing time [ms]')
    return figure


def _draw_strips(axes: Any, values: Mapping[str, Array]) -> None:
    """Draw a histogram for each planner, one above the other, all of the same height."""
    everything = np.concatenate(list(values.values()))
    # What is a thousandth of a per cent over the shortest is the shortest.
    low, high = max(everything.min(), 1e-3), everything.max()
    bins = np.geomspace(low / 1.15, high * 1.15, N_BINS)
    for level, name in enumerate(FIVE[::-1]):
        if not len(values[name]):
            middle = np.sqrt(bins[0] * bins[-1])
            axes.text(middle, level + 0.3, 'no path', ha='center', fontsize=9, color=EXACT)
            continue
        clipped = np.maximum(values[name], low)
        counts = np.histogram(clipped, bins)[0]
        heights, style = level + 0.85 * counts / counts.max(), {'fill': True, 'alpha': 0.85}
        axes.stairs(heights, bins, baseline=level, color=COLOURS[name], **style)
        axes.plot(np.median(clipped), level + 0.06, marker='^', ms=6, color=EXACT, zorder=5)
    axes.set(ylim=(-0.1, len(FIVE)), xlim=(bins[0], bins[-1]))
    _scale_by_logarithm(axes, (1.0, 2.0, 5.0) if high < 100 * low else (1.0,))
    axes.set_yticks(np.arange(len(FIVE)) + 0.3, FIVE[::-1])
    axes.tick_params(axis='y', length=0)
    plain(axes)


def _entitle(axes: Any, problem: str) -> None:
    axes.set_title(problem.replace('_', ' '), fontsize=11, fontweight='bold', loc='left')


def _scale_by_logarithm(axes: Any, labelled: Sequence[float]) -> None:
    """Make the horizontal axis logarithmic, with some digits labelled in each decade."""
    axes.set_xscale('log')
    axes.xaxis.set_major_formatter('{x:g}')
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(LogLocator(subs=labelled))


def _shared_legend(figure: Figure) -> None:
    found: dict[str, Any] = {}
    for axes in figure.axes[::-1]:
        handles, labels = axes.get_legend_handles_labels()
        found |= zip(labels, handles, strict=True)
    labels = [name for name in (*FIVE, 'exact shortest') if name in found]
    lines = [found[label] for label in labels]
    n_columns = 3 if len(figure.axes) == 1 else len(labels)
    figure.legend(lines, labels, loc='outside lower center', ncols=n_columns, frameon=False)
