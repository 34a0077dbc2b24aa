# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Campaigns of plans: as `plan` makes them, on one worker or two, continued, never lost."""

import json
import re
import shutil

import pytest

for needed in ('fcl', 'distributed', 'tqdm'):
    pytest.importorskip(needed)
pa = pytest.importorskip('pyarrow')

import pyarrow.parquet as pq
from rrth_planner.cli import campaign, plan, query_batch
from rrth_planner.io import cluster
from rrth_planner.io.cluster import cluster_client
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_values

HEAD = 'target_x,target_y,target_z,start_1,start_2,start_3,start_4,arm,body,seed,subject'
CHEST = 'files/chest_arm.yaml'
SEATED = 'files/seated_body.yaml'
# What is wrong with each, in words of its sentence.
BAD = {
    ',0.8,0.6,,,,,,,1,a': 'target: [None, 0.8, 0.6], expected numbers of shape (3) [m]',
    'inf,0.8,0.6,,,,,,,1,a': 'target: [inf, 0.8, 0.6], expected finite numbers [m]',
    '1,1,1,0,0,,,,,1,a': 'start: 2 values, expected 4, one for each of',
    '1,1,1,0,,0,0,,,1,a': 'start: [0.0, None, 0.0, 0.0], expected numbers of shape (4) [rad or m]',
    '1,1,1,,,,,,,-3,a': 'seed: -3, expected 0 to 2147483647 [-]',
    '1,1,1,,,,,files/none.yaml,,1,a': 'files/none.yaml: No such file or directory',
    '1,1,1,,,,,files/bad.yaml,,1,a': 'files/bad.yaml: arm: no joints, tool, mount',
    '1,1,1,,,,,,files/bad.yaml,1,a': 'files/bad.yaml: body: ',
}
# As arguments of `plan`, and as rows.
GOOD = {
    f'{x},0.8,{z},,,,,,,{seed},b': ['--target', x, '0.8', z, '--seed', seed]
    for seed, (x, z) in enumerate(
        (x, z) for x in ('1.5', '0.9', '-1.0') for z in ('0.6', '0.1', '-0.4', '1.2')
    )
    for seed in [str(seed)]
} | {
    '1.5,0.8,0.6,0,-0.35,1.5,1.5,,,5,c': [
        *('--target', '1.5', '0.8', '0.6', '--from', '0', '-0.35', '1.5', '1.5', '--seed', '5')
    ],
    # Without a seed of its own it has its number.
    f'1,0.5,0,,,,,{CHEST},{SEATED},,d': [
        *('--target', '1', '0.5', '0', '--arm', CHEST, '--body', SEATED, '--seed', '13')
    ],
    '0,0,0,,,,,,,3,e': ['--target', '0', '0', '0', '--seed', '3'],
}
# What the clock says.
CLOCK = re.compile(r'planning time [\d.]+ ms')


@pytest.fixture(scope='module', name='folder')
def _folder(tmp_path_factory):
    """Give a folder with queries and what they name."""
    folder = tmp_path_factory.mktemp('campaign')
    (folder / 'files').mkdir()
    for name in ('chest_arm.yaml', 'seated_body.yaml'):
        shutil.copy(resource_path(f'config/examples/{name}'), folder / 'files' / name)
    (folder / 'files' / 'bad.yaml').write_text('name: nothing\n')
    (folder / 'queries.csv').write_text('\n'.join([HEAD, *GOOD, *BAD]))
    return folder


@pytest.fixture(scope='module', name='two')
def _two():
    """Give the address of a scheduler with two workers."""
    with cluster_client(n_workers=2) as client:
        yield client.scheduler.address


@pytest.fixture(scope='module', name='plans')
def _plans(folder, two):
    """Give the file of the plans."""
    path = folder / 'plans.parquet'
    queries = [str(folder / 'queries.csv')]
    assert campaign.main([*queries, '--output', str(path), '--scheduler', two]) == 0
    return path


def timeless(path):
    """Return the rows of a file without what the clock says."""
    rows = pq.read_table(path).drop_columns('planning_time_s').to_pylist()
    return [{**row, 'sentence': CLOCK.sub('', row['sentence'])} for row in rows]


def test_a_row_has_the_figures_that_plan_prints(plans, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    rows = timeless(plans)
    for row, arguments in zip(rows, GOOD.values(), strict=False):
        code = plan.main([*arguments, '--json'])
        figures = json.loads(capsys.readouterr().out)
        assert code == (row['status'] != 'solved')
        end = figures.get('end', {'q': None})['q']
        assert row['end'] == end
        for name in {*figures} - {'start', 'end', 'planning_time_s', 'sentence'}:
            assert row[name] == figures[name], name
        assert row['sentence'] == CLOCK.sub('', figures['sentence'])
    assert [row['subject'] for row in rows[:3]] == ['b'] * 3
    found = {row['status'] for row in rows[: len(GOOD)]}
    assert {'solved', 'goal in collision'} <= found


def test_a_bad_query_is_a_row_with_a_sentence(plans):
    rows = timeless(plans)[len(GOOD) :]
    assert len(rows) == len(BAD)
    for row, words in zip(rows, BAD.values(), strict=True):
        assert row['status'] == 'invalid query'
        assert words in row['sentence']
        assert row['duration_s'] is None


def test_one_worker_and_two_give_the_same(plans, folder, tmp_path, capsys):
    path = tmp_path / 'plans.parquet'
    queries = str(folder / 'queries.csv')
    assert campaign.main([queries, '--output', str(path), '--workers', '1']) == 0
    assert timeless(path) == timeless(plans)
    said = capsys.readouterr()
    n = len(GOOD) + len(BAD)
    assert f'{path}, {n} plans\n' in said.out
    assert re.search(rf'^invalid query +{len(BAD)}$', said.out, re.M)
    assert re.search(rf'^this time +{n} plans in [\d.]+ s on 1 worker: ', said.out, re.M)
    assert f'| {n}/{n} [' in said.err
    assert 'columns that mean nothing to the planner are kept: subject' in said.err


def cut(plans, path, n):
    """Write a file as a campaign that was interrupted leaves it."""
    pq.write_table(pq.read_table(plans).slice(0, n), path)


@pytest.mark.parametrize('n', [1, 7, len(GOOD)])
def test_a_campaign_goes_on_after_the_last_plan(plans, folder, two, tmp_path, capsys, n):
    path, queries = tmp_path / 'plans.parquet', str(folder / 'queries.csv')
    cut(plans, path, n)
    assert campaign.main([queries, '--output', str(path), '--scheduler', two]) == 0
    assert f'{len(GOOD) + len(BAD) - n} plans in ' in capsys.readouterr().out
    assert timeless(path) == timeless(plans)
    kept = pq.read_table(plans, columns=['planning_time_s']).slice(0, n)
    assert pq.read_table(path, columns=['planning_time_s']).slice(0, n).equals(kept)


def test_batches_of_many_queries_end_within_what_is_there(
    plans, folder, two, tmp_path, monkeypatch
):
    monkeypatch.setattr(campaign, 'FEWEST_TASKS', 4)
    path, queries = tmp_path / 'plans.parquet', str(folder / 'queries.csv')
    cut(plans, path, 7)
    assert campaign.main([queries, '--output', str(path), '--scheduler', two]) == 0
    assert timeless(path) == timeless(plans)


def test_an_interruption_keeps_what_was_planned(plans, folder, two, tmp_path, monkeypatch, capsys):
    path, queries = tmp_path / 'plans.parquet', str(folder / 'queries.csv')
    asked = [queries, '--output', str(path), '--scheduler', two]
    real = cluster.in_order

    def interrupted(*arguments):
        results = real(*arguments)
        for _ in range(3):
            yield next(results)
        raise KeyboardInterrupt

    monkeypatch.setattr(cluster, 'in_order', interrupted)
    assert campaign.main(asked) == 130
    assert f'interrupted; the next start continues from {path}\n' in capsys.readouterr().err
    assert timeless(path) == timeless(plans)[:3]
    monkeypatch.undo()
    assert campaign.main(asked) == 0
    assert timeless(path) == timeless(plans)


def test_what_is_planned_is_not_planned_again(plans, folder, capsys):
    before = plans.read_bytes()
    # There is no such scheduler.
    asked = [str(folder / 'queries.csv'), '--output', str(plans), '--scheduler', 'tcp://nowhere:1']
    assert campaign.main(asked) == 0
    assert 'nothing was left to be planned' in capsys.readouterr().out
    assert plans.read_bytes() == before


def test_queries_that_are_added_at_the_end_are_planned_too(plans, folder, two, tmp_path):
    path, longer = tmp_path / 'plans.parquet', folder / 'longer.csv'
    shutil.copy(plans, path)
    longer.write_text('\n'.join([HEAD, *GOOD, *BAD, '1.5,0.8,0.6,,,,,,,0,z']))
    assert campaign.main([str(longer), '--output', str(path), '--scheduler', two]) == 0
    first, *_, last = timeless(path)
    assert len(timeless(path)) == len(GOOD) + len(BAD) + 1
    assert last == {**first, 'subject': 'z'}


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (('--margin', '0.03'), 'planned with other values of margin, expected those given'),
        (('--seed', '4'), 'plan 13 is of another query, arm, wearer or seed'),
        (('other.csv',), 'plan 2 is of another query'),
        (('shorter.csv',), '23 plans, expected at most 5, the number of queries'),
        (('fewer.csv',), 'plans of queries with other columns'),
    ],
)
def test_a_file_of_another_campaign_is_kept(
    plans, folder, tmp_path, monkeypatch, capsys, change, words
):
    rows = [*GOOD, *BAD]
    for name, lines in {
        'queries.csv': [HEAD, *rows],
        'other.csv': [HEAD, *rows[:2], rows[3], *rows[3:]],
        'shorter.csv': [HEAD, *rows[:5]],
        'fewer.csv': ['target_x,target_y,target_z', '1,1,1'],
    }.items():
        (tmp_path / name).write_text('\n'.join(lines))
    shutil.copytree(folder / 'files', tmp_path / 'files')
    path = tmp_path / 'plans.parquet'
    shutil.copy(plans, path)
    queries = change[0] if change[0].endswith('.csv') else 'queries.csv'
    monkeypatch.chdir(tmp_path)
    asked = [queries, '--output', str(path), *(() if queries in change else change)]
    assert campaign.main(asked) == 2
    assert words in capsys.readouterr().err
    assert path.read_bytes() == plans.read_bytes()


def test_an_arm_that_was_edited_is_another_arm(plans, folder, tmp_path, capsys):
    for name in ('queries.csv', 'plans.parquet'):
        shutil.copy(folder / name, tmp_path / name)
    shutil.copytree(folder / 'files', tmp_path / 'files')
    arm = tmp_path / CHEST
    arm.write_text(f'{arm.read_text()}# of steel\n')
    asked = [str(tmp_path / 'queries.csv'), '--output', str(tmp_path / 'plans.parquet')]
    assert campaign.main(asked) == 2
    assert 'plan 13 is of another query, arm' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['queries.csv', '--output', 'plans.csv'], 'expected a name that ends in .parquet'),
        (['none.csv', '--output', 'p.parquet'], 'none.csv'),
        (['empty.csv', '--output', 'p.parquet'], 'empty.csv: no query, expected some'),
        (['queries.csv', '--output', 'letters.parquet'], 'expected the plans of a campaign'),
        (['queries.csv', '--output', 'table.parquet'], 'another Parquet file, expected the plans'),
        (['queries.csv', '--output', 'p.parquet', '--arm', 'no.yaml'], 'no.yaml'),
        (['queries.csv', '--output', 'p.parquet', '--body', 'no.yaml'], 'no.yaml'),
        (['queries.csv', '--output', 'p.parquet', '--settings', 'no.yaml'], 'no.yaml'),
        (['queries.csv', '--output', 'p.parquet', '--seed', '-2'], 'seed: -2, expected -1 to'),
        (['queries.csv', '--output', 'p.parquet', '--margin', '-2'], 'margin: -2.0, expected'),
    ],
)
def test_wrong_input_is_a_sentence(folder, tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    shutil.copy(folder / 'queries.csv', tmp_path)
    (tmp_path / 'empty.csv').write_text(f'{HEAD}\n')
    (tmp_path / 'letters.parquet').write_bytes(b'my letters')
    pq.write_table(pa.table({'a': [1]}), tmp_path / 'table.parquet')
    files = {file: file.read_bytes() for file in tmp_path.iterdir()}
    assert campaign.main(arguments) == 2
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith('campaign: ')
    assert words in said[-1]
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == files


@pytest.mark.parametrize(
    'extra', [['--workers', '0'], ['--workers', '2', '--scheduler', 'tcp://h:1']]
)
def test_wrong_usage_ends_with_2(extra, capsys):
    with pytest.raises(SystemExit) as end:
        campaign.main(['queries.csv', '--output', 'plans.parquet', *extra])
    assert end.value.code == 2
    assert 'usage: campaign' in capsys.readouterr().err


def test_a_query_that_fails_as_none_should_ends_no_other(folder, monkeypatch):
    from rrth_planner.pipeline import plan_motion

    def failing(question, *others):
        return 1 / 0 if question.seed == 1 else real(question, *others)

    real = plan_motion.plan_question
    monkeypatch.setattr(plan_motion, 'plan_question', failing)
    (batch,) = query_batch.read_batches(
        [folder / 'queries.csv'], 64, arm='', body='', seed=None, settings=load_values(4)
    )
    rows = query_batch.planned(batch).to_pylist()
    assert rows[1]['status'] == 'error'
    assert rows[1]['sentence'] == 'ZeroDivisionError: division by zero'
    assert rows[0]['status'] == rows[4]['status'] == 'solved'


def test_workers_of_other_versions_are_rejected(folder, two, tmp_path, monkeypatch, capsys):
    from rrth_planner.io import incident

    other = {**incident.versions(), 'sources': 'edited'}
    monkeypatch.setattr(incident, 'versions', lambda: other)
    path = tmp_path / 'plans.parquet'
    asked = [str(folder / 'queries.csv'), '--output', str(path), '--scheduler', two]
    assert campaign.main(asked) == 2
    assert re.search(
        r'worker tcp://\S+: sources \w+, expected edited, as here', capsys.readouterr().err
    )
    assert not path.exists()


def test_pandas_and_polars_read_the_file(plans):
    pandas = pytest.importorskip('pandas')
    frame = pandas.read_parquet(plans)
    assert frame.groupby('status').size()['invalid query'] == len(BAD)
    assert (frame['clearance_m'].dropna() >= 0.02 - 1e-6).all()
    polars = pytest.importorskip('polars')
    assert polars.read_parquet(plans).shape == frame.shape
