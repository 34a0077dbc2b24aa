# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Parquet files that grow: every row once, in its order, and none lost by a write that fails."""

import pytest

pa = pytest.importorskip('pyarrow')

import pyarrow.parquet as pq
from rrth_planner.io.parquet_file import append_table, GROUP_ROWS, read_table, write_table
from rrth_planner.model.errors import RrthError

SCHEMA = pa.schema([('name', pa.string()), ('value', pa.float64())])


def rows(first, end):
    """Return the rows of some numbers."""
    numbers = range(first, end)
    return pa.table([[f'row {k}' for k in numbers], [k / 3.0 for k in numbers]], schema=SCHEMA)


def test_rows_are_added_at_the_end_in_groups_of_bounded_size(tmp_path):
    path, n = tmp_path / 'folder' / 'rows.parquet', 2 * GROUP_ROWS // 3
    for first in range(0, 4 * n, n):
        append_table(path, rows(first, first + n))
    assert read_table(path, SCHEMA, 'rows').equals(rows(0, 4 * n))
    sizes = [
        pq.read_metadata(path).row_group(k).num_rows
        for k in range(pq.read_metadata(path).num_row_groups)
    ]
    assert sum(sizes) == 4 * n
    assert max(sizes) <= GROUP_ROWS


def test_what_the_schema_says_beside_the_columns_is_kept(tmp_path):
    path = tmp_path / 'rows.parquet'
    for _ in range(2):
        append_table(path, rows(0, 3).replace_schema_metadata({'origin': 'here'}))
    assert pq.read_schema(path).metadata[b'origin'] == b'here'


@pytest.mark.parametrize('write', [append_table, write_table])
def test_a_write_that_fails_leaves_the_file_as_it_was(tmp_path, monkeypatch, write):
    path = tmp_path / 'rows.parquet'
    write(path, rows(0, 3))
    before = path.read_bytes()

    def full(*_, **__):
        raise OSError('no space left')

    monkeypatch.setattr('os.fsync', full)
    with pytest.raises(OSError, match='no space left'):
        write(path, rows(3, 6))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_no_file_has_no_rows_and_one_of_something_else_is_rejected(tmp_path):
    path = tmp_path / 'rows.parquet'
    assert read_table(path, SCHEMA, 'rows').num_rows == 0
    write_table(path, rows(0, 3).select(['value']))
    for content in (path.read_bytes(), b'my letters', b''):
        path.write_bytes(content)
        with pytest.raises(RrthError, match=r'rows\.parquet: .*; expected rows of mine$'):
            read_table(path, SCHEMA, 'rows of mine')
