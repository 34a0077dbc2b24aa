# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The bench of handovers: what its judge sees, and what it says of the planner."""

import numpy as np
import pytest

pytest.importorskip('tqdm')
pytest.importorskip('rclpy')

from benchmarks.handover.__main__ import cases_of, END, line_of, TOP, write_block
from benchmarks.handover.judge import (
    BEGIN,
    EXTENSION,
    HANDOVER,
    Join,
    Judge,
    MOST_FAST,
    STOP,
    summed,
)
from benchmarks.handover.session import Case, joins_of
from rrth_planner.model.trajectory import sample
from rrth_planner.simulation.trajectory_controller import ControllerVersion
from simulation_samples import motion_between
from worlds import FOLDED, limits

V4_20, V4_42, V6_9, BLENDING = ControllerVersion
QUICK = motion_between(FOLDED, FOLDED - 0.6, 1.0)


def judged(curve, rate):
    """Return what a judge sees of a curve of time [s], replaced at its beginning."""
    judge = Judge(1.0 / rate, limits())
    judge.replaced(HANDOVER, curve(0.0), curve(0.0))
    for k in range(rate):
        judge.commanded(curve(k / rate))
    return judge.joins[0]


@pytest.mark.parametrize('rate', [200, 500, 1000])
def test_a_smooth_curve_has_its_own_speed_and_acceleration(rate):
    join = judged(lambda t: sample(QUICK, [t])[0][0], rate)
    _, v, a = sample(QUICK, np.linspace(0.0, 1.0, 2001))
    assert join.velocity == pytest.approx(np.abs(v).max() / 1.5, rel=1e-3)
    assert join.acceleration == pytest.approx(np.abs(a).max() / 4.0, rel=1e-3)


@pytest.mark.parametrize('rate', [200, 500, 1000])
def test_a_step_and_a_kink_show_and_rounding_does_not(rate):
    step = judged(lambda t: FOLDED + 1e-5 * (t > 0.2), rate)
    kink = judged(lambda t: FOLDED + 0.02 * max(t - 0.2, 0.0), rate)
    assert step.acceleration == pytest.approx(1e-5 * rate**2 / 4.0, rel=1e-6)
    assert kink.acceleration == pytest.approx(0.02 * rate / 4.0, rel=0.6)
    smooth = judged(lambda t: sample(QUICK, [t])[0][0], rate)
    rounded = judged(lambda t: sample(QUICK, [t + 5e-10 * (t > 0.2)])[0][0], rate)
    assert abs(rounded.acceleration - smooth.acceleration) < MOST_FAST - 1.01


def test_the_sum_counts_what_is_beyond():
    joins = [
        Join(HANDOVER, 2e-4, 0.9, 0.9),
        Join(EXTENSION, 1e-6, 1.02, 0.5),
        Join(STOP, 0.0, 0.1, 1.005),
        Join(BEGIN, 0.0, 0.1, 0.1),
    ]
    total = summed(joins)
    assert (total.n, total.n_apart, total.n_fast) == (3, 1, 1)
    assert [join.is_good for join in joins] == [False, False, True, True]
    case = Case(version=V4_42, rate=200.0, lag=0.01, transport=0.0, is_separated=True)
    line = line_of('4.42', case, total)
    assert line == '| 4.42 | on | 10 | 1 | 1 | 1 | 2.0e-04 | 1 | 1.020 | 1.005 | 1 |'


def test_each_lag_is_tried_with_all_rates_versions_and_transports():
    cases = cases_of(0.01, True)
    assert {(case.rate, case.version) for case in cases} == {
        (rate, version) for rate in (200.0, 500.0, 1000.0) for version in (V4_20, V4_42, V6_9)
    }
    assert {case.transport for case in cases} == {0.0, 0.02, 0.05, 0.1}


def test_the_block_of_the_page_is_replaced(tmp_path):
    page = tmp_path / 'page.md'
    page.write_text(f'before\n{TOP}\nold\n\n{END}after\n')
    for _ in range(2):
        write_block(page, ['| new |'])
    text = page.read_text()
    assert text.startswith('before\n')
    assert text.endswith('after\n')
    assert text.count('| new |') == 1
    assert 'old' not in text


@pytest.mark.parametrize('is_separated', [False, True])
def test_a_controller_that_plays_late_messages_from_their_beginning_is_found(is_separated):
    case = Case(version=BLENDING, rate=500.0, lag=0.0, transport=0.03, is_separated=is_separated)
    joins = joins_of(case, 10, 1)
    kinds = [join.kind for join in joins]
    # With separation it depends on how long commitments take to find.
    assert STOP in kinds or is_separated
    assert (EXTENSION in kinds) == is_separated
    assert not all(join.is_good for join in joins)


@pytest.mark.parametrize('is_separated', [False, True])
def test_what_replaces_a_motion_continues_the_command(is_separated):
    for version in (V4_20, V4_42, V6_9):
        case = Case(
            version=version, rate=500.0, lag=0.01, transport=0.05, is_separated=is_separated
        )
        joins = joins_of(case, 20, 1)
        assert len(joins) >= 20
        assert [join for join in joins if not join.is_good] == []
