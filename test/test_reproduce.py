# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The reproduction writes its table and its pictures, and goes on where it was."""

import pytest

pytest.importorskip('pyarrow')
pytest.importorskip('tqdm')
pytest.importorskip('matplotlib')

from matplotlib.image import imread
from rrth_planner.reproduce import main

TINY = ('--quick', '--serial', '--runs', '2', '--seeds', '2', '--maps', 'c_shape', '--targets')
PICTURES = ('09', '10a', '10b', '11', '12', '14', '20', '21')


@pytest.fixture(scope='module')
def output(tmp_path_factory):
    """Return the folder of a tiny reproduction."""
    folder = tmp_path_factory.mktemp('reproduction')
    assert main([*TINY, 'low_left', '--output', str(folder)]) == 0
    return folder


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

    def refuse(*_):
        raise AssertionError('a run was done again')

    monkeypatch.setattr('rrth_planner.campaign.cluster.execute', refuse)
    assert main([*TINY, 'low_left', '--output', str(output)]) == 0
    assert report.read_text(encoding='utf-8') == before
    assert data.read_bytes() == rows


@pytest.mark.parametrize('arguments', [('--runs', '0'), ('--maps', 'moon'), ('--runs', 'ten')])
def test_a_bad_command_line_is_refused(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert 'reproduce: error' in capsys.readouterr().err


def test_data_that_are_no_campaign_are_refused_in_one_sentence(tmp_path, capsys):
    (tmp_path / 'reproduction.parquet').write_bytes(b'something else')
    assert main([*TINY, 'low_left', '--output', str(tmp_path)]) == 1
    error = capsys.readouterr().err
    assert 'expected the rows of a campaign' in error
    assert 'Traceback' not in error
