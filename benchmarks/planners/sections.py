# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The tasks of a run of the benchmarks, done one after another."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict
import json
from pathlib import Path
import sys

from tqdm import tqdm

from benchmarks.common.clock import pinned
from benchmarks.common.rows import read_rows, write_rows
from benchmarks.common.size import Extent
from benchmarks.common.task import origin, Row, Task
from benchmarks.planners import (
    certificate_audit,
    edge_checks,
    full_query,
    harness,
    node,
    ompl_peer,
    other_arms,
    plans,
    shortened_edges,
)

_MODULES = {
    'checks': edge_checks,
    'shortcut': shortened_edges,
    'plans': plans,
    'full query': full_query,
    'other arms': other_arms,
    'peers': ompl_peer,
    'harness': harness,
    'proof': certificate_audit,
    'node': node,
}
SECTIONS = tuple(_MODULES)
# What a row must share with this run to be kept.
_SAME = ('extent', 'source_digest', 'machine', 'n_cores')
_ABSENT = {
    'peers': 'ompl: not installed, so it is not measured; install it by\n'
    '    ./run exec python -m pip install -r requirements/benchmark.txt',
    'node': 'rclpy: not installed, so the node is not measured',
}


def section_tasks(sections: Sequence[str], extent: Extent, lines: Path | None) -> list[Task]:
    """
    Return the measurements that can be made here; say which cannot.

    Parameters
    ----------
    sections : sequence of str
        Of SECTIONS.
    extent : Extent
    lines : Path
        Folder with the lines of the C++ program, or None.

    """
    found: list[Task] = []
    for section in sections:
        module = _MODULES[section]
        if section == 'harness':
            found += harness.tasks(lines)
        elif section in _ABSENT and not module.is_possible():
            print(_ABSENT[section], file=sys.stderr)
        else:
            found += module.tasks(extent)
    return found


def measure(
    tasks: Sequence[Task], data: Path, extent: Extent, *, again: Sequence[str]
) -> list[Row]:
    """
    Return the rows of all tasks, after doing those whose rows are not in a file yet.

    Rows of other sources, another machine or extent are dropped.

    Parameters
    ----------
    tasks : sequence of Task
    data : Path
        The file; rewritten after each section.
    extent : Extent
    again : sequence of str
        Sections whose rows in the file do not count.

    """
    # Its thread would wake up while others are timed.
    tqdm.monitor_interval = 0
    common = {'extent': json.dumps(asdict(extent), sort_keys=True), **origin()}
    rows = [
        row for row in read_rows(data) if _is_same(row, common) and row['section'] not in again
    ]
    done = {(row['section'], row['task']) for row in rows}
    pending = [task for task in tasks if (task.section, task.name) not in done]
    for section in dict.fromkeys(task.section for task in pending):
        chosen = [task for task in pending if task.section == section]
        for task in tqdm(chosen, desc=section, unit='task', file=sys.stderr):
            with pinned() if task.is_pinned else nullcontext():
                found = task.measure()
            place = {'section': task.section, 'task': task.name, **common}
            rows.extend({**row, **place} for row in found)
        write_rows(data, rows)
    return read_rows(data)


def _is_same(row: Row, common: Mapping[str, object]) -> bool:
    return all(row[name] == common[name] for name in _SAME)
