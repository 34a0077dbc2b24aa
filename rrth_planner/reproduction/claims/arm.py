# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The claims of the paper about the arm (Table 1, section 6.2) and its collision test."""

import numpy as np
from rrth_planner.io.map_file import load_map
from rrth_planner.model.arrays import Array
from rrth_planner.planning.visibility_graph import shortest_path
from rrth_planner.reproduction.experiments import (
    CHECK_POINTS,
    Extent,
    INFORMED,
    LONG,
    long_label,
    PRINTED,
    PRINTED_FINE,
    RRT,
    RRT_H,
    RRT_STAR,
    SAMPLED,
)
from rrth_planner.reproduction.problems import CERTIFIED
from rrth_planner.reproduction.statistics import markdown_table, number, percent, Rows

# Figure 20: mean accumulated change of each joint [deg], and its reduction [%].
PAPER_TRAVEL = {RRT: (181.28, 172.57, 212.57, 140.38), RRT_H: (88.38, 69.16, 92.00, 93.89)}
PAPER_REDUCTION, PAPER_OVERALL = (51.24, 59.92, 56.72, 33.11), 51.4


def mean_travel(rows: Rows, extent: Extent, name: str, n: int) -> Array:
    """Return the accumulated change of each joint, mean over targets and n seeds [deg]."""
    travel = [
        row['joint_travel']
        for target in extent.targets
        for row in rows.where(
            problem=f'arm/{target}', algorithm=name, collision=CERTIFIED, below=n
        ).rows
        if row['joint_travel'] is not None
    ]
    return np.degrees(np.mean(travel, axis=0)) if travel else np.full(4, np.nan)


def arm_table(rows: Rows, extent: Extent) -> str:
    """Return the accumulated joint angles of RRT and RRT-H, the paper's and ours."""
    few, many = min(extent.few, extent.arm), extent.arm
    ours = {
        (name, n): mean_travel(rows, extent, name, n) for name in (RRT, RRT_H) for n in (few, many)
    }
    header = ['', 'the paper says', f'we measure, {few} runs', f'we measure, {many} runs']
    lines = []
    for name in (RRT, RRT_H):
        for j in range(4):
            lines.append(
                [f'{name}, joint {j + 1} [deg]', f'{PAPER_TRAVEL[name][j]:.2f}']
                + [number(ours[name, n][j]) for n in (few, many)]
            )
    for j in range(4):
        lines.append(
            [f'reduction, joint {j + 1}', f'{PAPER_REDUCTION[j]:.2f} %']
            + [
                number(100 * (1 - ours[RRT_H, n][j] / ours[RRT, n][j]), 2, ' %')
                for n in (few, many)
            ]
        )
    lines.append(
        ['reduction, overall', f'{PAPER_OVERALL:.1f} %']
        + [percent(1 - ours[RRT_H, n].sum() / ours[RRT, n].sum(), 1) for n in (few, many)]
    )
    return markdown_table(header, lines)


def target_table(rows: Rows, extent: Extent) -> str:
    """Return the results of RRT and RRT-H for each target."""
    lines = []
    for target in extent.targets:
        for name in (RRT, RRT_H):
            some = rows.where(problem=f'arm/{target}', algorithm=name, collision=CERTIFIED)
            travel = np.degrees(mean_travel_of(some))
            lines.append(
                [
                    target,
                    name,
                    f'{some.n_solved()} of {len(some)}',
                    percent(some.share('is_valid')),
                    number(some.median('draws_first'), 0),
                    number(1e3 * some.median('time_total'), 1),
                    number(some.median('cost_final')),
                    ', '.join(number(value, 0) for value in travel),
                ]
            )
    header = (
        *('target', 'planner', 'found', 'valid', 'P_random', 'time [ms]', 'length [rad]'),
        'joints 1 to 4, mean [deg]',
    )
    return markdown_table(header, lines)


def mean_travel_of(rows: Rows) -> Array:
    """Return the mean accumulated change of each joint, shape (4,) [rad]."""
    travel = [row['joint_travel'] for row in rows.rows if row['joint_travel'] is not None]
    return np.mean(travel, axis=0) if travel else np.full(4, np.nan)


def mode_table(rows: Rows, extent: Extent) -> str:
    """Return how many paths each way to check collisions lets through that collide."""
    lines = []
    names = (
        (CERTIFIED, 'certified (ours, default)'),
        (SAMPLED, 'exact, every 0.02 rad'),
        (CHECK_POINTS, "the paper's points in cuboids, every 0.02 rad"),
    )
    for collision, label in names:
        some = Rows([r for r in rows.rows if r['problem'].startswith('arm/')]).where(
            algorithm=RRT_H, collision=collision
        )
        lines.append(
            [
                'arm, RRT-H',
                label,
                str(some.n_solved()),
                percent(1 - some.share('is_valid'), 1),
                percent(1 - some.share('is_body_clear'), 1),
            ]
        )
    for problem in extent.maps:
        for name in (RRT_H, PRINTED, PRINTED_FINE):
            some = rows.where(problem=problem, algorithm=name)
            share = percent(1 - some.share('is_valid'), 1)
            lines.append([problem, name, str(some.n_solved()), share, 'no margin'])
    header = (
        'problem',
        'planner or check',
        'paths',
        'in collision',
        'in collision without the margin',
    )
    return markdown_table(header, lines)


def long_table(rows: Rows, extent: Extent) -> str:
    """Return how near RRT* and Informed RRT* come to the shortest path in 20,000 steps."""
    lines = []
    for problem in (name for name in extent.maps if name != 'fence'):
        exact = shortest_path(load_map(problem))[0]
        for name in (RRT_STAR, INFORMED):
            some = rows.where(problem=problem, algorithm=long_label(name))
            lines.append(
                [problem, name, str(len(some)), number(some.median('cost_final') / exact, 4)]
            )
    return markdown_table(('map', f'planner, {LONG} steps', 'runs', 'final over exact'), lines)
