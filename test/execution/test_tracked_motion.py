# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A missed stop is found, an executed one is not taken for it; the clock may be set."""

from hypothesis import assume, given, strategies as st
import numpy as np
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.tracked_motion import (
    ASIDE,
    forget_command,
    has_missed_stop,
    LONGEST_LAG,
    shifted,
    track_next,
    TrackedMotion,
)
from rrth_planner.model.trajectory import sample
from rrth_planner.timing.fast_stop import fast_stop
from sample_motions import planned_motion
from worlds import examples, limits

BEGIN = 100.0
# Period of the readings [s].
TICK = 0.02


def _stopped(seed):
    """Return a motion with corners, when it is stopped, and its stop."""
    rng = np.random.default_rng(seed)
    motion = planned_motion(rng)
    phase = float(rng.uniform(0.1, 0.9)) * motion.duration
    stop = fast_stop(motion, phase, limits())
    before = ExecutingMotion(trajectory=motion, start_time=BEGIN - phase)
    return before, phase, ExecutingMotion(trajectory=stop, start_time=BEGIN)


def _missed_at(before, stop, arm, span):
    """Return the times after the stop at which the stop is found to be missed [s]."""
    times = np.arange(TICK, span, TICK)
    found = []
    for time in times:
        q, v = arm(time)
        reading = JointReading(q, v, BEGIN + time, BEGIN + time, float('inf'))
        if has_missed_stop(reading, before, stop):
            found.append(float(time))
    return found


def _at(trajectory, time):
    return tuple(row[0] for row in sample(trajectory, [time])[:2])


def _executed(before, phase, stop, late):
    """Return the motion of an arm that receives its stop so late [s]."""

    def arm(time):
        if time < late:
            return _at(before.trajectory, phase + time)
        return _at(stop.trajectory, time - late)

    return arm


@examples(60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.013, 0.05, 0.09]))
def test_an_executed_stop_is_never_taken_for_a_missed_one(seed, late):
    before, phase, stop = _stopped(seed)
    executes = _executed(before, phase, stop, late)
    assert _missed_at(before, stop, executes, stop.trajectory.duration + 0.3) == []


@examples(60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([-0.005, 0.0, 0.05]))
def test_poor_readings_are_not_taken_for_a_missed_stop(seed, late):
    before, phase, stop = _stopped(seed)
    executes = _executed(before, phase, stop, late)
    rng = np.random.default_rng(seed)

    def differenced(time):
        # As of a driver that has no velocities: half a period behind, and noisy.
        (q_before, _), (q, _) = executes(time - TICK), executes(time)
        noise = 2e-4 * rng.standard_normal((2, 4))
        return q + noise[0], (q - q_before) / TICK + noise[1] / TICK

    assert _missed_at(before, stop, differenced, stop.trajectory.duration + 0.3) == []


@examples(60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.5, 1.0]))
def test_an_arm_that_misses_its_stop_is_detected(seed, rate):
    before, phase, stop = _stopped(seed)
    left = (before.trajectory.duration - phase) / rate

    def ignores(time):
        q, v = _at(before.trajectory, phase + rate * time)
        return q, rate * v

    # Once it is past all places that the stop has come to by then.
    due, n = set(), 2_500
    way = sample(stop.trajectory, np.linspace(0.0, left, n))[0]
    # From there on all are the same place.
    at_rest = 2 + int(n * stop.trajectory.duration / left)
    for time in np.arange(TICK, left, TICK):
        q, v = ignores(time)
        ahead = np.abs(way[: min(at_rest, 1 + int(n * time / left))] - q).max(axis=1).min()
        if time > LONGEST_LAG + 1e-9 and ahead > ASIDE and np.linalg.norm(v) > 0.05:
            due.add(float(time))
    found = _missed_at(before, stop, ignores, left)
    # The samples are some milliseconds apart.
    assert due <= set(found)
    assert all(time > LONGEST_LAG for time in found)


@examples(60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.15, 0.3]))
def test_an_arm_that_lags_or_has_stopped_by_itself_misses_no_stop(seed, lag):
    before, phase, stop = _stopped(seed)

    def lags(time):
        # It receives the stop late, too.
        since = time - lag
        if since >= 0.0:
            return _at(stop.trajectory, since)
        return _at(before.trajectory, phase + since)

    assert _missed_at(before, stop, lags, stop.trajectory.duration + lag + 0.2) == []
    # So long before the commanded stop.
    early = min(lag, phase)
    stopped = fast_stop(before.trajectory, phase - early, limits())
    # One that begins earlier, at a corner say, may take longer and go further.
    assume(stopped.duration - early <= stop.trajectory.duration)

    def stops(time):
        return _at(stopped, early + time)

    assert _missed_at(before, stop, stops, stop.trajectory.duration + 0.2) == []


def test_a_command_that_is_not_known_stays_so_when_the_clock_is_set():
    before, _, _ = _stopped(0)
    tracked = track_next(TrackedMotion(), before)
    assert tracked.command is tracked.motion is before
    later = shifted(tracked, 1.0)
    assert later.command is later.motion
    assert later.motion.start_time == before.start_time + 1.0
    unknown = shifted(forget_command(later), 1.0)
    assert unknown.command is None and unknown.motion.start_time == before.start_time + 2.0
