# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of a campaign in one Parquet file that pandas and polars read."""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from rrth_planner.io.parquet_file import read_table, write_table
from rrth_planner.reproduction.run import Row

# Where times were taken: alone on the machine, or beside other runs.
SERIAL, CLUSTER = 'serial', 'cluster'
_TEXT = (
    *('key', 'problem', 'algorithm', 'options_class', 'options', 'options_digest'),
    *('collision', 'timing', 'status', 'package_version', 'numpy_version', 'numba_version'),
    *('python_version', 'machine', 'commit', 'source_digest'),
)
_FLOATS = ('time_first', 'time_total', 'cost_first', 'cost_final')
_INTS = ('seed', 'draws_first', 'draws_total', 'n_waypoints')
SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in _TEXT),
        *((name, pa.int64()) for name in _INTS),
        *((name, pa.float64()) for name in _FLOATS),
        # By reference checkers independent of the planner; the second without the margin.
        ('is_valid', pa.bool_()),
        ('is_body_clear', pa.bool_()),
        # Sum of the changes of each joint along the path [rad].
        ('joint_travel', pa.list_(pa.float64())),
        # Of each of several growths, whether it went the longer way; null where it found none.
        ('ways', pa.list_(pa.bool_())),
        # After each improvement: length of the best path, draws and seconds until then.
        ('history_cost', pa.list_(pa.float64())),
        ('history_draws', pa.list_(pa.int64())),
        ('history_time', pa.list_(pa.float64())),
    ]
)


def append_rows(path: Path, rows: Sequence[Row]) -> None:
    """Add rows to a campaign, in place of those of the same runs; all or nothing."""
    fresh, old = pa.Table.from_pylist(list(rows), schema=SCHEMA), read_rows(path)
    kept = old.filter(pc.invert(pc.is_in(old['key'], fresh['key'])))
    write_table(path, pa.concat_tables([kept, fresh]))


def read_rows(path: Path) -> pa.Table:
    """
    Return all rows of a campaign; none where there is no such file.

    Raises
    ------
    RrthError
        The file is no Parquet file of a campaign.

    """
    return read_table(path, SCHEMA, 'the rows of a campaign')


def finished_keys(path: Path, *, timed: bool = False) -> set[str]:
    """Return the keys of the runs whose rows are there, or of those done one after another."""
    table = read_rows(path)
    if timed:
        table = table.filter(pc.equal(table['timing'], SERIAL))
    return set(table['key'].to_pylist())
