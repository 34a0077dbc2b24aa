# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of how the cost of each planner falls with time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from rrth_planner.io.replaced_file import replace_file
from rrth_planner.model.arrays import Array

from benchmarks.common.queries import MAPS, QUERIES
from benchmarks.common.task import Row
from benchmarks.planners.table import SOURCES

FAMILIES: Mapping[str, tuple[tuple[str, ...], str]] = {
    'maps': (MAPS, 'Maps: cost over the exact shortest'),
    'arm': (QUERIES, 'Arm, fixed goal: cost over the best known'),
}
# Times that are drawn [ms], and the least gap, which stands for less too [%].
GRID, LEAST, MOST = np.geomspace(0.02, 1000.0, 200), 0.01, 200.0
COLUMNS = 2
STYLES = (
    ('ours', 'RRT-H', 'tab:red'),
    ('ompl', 'RRTConnect, restarts', 'tab:blue'),
    ('ompl', 'AORRTC', 'tab:green'),
    ('ompl', 'BIT*', 'tab:orange'),
    ('ompl', 'Informed RRT*', 'tab:purple'),
    ('harness', 'RRTConnect, restarts', 'tab:cyan'),
    ('harness', 'BIT*', 'tab:brown'),
)


def draw_figures(rows: Sequence[Row], folder: Path) -> dict[str, str]:
    """Draw a picture for each family; return their file names by caption."""
    folder.mkdir(parents=True, exist_ok=True)
    names = {}
    for family, (problems, caption) in FAMILIES.items():
        figure = family_figure(rows, problems)
        name = f'cost_over_time_{family}.png'
        replace_file(
            folder / name,
            lambda path, figure=figure: figure.savefig(path, dpi=110, format='png'),
        )
        names[caption] = name
    return names


def family_figure(rows: Sequence[Row], problems: Sequence[str]) -> Figure:
    """Return a picture with a panel for each problem: median and the band from p10 to p90."""
    n_rows = -(-len(problems) // COLUMNS)
    figure = Figure(figsize=(10.0, 0.6 + 3.4 * n_rows), layout='constrained')
    panels = list(np.ravel(figure.subplots(n_rows, COLUMNS, sharex=True, sharey=True)))
    for panel, problem in zip(panels, problems, strict=False):
        _draw_panel(panel, [row for row in rows if row['problem'] == problem])
        panel.set_title(problem)
    for panel in panels[len(problems) :]:
        panel.set_axis_off()
    panels[0].set_ylabel('cost over the best known [%]')
    handles = {}
    for panel in panels[: len(problems)]:
        panel.tick_params(labelbottom=True)
        panel.set_xlabel('time [ms]')
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles[label] = handle
    figure.legend(handles.values(), handles.keys(), loc='outside lower center', ncols=4)
    return figure


def _draw_panel(panel: Any, rows: Sequence[Row]) -> None:
    panel.set(xscale='log', yscale='log', ylim=(LEAST, MOST), xlim=(GRID[0], GRID[-1]))
    panel.grid(alpha=0.3)
    panel.axhline(1.0, color='grey', linewidth=0.8, linestyle=':')
    for source, planner, colour in STYLES:
        chosen = [
            row
            for row in rows
            if row['source'] == source and row['planner'] == planner and row['history_time']
        ]
        n_runs = sum(row['source'] == source and row['planner'] == planner for row in rows)
        if not chosen:
            continue
        gaps = np.full((n_runs, len(GRID)), np.inf)
        gaps[: len(chosen)] = [gap_over_time(row) for row in chosen]
        low, middle, high = np.percentile(gaps, [10, 50, 90], axis=0, method='inverted_cdf')
        # Nothing is known of the time after the runs.
        end = 1e3 * max(max(row['time_total'] or 0.0, row['history_time'][-1]) for row in chosen)
        is_drawn = np.isfinite(low) & (end >= GRID)
        top = np.minimum(high, 2.0 * MOST)
        panel.fill_between(
            GRID[is_drawn], low[is_drawn], top[is_drawn], color=colour, alpha=0.15, linewidth=0.0
        )
        panel.plot(
            GRID[is_drawn], middle[is_drawn], color=colour, label=f'{planner} ({SOURCES[source]})'
        )


def gap_over_time(row: Row) -> Array:
    """Return the gap of the best path of a run at the times of GRID, infinite before it [%]."""
    times = 1e3 * np.array(row['history_time'])
    at = np.searchsorted(times, GRID, side='right') - 1
    gaps = 100.0 * (np.array(row['history_cost']) / row['best_cost'] - 1.0)
    return np.where(at >= 0, np.maximum(gaps, LEAST)[np.maximum(at, 0)], np.inf)
