# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm that obeys a stop is told from one that goes on, where its motion slows down anyhow."""

from hypothesis import given, strategies as st
import numpy as np
import pytest

pytest.importorskip('rclpy')

from rrth_planner.emergency import emergency_stop  # noqa: E402
from rrth_planner.ros.followed import goes_on, LATE, LITTLE  # noqa: E402
from rrth_planner.ros.joints import JointReading  # noqa: E402
from rrth_planner.running_motion import RunningMotion  # noqa: E402
from rrth_planner.trajectory import sample  # noqa: E402
from test_stopping import planned_motion  # noqa: E402
from worlds import examples, limits  # noqa: E402

BEGIN = 100.0
# How often the arm is looked at [s].
TICK = 0.02


def _stopped(seed):
    """Return a motion with corners, when it is stopped, and its stop."""
    rng = np.random.default_rng(seed)
    motion = planned_motion(rng)
    phase = float(rng.uniform(0.1, 0.9)) * motion.duration
    stop = emergency_stop(motion, phase, limits())
    before = RunningMotion(trajectory=motion, start_time=BEGIN - phase)
    return before, phase, RunningMotion(trajectory=stop, start_time=BEGIN)


def _seen_to_go_on(before, stop, arm, span):
    """Return the times after the stop at which an arm is found to go on [s]."""
    times = np.arange(TICK, span, TICK)
    found = []
    for time in times:
        q, v = arm(time)
        reading = JointReading(q, v, BEGIN + time, BEGIN + time, float('inf'))
        if goes_on(reading, before, stop):
            found.append(float(time))
    return found


def _at(trajectory, time):
    return tuple(row[0] for row in sample(trajectory, [time])[:2])


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.013, 0.05, 0.09]))
@examples(60)
def test_an_arm_that_obeys_never_goes_on(seed, late):
    before, phase, stop = _stopped(seed)

    def obeys(time):
        if time < late:
            return _at(before.trajectory, phase + time)
        return _at(stop.trajectory, time - late)

    assert _seen_to_go_on(before, stop, obeys, stop.trajectory.duration + 0.3) == []


@given(st.integers(0, 2**32 - 1))
@examples(60)
def test_an_arm_that_goes_on_is_found_out(seed):
    before, phase, stop = _stopped(seed)
    left = before.trajectory.duration - phase

    def ignores(time):
        return _at(before.trajectory, phase + time)

    # Once it is due to be slow, even if it heard late, and has left the way of the stop.
    times = np.arange(TICK, left, TICK)
    q, v, _ = sample(before.trajectory, phase + times)
    due = np.linalg.norm(sample(stop.trajectory, times - LATE)[1], axis=1)
    first = np.linalg.norm(stop.trajectory.velocities[0])
    way = sample(stop.trajectory, np.linspace(0.0, stop.trajectory.duration, 1000))[0]
    beside = np.abs(way[:, None] - q).max(axis=2).min(axis=0)
    is_clear = (times > LATE) & (due < LITTLE * first) & (beside > 3e-3)
    is_clear &= np.linalg.norm(v, axis=1) > 0.05
    found = _seen_to_go_on(before, stop, ignores, left)
    assert set(np.round(times[is_clear], 6)) <= set(np.round(found, 6))
