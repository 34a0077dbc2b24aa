# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The rows of a campaign in one Parquet file that pandas and polars read.

A Parquet file cannot be continued, so it is written anew with each lot of rows: at once or not at
all.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Callable, Sequence
import os
from pathlib import Path
import uuid

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from rrth_planner.model.errors import RrthError
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
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh, old = pa.Table.from_pylist(list(rows), schema=SCHEMA), read_rows(path)
    kept = old.filter(pc.invert(pc.is_in(old['key'], fresh['key'])))
    table = pa.concat_tables([kept, fresh])
    replace_file(path, lambda target: pq.write_table(table, target, compression='zstd'))


def read_rows(path: Path) -> pa.Table:
    """
    Return all rows of a campaign; none where there is no such file.

    Raises
    ------
    RrthError
        The file is no Parquet file of a campaign.

    """
    if not path.exists():
        return SCHEMA.empty_table()
    try:
        return pq.read_table(path).select(SCHEMA.names).cast(SCHEMA)
    except (pa.ArrowException, KeyError, ValueError, OSError) as problem:
        raise RrthError(
            f'file {path}: {" ".join(str(problem).split())}; expected the rows of a campaign'
        ) from problem


def finished_keys(path: Path, *, timed: bool = False) -> set[str]:
    """Return the keys of the runs whose rows are there, or of those done one after another."""
    table = read_rows(path)
    if timed:
        table = table.filter(pc.equal(table['timing'], SERIAL))
    return set(table['key'].to_pylist())


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Have a file written beside its place, then move it there."""
    fresh = path.with_name(f'.{path.name}.{uuid.uuid4().hex[:8]}')
    try:
        write(fresh)
        with fresh.open('rb') as file:
            os.fsync(file.fileno())
        os.replace(fresh, path)
    finally:
        fresh.unlink(missing_ok=True)
