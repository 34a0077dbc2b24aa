# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files of queries, as tables write them: read alike, or rejected by a sentence."""

import pytest

pa = pytest.importorskip('pyarrow')

import pyarrow.parquet as pq
from rrth_planner.io import query_file
from rrth_planner.io.query_file import (
    other_columns,
    query_schema,
    read_queries,
    start_columns,
)
from rrth_planner.model.errors import RrthError

ROWS = {
    'subject': ['a', 'b', 'c'],
    'target_x': [1.5, 1.0, None],
    'target_y': [0.8, 0.1, 0.2],
    'target_z': [0.6, -0.3, 0.1],
    'start_1': [0.0, None, 0.5],
    'start_2': [-0.35, None, 0.25],
    'arm': [None, 'arms/long.yaml', None],
    'seed': [7, None, 2147483647],
}
HEAD = 'target_x,target_y,target_z'


def table_of(paths, size=100):
    """Return the rows of all files."""
    return pa.concat_tables(table for _, table in read_queries(paths, size))


def test_both_kinds_of_file_say_the_same_as_pandas_writes_them(tmp_path):
    pandas = pytest.importorskip('pandas')
    frame = pandas.DataFrame(ROWS)
    # A missing seed makes numbers with a point of all of them.
    assert frame['seed'].dtype == float
    csv, parquet = tmp_path / 'queries.csv', tmp_path / 'queries.parquet'
    frame.to_csv(csv, index=False)
    frame.to_parquet(parquet, index=False)
    for path in (csv, parquet):
        assert table_of([path]).to_pydict() == ROWS
    schema, n = query_schema([csv, parquet], ())
    assert n == 6
    assert schema.field('seed').type == pa.int64()
    assert start_columns(schema.names) == ['start_1', 'start_2']
    assert other_columns(schema.names) == ['subject']


def test_polars_writes_what_is_read(tmp_path):
    polars = pytest.importorskip('polars')
    path = tmp_path / 'queries.parquet'
    # Its missing numbers may be NaN.
    polars.DataFrame({**ROWS, 'target_x': [1.5, 1.0, float('nan')]}).write_parquet(path)
    assert table_of([path]).to_pydict() == ROWS


def test_rows_come_in_their_order_however_many_at_a_time(tmp_path, monkeypatch):
    # Blocks of few rows.
    monkeypatch.setattr(query_file, '_BLOCK', 400)
    paths = [tmp_path / 'first.csv', tmp_path / 'second.csv']
    for path, first in zip(paths, (0, 100), strict=True):
        lines = [f'{k},0.0,0.5' for k in range(first, first + 100)]
        path.write_text('\n'.join([HEAD, *lines]))
    found = list(read_queries(paths, 7))
    assert max(len(table) for _, table in found) == 7
    assert [k for _, table in found for k in table['target_x'].to_pylist()] == list(range(200))
    assert [path for path, _ in found] == sorted(path for path, _ in found)
    assert query_schema(paths, ())[1] == 200


def test_every_other_column_of_a_csv_file_is_as_parquet_keeps_it(tmp_path):
    path, kept = tmp_path / 'queries.csv', tmp_path / 'kept.parquet'
    values = '2026-01-02,2026-01-02 10:00:00,2026-01-02T10:00:00Z,10:00:00,true,a,'
    path.write_text(f'{HEAD},day,time,zoned,clock,flag,text,nothing\n1,2,3,{values}\n')
    table = table_of([path])
    pq.write_table(table, kept)
    assert pq.read_table(kept).equals(table)
    assert pq.read_schema(kept).equals(query_schema([path], ())[0])


def test_whole_numbers_are_numbers(tmp_path):
    path = tmp_path / 'queries.parquet'
    pq.write_table(pa.table({name: [1, 2] for name in HEAD.split(',')}), path)
    assert query_schema([path], ())[0].field('target_x').type == pa.float64()


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', 'expected queries, a .csv or .parquet file with the columns target_x, target_y'),
        ('target_x,target_y\n1,2\n', 'no column target_z, expected queries'),
        (f'{HEAD}\n1,2,far\n', "invalid value 'far'"),
        (f'{HEAD}\n1,2,3\n1,2\n', 'Expected 3 columns, got 2'),
        (f'{HEAD},seed\n1,2,3,1.5\n', 'truncated'),
        (f'{HEAD},start_2\n1,2,3,0\n', 'columns start_2, expected start_1'),
        (f'{HEAD},status\n1,2,3,0\n', 'columns status, expected different names'),
        (f'{HEAD},a,a\n1,2,3,0,0\n', 'expected different names'),
    ],
)
def test_a_bad_csv_file_is_a_sentence(tmp_path, text, words):
    path = tmp_path / 'queries.csv'
    path.write_text(text)
    with pytest.raises(RrthError, match=r'queries\.csv: ') as error:
        query_schema([path], ('status',))
    assert words in str(error.value)


@pytest.mark.parametrize(
    ('name', 'words'),
    [
        ('letters.parquet', 'letters.parquet: '),
        ('texts.parquet', 'column target_x: texts, expected numbers'),
        ('half.parquet', 'expected queries'),
        ('queries.xlsx', 'another kind of file; expected queries, a .csv or .parquet file'),
        ('none.csv', 'none.csv: No such file or directory; expected queries, '),
        ('none.parquet', 'none.parquet: No such file or directory; expected queries, '),
    ],
)
def test_a_bad_file_of_another_kind_is_a_sentence(tmp_path, name, words):
    (tmp_path / 'letters.parquet').write_bytes(b'my letters')
    (tmp_path / 'queries.xlsx').write_bytes(b'PK')
    texts = pa.table({column: ['1', '2'] for column in HEAD.split(',')})
    pq.write_table(texts, tmp_path / 'texts.parquet')
    half = (tmp_path / 'texts.parquet').read_bytes()
    (tmp_path / 'half.parquet').write_bytes(half[: len(half) // 2])
    with pytest.raises(RrthError) as error:
        query_schema([tmp_path / name], ())
    assert words in str(error.value)


def test_files_with_other_columns_are_no_campaign(tmp_path):
    first, second = tmp_path / 'first.csv', tmp_path / 'second.csv'
    first.write_text(f'{HEAD},mass\n1,2,3,70\n')
    second.write_text(f'{HEAD},mass\n1,2,3,heavy\n')
    with pytest.raises(
        RrthError, match=r'second.csv: .*mass \(string\), expected those of .*int64'
    ):
        query_schema([first, second], ())
