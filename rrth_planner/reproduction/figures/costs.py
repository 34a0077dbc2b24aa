# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of what many runs cost, as the paper's Figures 10, 11 and 12."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
import numpy as np
from rrth_planner.io.map_file import load_map
from rrth_planner.model.arrays import Array
from rrth_planner.planning.visibility_graph import shortest_path
from rrth_planner.reproduction.experiments import FIVE, RRT, RRT_H
from rrth_planner.reproduction.statistics import histories_on, quartiles, Rows

COLOURS = dict(zip(FIVE, ('#7a828c', '#1b6ca8', '#2f9e6e', '#c98a1b', '#c2185b'), strict=True))
EXACT, GRID = '#30343b', '#e4e6ea'
DRAWS, TIME = 'draws', 'time'
N_BINS = 36


def convergence_figure(rows: Rows, maps: Sequence[str], axis: str, n: int) -> Figure:
    """
    Return the cost of the best path against draws or time, medians and quartiles over runs.

    RRT and RRT-H stop at their first path: a point each, joined to the result of shortening.

    Parameters
    ----------
    rows : Rows
    maps : sequence of str
        Each has its own axes.
    axis : str
        DRAWS or TIME.
    n : int
        Seeds below this.

    """
    figure = Figure(figsize=(4.9 * len(maps), 4.3), layout='constrained', dpi=100)
    for axes, problem in zip(figure.subplots(1, len(maps), squeeze=False)[0], maps, strict=True):
        some = rows.where(problem=problem, below=n)
        exact = shortest_path(load_map(problem))[0]
        absent = [name for name in FIVE if not some.where(algorithm=name).n_solved()]
        for name in FIVE:
            if name in absent:
                continue
            if name in (RRT, RRT_H):
                _draw_first_path(axes, some.where(algorithm=name), name, axis)
            else:
                _draw_history(axes, some.where(algorithm=name), name, axis)
        axes.axhline(exact, color=EXACT, lw=1.0, ls=(0, (5, 3)), label='exact shortest')
        costs = some.where(algorithm=RRT).values('cost_final')
        top = np.percentile(costs, 80) if len(costs) else 2.0 * exact
        axes.set_ylim(exact - 0.06 * (top - exact), 1.04 * top)
        axes.set_title(problem.replace('_', ' '), fontsize=11, fontweight='bold', loc='left')
        if axis == TIME:
            axes.set_xscale('log')
            axes.xaxis.set_major_formatter('{x:g}')
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.set_xlabel('time [ms]')
        else:
            axes.set_xlim(left=0)
            axes.set_xlabel('number of P_random')
        axes.set_ylabel('cost of the best path')
        _plain(axes)
        if absent:
            note = 'no path in 2,000 steps:\n' + '\n'.join(absent)
            axes.text(0.05, 0.3, note, transform=axes.transAxes, fontsize=9, color=EXACT)
    _shared_legend(figure)
    return figure


def _draw_history(axes: Any, rows: Rows, name: str, axis: str) -> None:
    """Draw how the cost falls: the median as a line, the quartiles as a band."""
    if axis == DRAWS:
        grid = np.linspace(0.0, rows.values('draws_total').max(), 400)
        shown, column = grid, 'history_draws'
    else:
        first, last = rows.values('time_first').min(), np.median(rows.values('time_total'))
        grid = np.geomspace(first, last, 400)
        shown, column = 1e3 * grid, 'history_time'
    low, middle, high = quartiles(histories_on(rows, column, grid))
    is_drawn = np.isfinite(low) & np.isfinite(high)
    band = {'color': COLOURS[name], 'alpha': 0.18, 'lw': 0}
    axes.fill_between(shown, low, high, where=is_drawn, **band)
    axes.plot(shown, middle, color=COLOURS[name], lw=2.0, label=name)


def _draw_first_path(axes: Any, rows: Rows, name: str, axis: str) -> None:
    """Draw the one path: median and quartiles of when it came and of its cost."""
    column, unit = ('draws_first', 1.0) if axis == DRAWS else ('time_first', 1e3)
    at, cost = unit * rows.values(column), rows.values('cost_final')
    x, y = np.percentile(at, [25, 50, 75]), np.percentile(cost, [25, 50, 75])
    axes.errorbar(
        x[1],
        y[1],
        xerr=[[x[1] - x[0]], [x[2] - x[1]]],
        yerr=[[y[1] - y[0]], [y[2] - y[1]]],
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
        exact = shortest_path(load_map(problem))[0]
        costs, times = {}, {}
        for name in FIVE:
            some = rows.where(problem=problem, algorithm=name, below=n)
            costs[name] = 100.0 * (some.values('cost_final') / exact - 1.0)
            times[name] = 1e3 * some.values('time_total')
        _draw_strips(grid[0, k], costs)
        _draw_strips(grid[1, k], times)
        grid[0, k].set_title(problem.replace('_', ' '), fontsize=11, fontweight='bold', loc='left')
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
        axes.stairs(
            level + 0.85 * counts / counts.max(),
            bins,
            baseline=level,
            fill=True,
            color=COLOURS[name],
            alpha=0.85,
        )
        axes.plot(np.median(clipped), level + 0.06, marker='^', ms=6, color=EXACT, zorder=5)
    axes.set(ylim=(-0.1, len(FIVE)), xlim=(bins[0], bins[-1]), xscale='log')
    axes.xaxis.set_major_formatter('{x:g}')
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100 * low else (1.0,)))
    axes.set_yticks(np.arange(len(FIVE)) + 0.3, FIVE[::-1])
    axes.tick_params(axis='y', length=0)
    _plain(axes)


def _plain(axes: Any) -> None:
    axes.grid(color=GRID, lw=0.8)
    axes.set_axisbelow(True)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)


def _shared_legend(figure: Figure) -> None:
    found: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    labels = [name for name in (*FIVE, 'exact shortest') if name in found]
    figure.legend(
        [found[label] for label in labels],
        labels,
        loc='outside lower center',
        ncols=3 if len(figure.axes) == 1 else len(labels),
        frameon=False,
    )
