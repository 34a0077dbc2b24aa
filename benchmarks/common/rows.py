# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of the benchmarks in one Parquet file, and their sums in a CSV file."""

from collections.abc import Sequence
import csv
from pathlib import Path
from typing import Any

import pyarrow as pa
from rrth_planner.io.parquet_file import read_table, write_table
from rrth_planner.io.replaced_file import replace_file

from benchmarks.common.task import Row

_TEXT = (
    *('section', 'task', 'extent', 'quantity', 'unit', 'problem', 'planner', 'source', 'options'),
    *('detail', 'package_version', 'numpy_version', 'numba_version', 'python_version'),
    *('ompl_version', 'machine', 'commit', 'source_digest'),
)
_FLOATS = ('value', 'best_cost', 'time_total', 'time_first', 'cost_first', 'cost_final')
SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in _TEXT),
        *((name, pa.int64()) for name in ('seed', 'n_cores')),
        *((name, pa.float64()) for name in _FLOATS),
        ('is_solved', pa.bool_()),
        ('is_valid', pa.bool_()),
        ('history_time', pa.list_(pa.float64())),
        ('history_cost', pa.list_(pa.float64())),
        ('waypoints', pa.list_(pa.list_(pa.float64()))),
    ]
)


def read_rows(path: Path) -> list[Row]:
    """
    Return the rows of a file; none where there is no such file.

    Raises
    ------
    RrthError
        The file holds no rows of the benchmarks.

    """
    rows: list[Row] = read_table(path, SCHEMA, 'rows of the benchmarks').to_pylist()
    return rows


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write all rows at once, or leave the file as it is."""
    table = pa.Table.from_pylist([{n: r.get(n) for n in SCHEMA.names} for r in rows], SCHEMA)
    write_table(path, table)


def write_summary(path: Path, header: Sequence[str], lines: Sequence[Sequence[Any]]) -> None:
    """Write a table as CSV."""

    def write(target: Path) -> None:
        with target.open('w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file, lineterminator='\n')
            writer.writerow(header)
            writer.writerows(lines)

    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, write)
