# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The claims of the paper about the arm (Table 1, section 6.2) and its collision test."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.reproduction.claims.plane import verdict
from rrth_planner.reproduction.experiments import (
    ARM_ALGORITHMS,
    CHECK_POINTS,
    Extent,
    PRINTED,
    PRINTED_FINE,
    RRT,
    RRT_H,
    SAMPLED,
)
from rrth_planner.reproduction.problems import CERTIFIED
from rrth_planner.reproduction.statistics import markdown_table, number, percent, Rows

# Of L1 to L4 and of the ray, L5, whose d varies: d and a [m], alpha and offset [pi rad].
PAPER_LINKS = (
    (0.126, 0.0, -0.5, -0.5),
    (0.0, 0.0, 0.5, -0.5),
    (0.386, 0.0, 0.5, 0.5),
    (0.038, 0.0, 0.5, 0.0),
    (np.nan, 0.0, -0.5, 0.0),
)
# Of the four joints [pi rad]. One end is open there where ours is closed: the same configurations.
PAPER_RANGES = ((-1.0, 1.0), (-1.0, 0.0), (-1.0, 1.0), (-1.0, 1.0))
# Values that the file has in more digits than the paper.
TOLERANCE = 1e-9
# Figure 20: mean accumulated change of each joint [deg], and its reduction [%].
PAPER_TRAVEL = {RRT: (181.28, 172.57, 212.57, 140.38), RRT_H: (88.38, 69.16, 92.00, 93.89)}
PAPER_REDUCTION, PAPER_OVERALL = (51.24, 59.92, 56.72, 33.11), 51.4


def is_the_papers(arm: ArmModel) -> bool:
    """Return whether an arm has the rows and the ranges of Table 1, the tool's row for L5."""
    if arm.dh.shape != (len(PAPER_LINKS), 4) or any(arm.is_prismatic):
        return False
    is_free = np.isnan(np.array(PAPER_LINKS))
    rows = np.where(is_free, np.nan, _links(arm))
    return bool(
        np.allclose(rows, PAPER_LINKS, rtol=0.0, atol=TOLERANCE, equal_nan=True)
        and np.allclose(arm.bounds.T / np.pi, PAPER_RANGES, rtol=0.0, atol=TOLERANCE)
    )


def table_1(arm: ArmModel) -> str:
    """Return Table 1, the paper's numbers and the arm's."""
    lines = []
    for i, (theirs, ours) in enumerate(zip(PAPER_LINKS, _links(arm), strict=True)):
        is_ray = i == len(PAPER_LINKS) - 1
        cells = [f'L{i + 1}']
        for j, digits in enumerate((3, 3, 1, 1)):
            is_free = is_ray and j == 0
            cells.append('variable' if is_free else number(theirs[j], digits))
            cells.append('the ray' if is_free else number(ours[j], digits))
        if is_ray:
            cells += ['from 0', 'from 0']
        else:
            cells += [f'{a:g} to {b:g}' for a, b in (PAPER_RANGES[i], arm.bounds.T[i] / np.pi)]
        lines.append(cells)
    units = ('d [m]', 'a [m]', 'alpha [pi]', 'offset [pi]', 'range [pi]')
    header = ['link', *(cell for unit in units for cell in (f'{unit}, paper', 'ours'))]
    return markdown_table(header, lines)


def table_1_claim(arm: ArmModel) -> str:
    """Return the sentence on whether the arm is that of Table 1."""
    return (
        f'That the arm planned for (`config/arm.yaml`) is that of Table 1 '
        f'{verdict(is_the_papers(arm))}, to {TOLERANCE:g} m and pi rad.'
    )


def _links(arm: ArmModel) -> Array:
    """Return d, a [m], alpha and offset [pi rad] of each link, shape (n, 4)."""
    alpha, a, offset, d = arm.dh.T
    return np.stack([d, a, alpha / np.pi, offset / np.pi], axis=1)


def _arm_rows(rows: Rows, targets: Iterable[str], **wanted: Any) -> Rows:
    """Return the rows of some targets with these values, one target after another."""
    return Rows([r for t in targets for r in rows.where(problem=f'arm/{t}', **wanted).rows])


def mean_travel(rows: Rows) -> Array:
    """Return the mean accumulated change of each joint, shape (4,) [deg]."""
    travel = [row['joint_travel'] for row in rows.rows if row['joint_travel'] is not None]
    return np.degrees(np.mean(travel, axis=0)) if travel else np.full(4, np.nan)


def arm_table(rows: Rows, extent: Extent) -> str:
    """Return the accumulated joint angles of RRT and RRT-H, the paper's and ours."""
    columns = (min(extent.few, extent.arm), extent.arm)
    certified = rows.where(collision=CERTIFIED)
    rrt, rrt_h = (
        np.transpose(
            [
                mean_travel(_arm_rows(certified, extent.targets, algorithm=name, below=n))
                for n in columns
            ]
        )
        for name in (RRT, RRT_H)
    )
    lines = [
        [f'{name}, joint {j + 1} [deg]', f'{paper:.2f}', *map(number, ours[j])]
        for name, ours in ((RRT, rrt), (RRT_H, rrt_h))
        for j, paper in enumerate(PAPER_TRAVEL[name])
    ]
    for j, paper in enumerate(PAPER_REDUCTION):
        reductions = [percent(1 - share, 2) for share in rrt_h[j] / rrt[j]]
        lines.append([f'reduction, joint {j + 1}', f'{paper:.2f} %', *reductions])
    overall = [percent(1 - share, 1) for share in rrt_h.sum(axis=0) / rrt.sum(axis=0)]
    lines.append(['reduction, overall', f'{PAPER_OVERALL:.1f} %', *overall])
    return markdown_table(
        ['', 'the paper says', *(f'we measure, {n} runs' for n in columns)], lines
    )


def target_table(rows: Rows, extent: Extent) -> str:
    """Return the results of RRT and RRT-H for each target."""
    lines = []
    for target in extent.targets:
        for name in ARM_ALGORITHMS:
            some = _arm_rows(rows, [target], algorithm=name, collision=CERTIFIED)
            lines.append(
                [
                    target,
                    name,
                    some.found(),
                    percent(some.share('is_valid')),
                    number(some.median('draws_first'), 0),
                    number(1e3 * some.median('time_total'), 1),
                    number(some.median('cost_final')),
                    ', '.join(number(value, 0) for value in mean_travel(some)),
                ]
            )
    header = (
        *('target', 'planner', 'found', 'valid', 'P_random', 'time [ms]', 'length [rad]'),
        'joints 1 to 4, mean [deg]',
    )
    return markdown_table(header, lines)


def mode_table(rows: Rows, extent: Extent) -> str:
    """Return how many paths each way to check collisions lets through that collide."""
    lines = []
    for collision, label in (
        (CERTIFIED, 'certified (ours, default)'),
        (SAMPLED, 'exact, every 0.02 rad'),
        (CHECK_POINTS, "the paper's points in cuboids, every 0.02 rad"),
    ):
        some = _arm_rows(rows, extent.targets, algorithm=RRT_H, collision=collision)
        shares = [percent(1 - some.share(name), 1) for name in ('is_valid', 'is_body_clear')]
        lines.append(['arm, RRT-H', label, str(some.n_solved()), *shares])
    for problem in extent.maps:
        for name in (RRT_H, PRINTED, PRINTED_FINE):
            some = rows.where(problem=problem, algorithm=name)
            share = percent(1 - some.share('is_valid'), 1)
            lines.append([problem, name, str(some.n_solved()), share, 'no margin'])
    header = ('problem', 'planner or check', 'paths', 'in collision')
    return markdown_table((*header, 'in collision without the margin'), lines)
