# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The search for orders of events: the same twice, without a fault, and it finds known ones."""

from pathlib import Path
import subprocess
import sys

import pytest

pytest.importorskip('tqdm')

from benchmarks.monitor_search.__main__ import main
from benchmarks.monitor_search.faults import found_of

SEEDS = (0, 1, 2)
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize('seed', SEEDS)
def test_an_episode_is_the_same_twice_and_has_no_fault(seed):
    found = found_of('', seed)
    assert found.faults == []
    assert found.n_begun > 10
    assert found.n_stops > 3
    assert found_of('', seed) == found


def test_a_fault_that_is_put_back_is_found():
    faults = found_of('fault_without_effect', 1).faults
    assert any('a motion begins after a fault' in fault for fault in faults)


def test_the_command_prints_a_table_and_ends_with_1_where_there_is_a_fault(capsys):
    assert main(['--seeds', '3', '--fault', 'stop_cut_off']) == 1
    out = capsys.readouterr().out
    assert '| episodes | events |' in out
    assert 'seed 0: a command does not end at rest' in out


def test_processes_beside_each_other_find_what_one_does():
    # As a program: its children import what they run.
    command = [sys.executable, '-m', 'benchmarks.monitor_search', '--seeds', '2', '--jobs']
    tables = []
    for jobs in ('1', '2'):
        ran = subprocess.run([*command, jobs], capture_output=True, text=True, cwd=ROOT)
        assert ran.returncode == 0, ran.stderr
        tables.append(ran.stdout.splitlines()[:-1])
    assert tables[0] == tables[1]
