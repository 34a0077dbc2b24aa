# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The search for orders of events: the same twice, without a fault, and it finds known ones."""

import pytest

pytest.importorskip('tqdm')

from benchmarks.monitor_search.__main__ import found_of, main

SEEDS = (0, 1, 2)


@pytest.mark.parametrize('seed', SEEDS)
def test_an_episode_is_the_same_twice_and_has_no_fault(seed):
    found = found_of('', seed)
    assert found.faults == []
    assert found.n_begun > 10
    assert found.n_stops > 3
    assert found_of('', seed) == found


# The seeds that find them.
@pytest.mark.parametrize(
    ('fault', 'seed', 'what'),
    [
        ('stop_cut_off', 0, 'a command does not end at rest'),
        ('fault_without_effect', 1, 'a motion begins after a fault'),
    ],
)
def test_a_fault_that_is_put_back_is_found(fault, seed, what):
    assert any(what in found for found in found_of(fault, seed).faults)


def test_the_command_prints_a_table_and_ends_with_1_where_there_is_a_fault(capsys):
    assert main(['--seeds', '3', '--fault', 'reset_without_effect']) == 1
    out = capsys.readouterr().out
    assert '| episodes | events |' in out
    assert 'seed 0: no motion begins any more' in out
