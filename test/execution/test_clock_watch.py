# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Steps of a clock are noticed, slewing is not."""

import pytest
from rrth_planner.execution.clock_watch import watch_clock

PERIOD = 0.02


def _steps(node, n=6000, is_simulated=False, period=PERIOD):
    """Return the steps of a clock, a function of the steady one [s], and when they were seen."""
    watch, found = None, []
    for k in range(n):
        steady = 50.0 + period * k
        watch, step = watch_clock(watch, node(steady - 50.0), steady, is_simulated)
        if step is not None:
            found.append((steady - 50.0, step))
    return found


@pytest.mark.parametrize('step', [-3600.0, -0.09, -0.021, 0.021, 0.5, 1.0])
def test_a_step_is_noticed_once_and_by_how_much(step):
    ((seen, found),) = _steps(lambda t: 1e9 + t + step * (t >= 1.0))
    assert 1.0 <= seen < 1.0 + 1.5 * PERIOD
    assert found.step == pytest.approx(step, abs=1e-6)
    assert found.sentence.startswith(f'the clock was set {"forward" if step > 0 else "back"} by ')


@pytest.mark.parametrize('rate', [-500e-6, 500e-6])
def test_slewing_and_small_corrections_are_no_steps(rate):
    assert not _steps(lambda t: 1e9 + (1.0 + rate) * t)
    # One a minute, as by a daemon that sets the clock a little.
    assert not _steps(lambda t: 1e9 + t + 0.015 * (t // 60.0))


def test_a_quick_slew_and_a_step_in_many_parts_are_noticed():
    assert _steps(lambda t: 1e9 + 1.08 * t, n=60)
    assert _steps(lambda t: 1e9 + t + 0.005 * min(t // 0.1, 10.0), n=200)


def test_a_process_that_stood_still_saw_no_step_and_a_suspended_machine_did():
    assert not _steps(lambda t: 1e9 + t + 0.0, period=5.0)
    # Its steady clock stood still meanwhile.
    assert len(_steps(lambda t: 1e9 + t + 600.0 * (t >= 2.0))) == 1


def test_a_simulated_clock_may_run_as_it_likes_but_not_back_nor_stand_still():
    assert not _steps(lambda t: 0.3 * t + 5.0 * (t // 2.0), is_simulated=True)
    ((_, found),) = _steps(lambda t: t if t < 5.0 else t - 5.0, is_simulated=True)
    assert found.step == pytest.approx(-5.0, abs=2 * PERIOD)
    ((seen, found),) = _steps(lambda t: min(t, 5.0) + max(0.0, t - 9.0), 1000, True)
    assert 5.5 < seen < 5.5 + 3 * PERIOD
    assert found.step == 0.0
    assert 'stood still' in found.sentence
