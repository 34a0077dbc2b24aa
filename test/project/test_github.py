# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What GitHub reads: workflows that name what there is, forms that ask for what a report needs."""

from pathlib import Path
import re
import shutil
import subprocess

import pytest
from rrth_planner.cli.rrth import COMMANDS
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / '.github'
WORKFLOWS = sorted((FOLDER / 'workflows').glob('*'))
FORMS = sorted(f for f in (FOLDER / 'ISSUE_TEMPLATE').glob('*') if f.name != 'config.yml')
# What the workflow starts by ./run exec and is no command of the package.
OTHERS = {'python -m colcon'}
BASH = shutil.which('bash')
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason='no part of an installation')


def loaded(file):
    """Return what a file holds."""
    return yaml.safe_load(file.read_text(encoding='utf-8'))


def jobs():
    """Return all jobs of all workflows."""
    found = [job for file in WORKFLOWS for job in loaded(file)['jobs'].values()]
    assert len(found) >= 2
    return found


def scripts():
    """Return what the jobs have a shell do."""
    return [step['run'] for job in jobs() for step in job['steps'] if 'run' in step]


def test_a_workflow_may_only_read_and_ends():
    for file in WORKFLOWS:
        assert loaded(file)['permissions'] == {'contents': 'read'}
        assert 'Written without a run' in file.read_text(encoding='utf-8').partition('name:')[0]
    for job in jobs():
        assert 0 < job['timeout-minutes'] <= 180
        for step in job['steps']:
            assert ('run' in step) != ('uses' in step)
            assert re.fullmatch(r'actions/[\w-]+@v\d+', step.get('uses', 'actions/none@v0'))


@pytest.mark.skipif(BASH is None, reason='no bash')
@pytest.mark.parametrize('script', scripts())
def test_a_shell_reads_the_scripts(script):
    read = subprocess.run([BASH, '-n'], input=script, capture_output=True, text=True)
    assert read.returncode == 0, read.stderr


def test_scripts_start_what_there_is():
    text = '\n'.join(scripts())
    usage = (ROOT / 'run').read_text(encoding='utf-8')
    started = re.findall(r'\./run (\w+) ?(.*)', text)
    assert {word for word, _ in started} >= {'test', 'exec'}
    for word, rest in started:
        assert f'./run {word}' in usage
        if word == 'exec':
            assert rest.split()[0] in COMMANDS or any(map(rest.startswith, OTHERS)), rest
    for name in re.findall(r'(?:ros2 run rrth_planner|/rrth) (\w+)', text):
        assert name in COMMANDS
    (names,) = re.findall(r'for file in (.*); do', text)
    there = {file.name for file in (ROOT / 'launch').glob('*.py')}
    assert {f'{name}_launch.py' for name in names.split()} == there
    # Options after --pytest-args choose tests by the names of their files.
    chosen = re.search(r'-k "(\w+) or (\w+)"', text).groups()
    for part in chosen:
        assert list((ROOT / 'test').rglob(f'test_*{part}*.py'))


def test_caches_are_named_by_files_that_there_are():
    text = '\n'.join(file.read_text(encoding='utf-8') for file in WORKFLOWS)
    patterns = re.findall(r"'((?:requirements|rrth_planner)/[^']*)'", text)
    assert len(patterns) > 3
    for pattern in (*patterns, *re.findall(r'cache-dependency-path: (\S+)', text)):
        assert [path for path in ROOT.glob(pattern) if path.exists()], pattern


def test_the_workflow_has_every_python_of_the_package():
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    (versions,) = [job['strategy']['matrix']['python'] for job in jobs() if 'strategy' in job]
    assert versions == re.findall(r'Python :: (3\.\d+)', text)


@pytest.mark.parametrize('file', FORMS, ids=lambda file: file.stem)
def test_a_form_is_one(file):
    form = loaded(file)
    assert form['name'] and form['description']
    fields = [field for field in form['body'] if field['type'] != 'markdown']
    names = [field['id'] for field in fields]
    assert len(set(names)) == len(names)
    for field in fields:
        assert field['type'] in ('textarea', 'input', 'dropdown', 'checkboxes')
        assert field['attributes']['label']
    assert any(field.get('validations', {}).get('required') for field in fields)


def test_a_bug_report_asks_for_what_replays_it():
    (bug,) = [loaded(file) for file in FORMS if file.stem == 'bug_report']
    asked = {field.get('id') for field in bug['body']}
    assert asked >= {'incident', 'versions', 'arm', 'parameters', 'diagnostics'}
    text = str(bug)
    for command in re.findall(r'\./run exec (\w+)', text):
        assert command in COMMANDS
    for path in re.findall(r'(?:config|docs)/[\w.]+\.\w+', text):
        assert (ROOT / path).is_file(), path
    assert '(../security/policy)' in text
    assert (FOLDER / 'SECURITY.md').is_file()
