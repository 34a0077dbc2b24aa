# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Rows in one Parquet file, which pandas and polars read.

A Parquet file cannot be continued, so it is written anew with each lot of rows: at once or not at
all.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

import os
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from rrth_planner.io.replaced_file import replace_file
from rrth_planner.model.errors import RrthError

# What pyarrow raises for a file that is not what it should be.
PROBLEMS = (pa.ArrowException, KeyError, ValueError, OSError)
# Rows that are copied at a time, and written as one group.
GROUP_ROWS = 65_536


def read_table(path: Path, schema: Any, what: str) -> Any:
    """
    Return the rows of a file, with the columns of a schema; none where there is no such file.

    Raise RrthError where it has others, or is no Parquet file; what: what was expected.
    """
    if not path.exists():
        return schema.empty_table()
    try:
        return pq.read_table(path).select(schema.names).cast(schema)
    except PROBLEMS as problem:
        raise unreadable(path, problem, what) from problem


def write_table(path: Path, table: Any) -> None:
    """Write all rows of a file at once, or leave it as it is."""
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, lambda target: pq.write_table(table, target, compression='zstd'))


def append_table(path: Path, table: Any) -> None:
    """Add rows at the end of a file, which has the same columns, or leave it as it is."""

    def write(target: Path) -> None:
        with pq.ParquetWriter(target, table.schema, compression='zstd') as writer:
            if path.exists():
                # Never all rows in memory.
                with pq.ParquetFile(path) as old:
                    for batch in old.iter_batches(GROUP_ROWS):
                        writer.write_batch(batch)
            writer.write_table(table)

    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, write)


def unreadable(path: Path, problem: Exception, what: str) -> RrthError:
    """Return the error of a file that is not what was expected."""
    # The libraries' own words for a missing file name it, and its error number, twice.
    why = ' '.join(str(problem).split())
    if isinstance(problem, OSError) and problem.errno is not None:
        why = os.strerror(problem.errno)
    return RrthError(f'file {path}: {why}; expected {what}')
