# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's Table 1 beside the arm that is planned for."""

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.reproduction.claims.plane import verdict
from rrth_planner.reproduction.statistics import markdown_table, number

# Of L1 to L4 and of the ray, L5, whose d varies: d and a [m], alpha and offset [pi rad].
PAPER = (
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


def is_the_papers(arm: ArmModel) -> bool:
    """Return whether an arm has the rows and the ranges of Table 1, the tool's row for L5."""
    if arm.dh.shape != (len(PAPER), 4) or any(arm.is_prismatic):
        return False
    is_free = np.isnan(np.array(PAPER))
    rows = np.where(is_free, np.nan, _rows(arm))
    return bool(
        np.allclose(rows, PAPER, rtol=0.0, atol=TOLERANCE, equal_nan=True)
        and np.allclose(arm.bounds.T / np.pi, PAPER_RANGES, rtol=0.0, atol=TOLERANCE)
    )


def table_1(arm: ArmModel) -> str:
    """Return Table 1, the paper's numbers and the arm's."""
    lines = []
    for i, (theirs, ours) in enumerate(zip(PAPER, _rows(arm), strict=True)):
        is_ray = i == len(PAPER) - 1
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


def _rows(arm: ArmModel) -> Array:
    """Return d, a [m], alpha and offset [pi rad] of each link, shape (n, 4)."""
    alpha, a, offset, d = arm.dh.T
    return np.stack([d, a, alpha / np.pi, offset / np.pi], axis=1)
