# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The plans of a campaign in one Parquet file: always the first of its queries, in their order.

So an interrupted campaign goes on after the last of them, and nothing but the file has to be kept.
"""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
import json
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from rrth_planner.cli.query_batch import QueryBatch, RESULTS
from rrth_planner.io.parquet_file import append_table, PROBLEMS, unreadable
from rrth_planner.io.query_file import SEED
from rrth_planner.model.errors import RecordError

WHAT = 'the plans of a campaign'
# What the answers depend on besides the queries, in the schema of the file.
_ORIGIN = b'rrth_campaign'


def plan_schema(queries: Any, origin: Mapping[str, Any]) -> Any:
    """Return the columns of the plans of queries with these columns; origin: as JSON can be."""
    fields = list(queries)
    if SEED not in queries.names:
        fields.append(pa.field(SEED, pa.int64()))
    return pa.schema(
        [*fields, *RESULTS], metadata={_ORIGIN: json.dumps(origin, sort_keys=True).encode()}
    )


def finished(path: Path, schema: Any) -> Any:
    """
    Return the queries that a file has plans of, as a table; none where there is no such file.

    Raises
    ------
    RecordError
        The file is none of a campaign with these columns and this origin.

    """
    asked = schema.names[: schema.names.index('status')]
    if not path.exists():
        return schema.empty_table().select(asked)
    try:
        found = pq.read_schema(path)
        origin = (found.metadata or {}).get(_ORIGIN)
        done = pq.read_table(path, columns=asked) if origin and found.equals(schema) else None
    except PROBLEMS as problem:
        raise unreadable(path, problem, WHAT) from problem
    if origin is None:
        raise RecordError(f'file {path}: another Parquet file, expected {WHAT}, or none')
    if done is None:
        raise RecordError(
            f'file {path}: plans of queries with other columns, expected those given; '
            'another --output starts afresh'
        )
    if origin != schema.metadata[_ORIGIN]:
        differ = ', '.join(_differences(origin, schema.metadata[_ORIGIN]))
        raise RecordError(
            f'file {path}: planned with other values of {differ}, expected those given; another '
            '--output starts afresh'
        )
    return done


def _differences(before: bytes, now: bytes) -> Iterator[str]:
    """Yield the names of what differs between two origins."""
    old, new = json.loads(before), json.loads(now)
    for part in {**old, **new}:
        first, second = old.get(part, {}), new.get(part, {})
        for name in {**first, **second}:
            if first.get(name) != second.get(name):
                yield name


def unfinished(path: Path, batches: Iterator[QueryBatch], done: Any) -> Iterator[QueryBatch]:
    """
    Return what follows, in batches of queries, those that a file has plans of.

    Raises
    ------
    RecordError
        The queries do not begin with those of the file, with the same arms, wearers and seeds.

    """
    begin = 0
    while begin < len(done):
        batch = next(batches, None)
        if batch is None:
            raise RecordError(
                f'file {path}: {len(done)} plans, expected at most {begin}, the number of queries'
            )
        known = done.slice(begin, len(batch.table))
        if not batch.table.slice(0, len(known)).equals(known):
            first = next(k for k in range(len(known)) if _differ(known, batch.table, k))
            raise RecordError(
                f'file {path}: plan {begin + first} is of another query, arm, wearer or seed, '
                'expected those given; another --output starts afresh'
            )
        begin += len(known)
        if len(known) < len(batch.table):
            return chain([batch.after(len(known))], batches)
    return batches


def _differ(one: Any, other: Any, row: int) -> bool:
    return not one.slice(row, 1).equals(other.slice(row, 1))


def append_plans(path: Path, tables: Sequence[Any], schema: Any) -> None:
    """Add plans to the file, all of them or none."""
    append_table(path, pa.concat_tables(tables).cast(schema))


def statuses(path: Path) -> Counter[str]:
    """Return how many plans of a file have which status."""
    counted = pq.read_table(path, columns=['status'])['status'].value_counts().to_pylist()
    return Counter({entry['values']: entry['counts'] for entry in counted})
