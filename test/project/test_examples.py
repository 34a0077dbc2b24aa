# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The examples run, from anywhere, and tell what they found."""

from pathlib import Path
import runpy
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / 'examples').glob('*.py'))
# What each of them tells.
TOLD = {
    '01_plan_on_a_map': 'spiral: solved',
    '02_plan_on_the_arm': 'aim at the target; solved',
    '03_compare_planners': 'RRT-H',
    '04_a_motion_round_the_wearer': 'solved: 2 waypoints, duration',
    '05_plans_in_processes': 'solved 1.',
}


def run(example, folder, *arguments, is_refused=False):
    """Return what an example prints, or what it says where it refuses, in a process of its own."""
    code = f'import runpy, sys; sys.path.insert(0, {str(ROOT)!r}); sys.argv[1:] = {arguments!r}; '
    code += f"runpy.run_path({str(example)!r}, run_name='__main__')"
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode == 0) == (not is_refused), done.stderr
    return done.stderr if is_refused else done.stdout


@pytest.mark.parametrize('example', EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_is_short(example, tmp_path):
    assert TOLD[example.stem] in run(example, tmp_path)
    assert len(example.read_text(encoding='utf-8').splitlines()) < 60


def test_the_first_example_plans_on_a_map_of_ones_own(tmp_path):
    (tmp_path / 'gate.yaml').write_text(
        'bounds: [0, 0, 60, 40]\nstart: [5, 20]\ngoal: [55, 20]\n'
        'rectangles:\n  - [28, 0, 32, 25]\n',
        encoding='utf-8',
    )
    told = run(EXAMPLES[0], tmp_path, 'gate.yaml')
    assert 'solved' in told
    assert '[28.0, 25.0]' in told


@pytest.mark.parametrize(
    ('text', 'told'),
    [
        ('start: [5, 20]\nboxes: []\nwalls: []\n', 'map "gate": walls unknown, expected only'),
        ('start: [5, 20\n', 'expected a readable YAML file'),
    ],
)
def test_a_bad_map_is_refused_by_the_examples_in_one_sentence(text, told, tmp_path, monkeypatch):
    (tmp_path / 'gate.yaml').write_text(text, encoding='utf-8')
    monkeypatch.chdir(tmp_path)
    for example in (EXAMPLES[0], EXAMPLES[2]):
        monkeypatch.setattr(sys, 'argv', [str(example), 'gate.yaml'])
        with pytest.raises(SystemExit) as refusal:
            runpy.run_path(str(example), run_name='__main__')
        # Python prints such a code to standard error, and ends with 1.
        said = refusal.value.code
        assert isinstance(said, str)
        assert told in said
        assert len(said.splitlines()) == 1


def test_a_bad_map_is_refused_without_a_traceback(tmp_path):
    (tmp_path / 'gate.yaml').write_text('walls: []\n', encoding='utf-8')
    said = run(EXAMPLES[0], tmp_path, 'gate.yaml', is_refused=True)
    assert 'map "gate": ' in said
    assert len(said.splitlines()) == 1
