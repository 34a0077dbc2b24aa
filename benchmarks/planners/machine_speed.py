# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How fast this machine is, by a peer that was timed where the targets were set, too."""

from collections.abc import Mapping, Sequence
import json

import numpy as np

from benchmarks.common.queries import FOLDER
from benchmarks.common.task import Row
from benchmarks.planners.harness import SIMPLIFIED, SOURCE


def published_first() -> Mapping[str, float]:
    """Return the peer's median time of a first path where targets were set, by problem [ms]."""
    data = json.loads((FOLDER / 'ompl_published.json').read_text(encoding='utf-8'))
    first: Mapping[str, float] = data['first_ms']
    return first


def slowness(rows: Sequence[Row]) -> float | None:
    """
    Return how many times as long the C++ peer takes here as where the targets were set.

    The median over the problems; None where too few of its lines were given.
    """
    ratios = []
    for problem, known in published_first().items():
        times = [
            1e3 * row['time_first']
            for row in rows
            if row['source'] == SOURCE
            and row['planner'] == SIMPLIFIED
            and row['problem'] == problem
            and row['time_first'] is not None
        ]
        if times:
            ratios.append(float(np.median(times)) / known)
    return float(np.median(ratios)) if len(ratios) >= 3 else None


def sentence(rows: Sequence[Row]) -> str:
    """Return what the report says of the machine."""
    slow = slowness(rows)
    if slow is None:
        return 'How fast this machine is was not compared with where the targets were set.'
    return (
        f'The times asked for are those of another machine: a first path of the C++ peer takes '
        f'{slow:.2f} times as long here as it took there (median over the problems).'
    )
