# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm with masses and servos executes what is planned; one that is worse is found."""

from dataclasses import replace

import pytest

pytest.importorskip('tqdm')
pytest.importorskip('mujoco')
pytest.importorskip('rclpy')

from benchmarks.physics import people, servos
from benchmarks.physics.setting import LAGS, Setup
from benchmarks.separation.people import Take
from benchmarks.separation.setting import Case
import numpy as np


def late(judged):
    """Return how late an arm was in the median [s]."""
    return float(np.median(judged.lags))


def test_arms_that_lag_more_are_later_and_none_is_taken_to_ignore_a_stop():
    found = [servos.chain_of_motions(2, seed) for seed in range(len(LAGS))]
    assert [one.setup.lag for one in found] == list(LAGS)
    times = [late(one) for one in found]
    assert times == sorted(times)
    assert times[-1] > 5.0 * times[0] > 0.0
    for one in found:
        assert (one.n_motions, one.n_stops) == (2, 1)
        assert not one.n_contacts + one.n_suspended + one.n_alarms + one.n_other
        assert 0.0 < one.clearance < 1.0
    errors = [one.error for one in found]
    assert errors == sorted(errors)
    rows = [line.split('|')[1:-1] for line in servos.lines_of(found)]
    assert [float(row[0]) for row in rows] == [1e3 * lag for lag in LAGS]
    assert len(servos.HEADER.split('|')[1:-1]) == len(rows[0])


def test_all_arms_have_their_turn():
    setups = {servos.setup_of(seed) for seed in range(36)}
    assert len(setups) == 36


def test_an_arm_that_ignores_its_stop_is_found(monkeypatch):
    execute, moved = servos.SimulatedArm.execute, []

    def ignore(arm, points, stamp):
        if arm not in moved:
            moved.append(arm)
            execute(arm, points, stamp)

    monkeypatch.setattr(servos.SimulatedArm, 'execute', ignore)
    found = [servos.chain_of_motions(2, seed) for seed in (1, 2)]
    assert sum(one.n_alarms for one in found) > 0


def test_beside_a_person_an_arm_that_lags_as_assumed_meets_nobody_faster_than_allowed():
    setup, case = people.CASES[2]
    found = people.beside_person(8.0, (Take('', 1.0), setup, case))
    assert sum(found.record.outcomes.values()) > 0
    assert found.error > 0.01
    assert not people.sentences_of(found)
    row = people.line_of([found]).split('|')[1:-1]
    assert len(people.HEADER.split('|')[1:-1]) == len(row)


def test_an_arm_without_strength_is_seen_to_miss():
    setup = Setup(0.03, 0.02, 1.3)
    found = people.beside_person(3.0, (Take('', 1.0), setup, Case()))
    exact = people.beside_person(3.0, (Take('', 1.0), replace(setup, lag=0.002), Case()))
    assert found.error > 2.0 * exact.error > 0.0
