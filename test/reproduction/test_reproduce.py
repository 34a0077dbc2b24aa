# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The reproduction writes its table and its pictures, and goes on where it was."""

from dataclasses import replace
import re

import pytest

pytest.importorskip('pyarrow')
pytest.importorskip('tqdm')
pytest.importorskip('matplotlib')
pytest.importorskip('distributed')

from matplotlib.figure import Figure
from matplotlib.image import imread
from rrth_planner.cli.reproduce import main
from rrth_planner.io.cluster import cluster_client
from rrth_planner.reproduction import path_club, run
from rrth_planner.reproduction.claims.plane import plane_claims
from rrth_planner.reproduction.experiments import (
    ALGORITHMS,
    LATTICES,
    PRINTED_DENSE,
    QUICK,
    RELATIVES,
    RRT,
    RRT_H,
)
from rrth_planner.reproduction.row_store import read_rows
from rrth_planner.reproduction.statistics import Rows

TINY = ('--quick', '--serial', '--runs', '2', '--seeds', '2', '--maps', 'c_shape', '--targets')
PICTURES = ('09', '10a', '10b', '11', '12', '14', '20', '21', 'relatives')


@pytest.fixture(scope='module')
def output(tmp_path_factory):
    """Return the folder of a tiny reproduction."""
    folder = tmp_path_factory.mktemp('reproduction')
    assert main([*TINY, 'low_left', '--output', str(folder)]) == 0
    return folder


def test_the_scheduler_that_is_named_does_the_runs_and_a_bar_shows_how_far_they_are(
    tmp_path, monkeypatch, capsys
):
    asked = [
        run.Run(problem='c_shape', algorithm=RRT, options=ALGORITHMS[RRT], seed=seed)
        for seed in range(6)
    ]
    monkeypatch.setattr('rrth_planner.reproduction.experiments.timed_runs', lambda _: asked[:2])
    monkeypatch.setattr('rrth_planner.reproduction.experiments.spread_runs', lambda _: asked[2:])
    # Six runs fill no table.
    monkeypatch.setattr('rrth_planner.reproduction.report.report', lambda *_: 'told')
    monkeypatch.setattr('rrth_planner.reproduction.figures.all.draw_pictures', lambda *_: {})
    with cluster_client(n_workers=1) as cluster:
        address = cluster.scheduler.address
        assert main(['--scheduler', address, '--output', str(tmp_path)]) == 0
        # The worker has loaded the kernels of what it ran.
        assert list(cluster.run(lambda: len(run._warm)).values()) == [1]
    rows = Rows(read_rows(tmp_path / 'reproduction.parquet').to_pylist())
    shown = capsys.readouterr().err
    for label, timing, n in (('one by one', 'serial', 2), ('side by side', 'cluster', 4)):
        assert len(rows.where(timing=timing)) == n
        assert re.search(rf'{label}: 100%\|.*\| {n}/{n} \[', shown), shown


def test_every_figure_is_drawn(output):
    for name in PICTURES:
        pixels = imread(output / 'images' / 'reproduction' / f'figure_{name}.png')[..., :3]
        assert pixels.shape[0] > 200
        assert (pixels < 0.95).any(axis=2).mean() > 0.01, name


def test_the_report_tells_what_the_paper_says_and_what_was_measured(output):
    text = (output / 'reproduction.md').read_text(encoding='utf-8')
    for told in ('181.28', '51.24 %', '33.11 %', '51.4 %', 'under 200', 'does not hold', 'RRT-H'):
        assert told in text, told
    for name in PICTURES:
        assert f'images/reproduction/figure_{name}.png' in text
    assert str(output) not in text
    assert 'do not edit' in text
    assert 'nan' not in text.lower().split()
    assert ' inf' not in text.lower().replace(' informed', '')


def test_a_second_time_runs_nothing_and_writes_the_same(output, monkeypatch):
    report, data = output / 'reproduction.md', output / 'reproduction.parquet'
    before, rows = report.read_text(encoding='utf-8'), data.read_bytes()
    report.unlink()

    # The two that Figure 14 shows are grown again; its shares come from rows.
    grown = []
    monkeypatch.setattr(
        path_club, 'search', lambda *a, f=path_club.search, **k: grown.append(a) or f(*a, **k)
    )
    # Pictures are made again; that they can be written the first time has shown.
    written = []
    monkeypatch.setattr(Figure, 'savefig', lambda _, path, **__: written.append(path.name))
    assert main([*TINY, 'low_left', '--output', str(output)]) == 0
    assert written == [f'figure_{name}.png' for name in PICTURES]
    assert 0 < len(grown) <= 16
    assert report.read_text(encoding='utf-8') == before
    assert data.read_bytes() == rows


def test_the_report_tells_what_spacings_cost_what_goal_bias_does_and_which_arm_it_is(output):
    text = (output / 'reproduction.md').read_text(encoding='utf-8')
    verdict = r'\*\*(holds|does not hold|undecided)\*\*'
    for claim in ('Denser P_C cost time', 'A smaller k costs time', 'Both cost time, .*'):
        cell = rf'{verdict}: [\d.]+ ms become [\d.]+ ms, \d+ waypoints \d+; \d of 2 seeds slower'
        assert re.search(rf'\| {claim}\. \| c_shape \| {cell} \| {cell} \|', text), claim
    for bias in ('none', '5 %'):
        assert re.search(rf'\| c_shape \| {bias} \| 2 of 2 \| \d+ \(', text), bias
    assert 'is that of Table 1 **holds**' in text
    assert re.search(r'\| L3 \| 0\.386 \| 0\.386 \|', text)
    told = re.sub(r'\s+', ' ', text)
    assert '10 check points lie on the first 1 m of the ray, every 10 cm' in told
    assert 'The first cost of RRT*-Smart is that of its first path as it shortened it' in told


def test_the_report_has_the_relatives_with_what_each_is_and_none_with_a_time(output):
    text = (output / 'reproduction.md').read_text(encoding='utf-8')
    part = text.partition('## Relatives that')[2].partition('\n## ')[0]
    for name in (RRT, RRT_H, *RELATIVES):
        for problem in ('c_shape', 'c_shape_near'):
            n = 1 if name in LATTICES else 2
            row = rf'\| {problem} \([\d.]+\) \| {re.escape(name)} \| {n} of {n} \| 100 % \|'
            assert re.search(row, part), (name, problem)
    assert 'There are no times' in part
    assert ' ms' not in part
    for begin in ('**RRT, potential field**', '**RRT-H, Dubins**', '**A***', '**PRM**', 'Shorter'):
        assert part.count(f'\n- {begin}') == 1, begin
    # Nothing that keeps to a lattice or to draws is as short as what is pulled round corners.
    assert 'Shorter than RRT-H in the median: none' in part


@pytest.mark.parametrize(
    ('n_slower', 'told'),
    [(10, '**holds**'), (9, '**holds**'), (8, '**undecided**'), (1, '**does not hold**')],
)
def test_whether_denser_points_cost_time_is_told_from_the_rows(output, n_slower, told):
    rows = [
        row | {'seed': seed, 'time_total': 2.0 if is_dense == (seed < n_slower) else 1.0}
        for seed in range(10)
        for row in read_rows(output / 'reproduction.parquet').to_pylist()
        if row['seed'] == 0
        for is_dense in [row['algorithm'] == PRINTED_DENSE]
    ]
    extent = replace(QUICK, few=10, many=10, maps=('c_shape',))
    (line,) = (c for c in plane_claims(Rows(rows), extent) if c[0] == 'Denser P_C cost time.')
    assert line[2].startswith(told)
    assert line[3].startswith(told)


@pytest.mark.parametrize('arguments', [('--runs', '0'), ('--maps', 'moon'), ('--runs', 'ten')])
def test_a_bad_command_line_is_rejected(arguments, capsys):
    # What the parser does not know the command does: names of maps, for which much is loaded.
    try:
        code = main(arguments)
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert 'reproduce: ' in capsys.readouterr().err


def test_data_that_are_no_campaign_are_rejected_in_one_sentence(tmp_path, capsys):
    (tmp_path / 'reproduction.parquet').write_bytes(b'something else')
    assert main([*TINY, 'low_left', '--output', str(tmp_path)]) == 1
    error = capsys.readouterr().err
    assert 'expected the rows of a campaign' in error
    assert 'Traceback' not in error
