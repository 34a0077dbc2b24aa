# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of the reproduction, drawn from its rows and from a few plans of their own."""

from collections.abc import Iterator
from pathlib import Path

from matplotlib.figure import Figure
from rrth_planner.reproduction.experiments import (
    ALGORITHMS,
    COARSE,
    DENSE_ROADMAP,
    DUBINS,
    Extent,
    FIELD,
    FIVE,
    NEAR,
    RELATIVES,
    with_near,
)
from rrth_planner.reproduction.figures.arm import joint_paths_figure, median_paths, motions_figure
from rrth_planner.reproduction.figures.costs import (
    convergence_figure,
    DRAWS,
    histogram_figure,
    TIME,
)
from rrth_planner.reproduction.figures.maps import escape_figure, trees_figure
from rrth_planner.reproduction.statistics import Rows

FOLDER = 'images/reproduction'
# Targets whose motions Figure 21 shows, at most.
N_MOTIONS = 4


def draw_pictures(rows: Rows, extent: Extent, output: Path) -> dict[str, str]:
    """Draw all pictures into a folder; return where they are, by caption."""
    (output / FOLDER).mkdir(parents=True, exist_ok=True)
    paths = {}
    for name, caption, figure in _pictures(rows, extent):
        paths[caption] = f'{FOLDER}/figure_{name}.png'
        figure.savefig(output / paths[caption], facecolor='white', bbox_inches='tight')
    return paths


def _pictures(rows: Rows, extent: Extent) -> Iterator[tuple[str, str, Figure]]:
    """Yield the number, the caption and the picture of each figure."""
    maps, n = extent.maps, extent.many
    five = {name: ALGORITHMS[name] for name in FIVE}
    yield '09', 'Figure 9: trees and paths of the five planners', trees_figure(maps, five)
    note = f'medians and quartiles of {n} runs'
    caption = f'Figure 10a: cost against the number of P_random, {note}'
    yield '10a', caption, convergence_figure(rows, maps, DRAWS, n)
    if NEAR in with_near(maps):
        caption = f'Figure 10b: the same, start and goal in favour of Informed RRT*, {note}'
        yield '10b', caption, convergence_figure(rows, (NEAR,), DRAWS, n)
    yield '11', f'Figure 11: cost against time, {note}', convergence_figure(rows, maps, TIME, n)
    caption = f'Figure 12: histograms of cost and of time, {n} runs (triangles: medians)'
    yield '12', caption, histogram_figure(rows, maps, n)
    yield '14', 'Figure 14: the escape from local traps', escape_figure(rows, n)
    pairs = {target: median_paths(rows, target) for target in extent.targets}
    caption = 'Figure 20: joint paths to the targets, the run of median length'
    yield '20', caption, joint_paths_figure(pairs)
    shown = dict(list(pairs.items())[:: max(1, len(pairs) // N_MOTIONS)])
    yield '21', "Figure 21: the arm's motion", motions_figure(shown)
    some = {name: RELATIVES[name] for name in (FIELD, DUBINS[1], COARSE, DENSE_ROADMAP)}
    figure = trees_figure(maps, some, "RRT-H's path before smoothing")
    yield (
        'relatives',
        'Relatives of RRT-H and references: what they search, and their paths',
        figure,
    )
