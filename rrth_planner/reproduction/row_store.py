# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The rows of a campaign in one Parquet file that pandas and polars read.

A Parquet file cannot be continued. So new rows are written as parts into a folder beside it, each
at once or not at all, and united with the file at the end or when a later campaign begins.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Callable, Sequence
import os
from pathlib import Path
from typing import Any
import uuid

import pyarrow as pa
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
    """Add rows to a campaign; they are on the disk, or nothing is, when this returns."""
    folder = _parts_folder(path)
    folder.mkdir(parents=True, exist_ok=True)
    table = pa.Table.from_pylist(list(rows), schema=SCHEMA)
    # Names in the order of writing; several campaigns may write at once.
    number = 1 + max((int(part.stem.partition('-')[0]) for part in _parts(path)), default=0)
    _write(table, folder / f'{number:06d}-{uuid.uuid4().hex[:8]}.parquet')


def unite_parts(path: Path) -> None:
    """Merge all rows of a campaign into its file."""
    parts = _parts(path)
    if not parts:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(read_rows(path), path)
    for part in parts:
        part.unlink(missing_ok=True)
    if not any(_parts_folder(path).iterdir()):
        _parts_folder(path).rmdir()


def read_rows(path: Path) -> pa.Table:
    """
    Return all rows of a campaign, each once; none where there is no such file.

    Raises
    ------
    RrthError
        The file is no Parquet file of a campaign.

    """
    tables = []
    if path.exists():
        try:
            tables.append(pq.read_table(path).select(SCHEMA.names).cast(SCHEMA))
        except (pa.ArrowException, KeyError, ValueError, OSError) as problem:
            raise RrthError(
                f'file {path}: {" ".join(str(problem).split())}; expected the rows of a campaign'
            ) from problem
    for part in _parts(path):
        try:
            tables.append(pq.read_table(part).cast(SCHEMA))
        except (pa.ArrowException, ValueError, OSError):
            # Truncated, e.g. by a full disk: its runs are repeated.
            continue
    table = pa.concat_tables([SCHEMA.empty_table(), *tables])
    # An interruption while parts were united leaves rows twice.
    first: dict[str, int] = {}
    timings = table['timing'].to_pylist()
    for i, key in enumerate(table['key'].to_pylist()):
        # Done again one by one for its time's sake: that row counts.
        is_better = timings[i] == SERIAL and timings[first.get(key, i)] != SERIAL
        if key not in first or is_better:
            first[key] = i
    return table if len(first) == len(table) else table.take(list(first.values()))


def finished_keys(path: Path, *, timed: bool = False) -> set[str]:
    """Return the keys of the runs whose rows are there, or of those done one after another."""
    table = read_rows(path)
    pairs = zip(table['key'].to_pylist(), table['timing'].to_pylist(), strict=True)
    return {key for key, timing in pairs if timing == SERIAL or not timed}


def histories(table: pa.Table) -> pa.Table:
    """
    Return the second table: how the cost of each run fell, a row an improvement.

    Columns `key`, `history_cost`, `history_draws` and `history_time` [s]; `key` joins it with the
    runs.
    """
    names = ('history_cost', 'history_draws', 'history_time')
    whole = table.combine_chunks()
    parents = pa.compute.list_parent_indices(whole['history_cost'])
    columns: dict[str, Any] = {'key': whole['key'].take(parents)}
    for name in names:
        columns[name] = pa.compute.list_flatten(whole[name])
    return pa.table(columns)


def _parts_folder(path: Path) -> Path:
    return path.with_name(f'{path.name}.parts')


def _parts(path: Path) -> list[Path]:
    return sorted(_parts_folder(path).glob('*.parquet'))


def _write(table: pa.Table, path: Path) -> None:
    """Write a file at once or not at all."""
    replace_file(path, lambda target: pq.write_table(table, target, compression='zstd'))


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
