# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Files of many queries, CSV or Parquet: each row asks for one motion.

The columns `target_x`, `target_y` and `target_z` [m] are needed. There may be `start_1` to
`start_n`, the joint positions at the start [rad or m]; `arm` and `body`, files by their places
from the folder of the queries; and `seed`. Any other column is kept as it is.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Iterator, Sequence
from pathlib import Path
import re
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pc_csv
import pyarrow.parquet as pq
from rrth_planner.io.parquet_file import PROBLEMS, unreadable
from rrth_planner.model.errors import RecordError

TARGET = ('target_x', 'target_y', 'target_z')
FILES = ('arm', 'body')
SEED = 'seed'
WANTED = f'queries, a .csv or .parquet file with the columns {", ".join(TARGET)}'
_START = re.compile(r'start_[1-9][0-9]*')
# Joints of an arm in a CSV file.
_MOST_JOINTS = 100
# Read at a time, and what the types of other columns of a CSV file are inferred from [bytes].
_BLOCK = 2**24
# Times of a CSV file, and how Parquet keeps them.
_KEPT = {
    pa.timestamp('s'): pa.timestamp('ms'),
    pa.timestamp('s', 'UTC'): pa.timestamp('ms', 'UTC'),
    pa.time32('s'): pa.time32('ms'),
}


def query_schema(paths: Sequence[Path], taken: Sequence[str]) -> tuple[Any, int]:
    """
    Return the columns of query files and how many rows these have together.

    Raises
    ------
    RrthError
        A file cannot be read, lacks a column, has a number that is none, columns other than those
        of the first file, or one that is called as results are, the names in `taken`.

    """
    schema, n_rows = None, 0
    for path in paths:
        for table in _tables(path):
            if schema is None:
                _check_names(path, table.schema.names, taken)
                schema = table.schema
            elif table.schema != schema:
                raise RecordError(
                    f'file {path}: columns {_columns(table.schema)}, expected those of '
                    f'{paths[0]}, {_columns(schema)}'
                )
            n_rows += len(table)
    return schema, n_rows


def read_queries(paths: Sequence[Path], size: int) -> Iterator[tuple[Path, Any]]:
    """Yield the queries of all files in their order, as (file, table of at most `size` rows)."""
    for path in paths:
        for table in _tables(path):
            for first in range(0, len(table), size):
                yield path, table.slice(first, size)


def other_columns(names: Sequence[str]) -> list[str]:
    """Return the names of the columns that mean nothing to the planner."""
    known = {*TARGET, *FILES, SEED, *start_columns(names)}
    return [name for name in names if name not in known]


def start_columns(names: Sequence[str]) -> list[str]:
    """Return the names of the columns with joint positions, from the first joint on."""
    return sorted(filter(_START.fullmatch, names), key=lambda name: int(name.partition('_')[2]))


def _tables(path: Path) -> Iterator[Any]:
    """Yield the rows of a file as tables; there is one where it has none."""
    try:
        batches: Any
        if path.suffix.lower() == '.csv':
            batches = pc_csv.open_csv(
                path,
                read_options=pc_csv.ReadOptions(block_size=_BLOCK),
                convert_options=pc_csv.ConvertOptions(
                    strings_can_be_null=True, column_types=_types_in_csv()
                ),
            )
            yield _typed(batches.schema.empty_table())
        elif path.suffix.lower() == '.parquet':
            file = pq.ParquetFile(path)
            yield _typed(file.schema_arrow.empty_table())
            batches = file.iter_batches()
        else:
            raise ValueError('another kind of file')
        for batch in batches:
            yield _typed(pa.Table.from_batches([batch]))
    except PROBLEMS as problem:
        raise unreadable(path, problem, WANTED) from problem


def _types_in_csv() -> dict[str, Any]:
    """Return the types of all columns that a query may have, as CSV files write them."""
    starts = [f'start_{k}' for k in range(1, _MOST_JOINTS + 1)]
    # A seed is written as 1.0 where a table also has rows without.
    numbers = {name: pa.float64() for name in (*TARGET, *starts, SEED)}
    return {**numbers, **{name: pa.string() for name in FILES}}


def _typed(table: Any) -> Any:
    """Return queries with columns of the types that these have; NaN is a value that is missing."""
    fields, columns = [], []
    for field, column in zip(table.schema, table.columns, strict=True):
        name, kind = field.name, _KEPT.get(field.type, field.type)
        if name in TARGET or _START.fullmatch(name):
            kind = pa.float64()
        elif name == SEED:
            kind = pa.int64()
        elif name in FILES or _is_text(kind):
            # Some libraries write long texts.
            kind = pa.string()
        if _is_text(column.type) and not _is_text(kind):
            raise ValueError(f'column {name}: texts, expected numbers')
        if pa.types.is_floating(column.type):
            column = pc.if_else(pc.is_nan(column), None, column)
        fields.append(pa.field(name, kind))
        columns.append(column.cast(kind))
    return pa.table(columns, schema=pa.schema(fields))


def _is_text(kind: Any) -> bool:
    return any(
        of_type(kind)
        for of_type in (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
    )


def _check_names(path: Path, names: Sequence[str], taken: Sequence[str]) -> None:
    missing = [name for name in TARGET if name not in names]
    if missing:
        raise RecordError(f'file {path}: no column {", ".join(missing)}, expected {WANTED}')
    starts = start_columns(names)
    expected = [f'start_{k + 1}' for k in range(len(starts))]
    if starts != expected:
        raise RecordError(
            f'file {path}: columns {", ".join(starts)}, expected {", ".join(expected)}, one for '
            'each joint'
        )
    results = [name for name in names if name in taken]
    if results or len(set(names)) < len(names):
        raise RecordError(
            f'file {path}: columns {", ".join(results or names)}, expected different names, and '
            'other ones than those of results'
        )


def _columns(schema: Any) -> str:
    return ', '.join(f'{field.name} ({field.type})' for field in schema)
