# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Commitments lead a motion to its end, each one proven up to the rest that it ends with."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import separation_violations
from rrth_planner.collision.separation import Blocked
from rrth_planner.execution.commitment import (
    Commitment,
    extended,
    first_commitment,
    path_state,
    permitted,
    Separation,
)
from rrth_planner.model.arm import bar_names
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import seen_body, SeparationRules
from rrth_planner.model.trajectory import MotionLimits, part_of, sample
from rrth_planner.timing.fast_stop import fast_stop
from rrth_planner.timing.parameterization import excess
from rrth_planner.timing.rate_profile import rate_state, scaled, steady, steered
from sample_motions import path_distance, planned_motion
from worlds import limits, MARGIN, random_motion, table_1_arm, wearer

RULES = SeparationRules()
ARM = table_1_arm(0.02)
SETTINGS = Separation(arm=ARM, rules=RULES, margin=MARGIN, limits=limits(), stop_limits=limits())
PERIOD = 1.0 / 120.0
# Where a stop is replaced by another motion: the arm may be so far from that.
JUMP, SPEED_JUMP = 2e-4, 0.022


def body_at(age=0.02, scene=None):
    return seen_wearer(age) if scene is None else seen_body(scene, age, RULES)


@cache
def seen_wearer(age):
    return seen_body(wearer(), age, RULES)


@cache
def motions():
    """Return motions round the wearer that may begin, some of them far from him."""
    found, rng = [], np.random.default_rng(0)
    while len(found) < 8:
        motion = random_motion(rng)
        if motion is not None:
            first = first_commitment(motion, 0.0, body_at(), SETTINGS)
            if isinstance(first, Commitment):
                found.append(motion)
    return found


def check_commitment(commitment, body, is_checked=True):
    """Check a commitment by itself: its end, its limits, and that it keeps separate."""
    curve = commitment.trajectory
    assert not curve.velocities[-1].any()
    assert not curve.accelerations[-1].any()
    # In the shortest pieces the jerk is rounding.
    if np.diff(curve.times).min() > 1e-4:
        # By 1 % for the motion at its rate, and again for the stop that follows from it.
        assert excess(curve, SETTINGS.limits) <= 1.02
    if commitment.is_whole:
        # Nothing replaces it: it goes on at the full rate.
        np.testing.assert_allclose(
            curve.positions[-1], commitment.motion.positions[-1], rtol=0.0, atol=1e-9
        )
        assert rate_state(commitment.profile, commitment.profile.change_time)[1] > 0.99
    if is_checked:
        assert not separation_violations(ARM, body, curve, RULES, MARGIN)


def check_handover(before, after, time):
    """Check that a commitment begins where the one before it is at that time."""
    assert after.start_time == time
    elapsed = time - before.start_time
    is_late = elapsed > before.stretch
    within = min(elapsed, before.trajectory.duration)
    q, v, a = sample(before.trajectory, [within])
    assert np.abs(q[0] - after.trajectory.positions[0]).max() <= (JUMP if is_late else 1e-6)
    assert np.abs(v[0] - after.trajectory.velocities[0]).max() <= (SPEED_JUMP if is_late else 1e-4)
    if not is_late:
        assert np.abs(a[0] - after.trajectory.accelerations[0]).max() <= 0.02


def run(motion, pause_at=np.inf, pause=0.0, ages=None, most=30.0, checked=7, period=PERIOD):
    """
    Execute a motion, at 120 Hz; return its last commitment, and all answers that were no new one.

    pause_at, pause: when nothing is heard for how long [s]; ages: of the body, by the time; each
    so many a commitment is checked against the wearer.
    """
    time, n, refusals = 0.0, 0, []
    present = first_commitment(motion, time, body_at(), SETTINGS)
    check_commitment(present, body_at())
    while time < most:
        is_pause = time < pause_at <= time + period
        time += period + (pause if is_pause else 0.0)
        body = body_at(0.02 if ages is None else ages(time))
        found = extended(present, time, body, SETTINGS)
        if found is None:
            return present, refusals
        if isinstance(found, Blocked):
            refusals.append((time, found))
            continue
        n += 1
        check_handover(present, found, time)
        check_commitment(found, body, n % checked == 0 or is_pause or found.is_whole)
        present = found
    raise AssertionError(f'not arrived: {path_state(present, time)} of {motion.duration}')


def has_arrived(commitment):
    """Return whether a commitment ends where its motion does."""
    end = commitment.motion.positions[-1]
    return np.abs(commitment.trajectory.positions[-1] - end).max() < 2e-6


def test_planned_motions_arrive_beside_a_wearer_at_rest():
    for motion in motions()[:3]:
        last, _ = run(motion, checked=30)
        assert has_arrived(last)
        assert last.end_time >= motion.duration - 1e-6
        assert extended(last, last.end_time + 1.0, body_at(), SETTINGS) is None


def test_without_a_wearer_near_a_motion_is_committed_as_a_whole_at_once():
    for motion in motions():
        for scene in (Scene(()), body_far_away()):
            found = first_commitment(motion, 5.0, body_at(scene=scene), SETTINGS)
            assert found.is_whole
            assert found.start_time == 5.0
            assert found.end_time == pytest.approx(5.0 + motion.duration, abs=1e-6)
            assert extended(found, 5.1, body_at(scene=scene), SETTINGS) is None


def body_far_away():
    """Return the boxes of a wearer who is 30 m away."""
    boxes = wearer().boxes
    return Scene(tuple(replace(box, center=box.center + [30.0, 0.0, 0.0]) for box in boxes))


def stretches(motion, settings=SETTINGS):
    """Return some commitments of a motion that end in a stop on the way."""
    body, found, time = body_at(), [], 0.0
    present = first_commitment(motion, time, body, settings)
    while isinstance(present, Commitment) and not present.is_whole and len(found) < 30:
        found.append(present)
        time += PERIOD
        present = extended(present, time, body, settings) or present
    return found[::12]


def test_a_commitment_that_is_not_extended_stops_along_the_path_of_the_motion():
    n = 0
    for motion in motions():
        for commitment in stretches(motion):
            n += 1
            curve = commitment.trajectory
            times = np.linspace(0.0, curve.duration, 20)
            q, _, _ = sample(curve, times)
            assert path_distance(q, motion, 0.0, motion.duration).max() < 1.2e-4
            assert 0.0 < commitment.stretch <= 0.027
            # No further than its rate leads, and not back.
            taus = [path_state(commitment, commitment.start_time + t)[0] for t in times]
            assert (np.diff(taus) >= -1e-3).all()
            assert curve.duration < 0.6
            assert taus[-1] < motion.duration
    assert n > 10


def test_a_path_state_is_that_of_the_commitment_at_that_time():
    n_late = 0
    for motion in motions()[:4]:
        for commitment in stretches(motion):
            end = commitment.trajectory.duration
            for elapsed in (*np.linspace(0.0, commitment.stretch, 5), *np.linspace(0.0, end, 12)):
                n_late += elapsed > commitment.stretch
                tau, rate, _ = path_state(commitment, commitment.start_time + elapsed)
                q, v, _ = (row[0] for row in sample(commitment.trajectory, [elapsed]))
                p, w, _ = (row[0] for row in sample(motion, [tau]))
                assert 0.0 <= tau <= motion.duration
                assert 0.0 <= rate <= 1.0 + 1e-6
                assert np.abs(p - q).max() < JUMP
                assert np.abs(rate * w - v).max() < SPEED_JUMP
            # At its end it is at rest, and so it stays.
            rest = path_state(commitment, commitment.start_time + end + 5.0)
            at_end = path_state(commitment, commitment.start_time + end)
            np.testing.assert_allclose(rest, at_end, atol=1e-5)
            assert abs(rest[1]) < 1e-6
            assert path_state(commitment, commitment.start_time - 1.0)[0] == pytest.approx(
                path_state(commitment, commitment.start_time)[0], abs=1e-12
            )
    assert n_late > 20


@pytest.mark.parametrize('pause', [0.03, 0.1, 1.0])
def test_a_motion_arrives_that_is_extended_late_within_the_stop_or_after_it(pause):
    n_paused = 0
    for motion in motions()[1:3]:
        for pause_at in (0.1, 0.2):
            # At 60 Hz: that, too, is within the stretch of each commitment.
            last, _ = run(motion, pause_at, pause, checked=25, period=2.0 * PERIOD)
            assert has_arrived(last)
            n_paused += last.start_time > pause_at
    assert n_paused >= 2


def late_jump(before, after):
    """Return how far an arm jumps to a commitment that is up to 20 ms late [rad, rad/s]."""
    late = np.linspace(0.0, 0.02, 6)
    one = sample(before.trajectory, after.start_time - before.start_time + late)
    other = sample(after.trajectory, late)
    return [np.abs(one[k] - other[k]).max() for k in (0, 1)]


@pytest.mark.parametrize(('acceleration', 'jerk'), [(4.0, 40.0), (10.0, 400.0)])
def test_a_controller_that_is_20_ms_late_jumps_by_next_to_nothing(acceleration, jerk):
    stop = MotionLimits(
        velocity=limits().velocity, acceleration=np.full(4, acceleration), jerk=np.full(4, jerk)
    )
    settings, body = replace(SETTINGS, stop_limits=stop), body_at(scene=body_far_away())
    n_extended = n_stopping = n_continued = n_resumed = 0
    for motion in motions():
        for before in stretches(motion, settings):
            end = before.trajectory.duration
            for elapsed in (PERIOD, *np.arange(0.03, end + 0.1, 0.01)):
                after = extended(before, before.start_time + elapsed, body, settings)
                if isinstance(after, Commitment):
                    n_extended += elapsed == PERIOD
                    n_continued += before.stretch < elapsed < end
                    n_resumed += elapsed >= end
                    jump, speed_jump = late_jump(before, after)
                    assert jump <= JUMP
                    assert speed_jump <= SPEED_JUMP
                    # However slow the arm is there, what is intended has an end.
                    assert scaled(motion, after.profile).duration < 40.0 * motion.duration
                elif before.stretch < elapsed < end:
                    n_stopping += after is None
    assert min(n_extended, n_resumed) > 10
    # The motion goes on from a sharp stop only once that has ended.
    assert n_stopping > 50
    assert (n_continued > 50) == (jerk == 40.0)
    assert (n_continued == 0) == (jerk == 400.0)


def committed(motion, profile):
    """Return a commitment that follows a profile for a stretch and stops then."""
    stretch = 0.027
    curve = fast_stop(scaled(motion, profile), 0.0, SETTINGS.stop_limits, stretch)
    return Commitment(
        motion=motion,
        trajectory=curve,
        start_time=0.0,
        profile=profile,
        stretch=min(stretch, curve.duration),
    )


def test_from_a_stop_anywhere_on_its_way_a_motion_goes_on_and_arrives():
    rng, body, n_slow = np.random.default_rng(1), body_at(scene=body_far_away()), 0
    for _ in range(25):
        motion = planned_motion(rng)
        for begin in (0.0, *rng.uniform(0.0, 0.8, 3) * motion.duration):
            present = committed(motion, steady(begin, 1.0))
            time = present.end_time + 0.5
            state = path_state(present, time)
            n_slow += steered(motion, state, 1.0, SETTINGS.limits) is None
            for _ in range(400):
                if state[0] >= motion.duration - 2e-6 or present.is_whole:
                    break
                found = extended(present, time, body, SETTINGS)
                assert isinstance(found, Commitment)
                present, time = found, time + PERIOD
                state = path_state(present, time)
            assert present.is_whole or state[0] >= motion.duration - 2e-6
    # From some the full rate cannot be reached at once.
    assert n_slow > 5


def test_what_is_committed_as_a_whole_goes_on_at_the_full_rate():
    rng, body, n_held = np.random.default_rng(2), body_at(scene=body_far_away()), 0
    for _ in range(60):
        motion = planned_motion(rng)
        state = np.array([rng.uniform(0.1, 0.7) * motion.duration, 1.0, 0.0])
        profile = steered(motion, state, rng.uniform(0.2, 0.5), SETTINGS.limits)
        if profile is None:
            continue
        present = committed(motion, profile)
        for time in rng.uniform(0.0, present.stretch, 3):
            state = path_state(present, time)
            n_held += steered(motion, state, 1.0, SETTINGS.limits) is None
            found = extended(present, time, body, SETTINGS)
            if isinstance(found, Commitment) and found.is_whole:
                after = found.profile
                assert rate_state(after, after.change_time)[1] > 0.99
                assert has_arrived(found)
    assert n_held > 5


@pytest.mark.parametrize('contact_speed', [0.0, 0.1])
def test_a_wearer_who_is_not_seen_for_seconds_blocks_and_is_named(contact_speed):
    names, boxes = set(bar_names(ARM)), {box.name for box in wearer().boxes}
    rules = replace(RULES, contact_speed=contact_speed)
    settings, body, answers = replace(SETTINGS, rules=rules), body_at(5.0), []
    for motion in motions():
        for commitment in stretches(motion):
            for later in (PERIOD, 0.04, 0.08, 3.0):
                time = commitment.start_time + later
                answers.append(extended(commitment, time, body, settings))
        answers.append(first_commitment(motion, 0.0, body, settings))
    for found in answers:
        if isinstance(found, Commitment):
            # It creeps: none of its places is fast.
            assert contact_speed > 0.0
            assert not separation_violations(ARM, body, found.trajectory, rules, MARGIN)
        elif found is not None:
            assert (found.bar in names, found.box in boxes) == (True, True)
    n_blocked = sum(isinstance(found, Blocked) for found in answers)
    assert n_blocked >= (10 if contact_speed > 0.0 else 0.2 * len(answers))


def test_a_motion_goes_on_and_arrives_when_the_wearer_is_seen_again():
    n_blocked = 0
    for seed, motion in enumerate(motions()[1:3]):
        rng = np.random.default_rng(seed)
        lost = np.sort(rng.uniform(0.0, 1.0, 6)).reshape(3, 2)

        def ages(time, lost=lost):
            is_lost = ((lost[:, 0] < time) & (time < lost[:, 1])).any()
            return 5.0 if is_lost else 0.02

        last, refusals = run(motion, ages=ages, checked=30)
        assert has_arrived(last)
        n_blocked += len(refusals)
    assert n_blocked > 2


def test_bodies_of_any_age_are_kept_separate_from_and_do_not_hold_a_motion_for_ever():
    for seed, motion in enumerate(motions()[1:3]):
        rng = np.random.default_rng(100 + seed)
        changes = rng.choice([0.02, 0.05, 0.1, 0.3, 0.6, 5.0], 40)

        def ages(time, changes=changes):
            return float(changes[int(time / 0.1)]) if time < 4.0 else 0.02

        last, _ = run(motion, ages=ages, checked=20)
        assert has_arrived(last)


def test_a_motion_that_moves_at_its_start_is_committed_from_that_state():
    n = 0
    for motion in motions():
        for share in (0.2, 0.5, 0.8):
            rest = part_of(motion, share * motion.duration, motion.duration)
            assert np.abs(rest.velocities[0]).max() > 1e-3
            for body in (body_at(), body_at(scene=body_far_away())):
                found = first_commitment(rest, 2.0, body, SETTINGS)
                if isinstance(found, Blocked):
                    continue
                n += 1
                check_commitment(found, body)
                for got, expected, gap in zip(
                    found.trajectory.states, rest.states, (1e-12, 1e-9, 1e-6), strict=True
                ):
                    np.testing.assert_allclose(got[0], expected[0], rtol=0.0, atol=gap)
    assert n > 24


def test_the_permitted_rate_is_less_the_older_the_body_is():
    n_between = n_forbidden = 0
    for motion in motions():
        for time in (0.0, 0.3 * motion.duration, motion.duration):
            rates = [
                permitted(motion, time, body_at(age), SETTINGS)
                for age in (0.0, 0.05, 0.1, 0.3, 1.0, 5.0)
            ]
            assert (np.diff(rates) <= 1e-9).all()
            assert min(rates) >= 0.0
            assert max(rates) <= 1.0
            n_between += 0.0 < rates[1] < 1.0
        assert permitted(motion, 0.0, body_at(scene=body_far_away()), SETTINGS) == 1.0
        n_forbidden += permitted(motion, 0.3 * motion.duration, body_at(5.0), SETTINGS) < 0.2
    assert n_between > 2
    assert n_forbidden >= 2


def test_what_is_not_clear_is_not_committed_to():
    n_shortened, alone = 0, body_at(scene=Scene(()))
    for motion in motions():
        present, time = first_commitment(motion, 0.0, body_at(), SETTINGS), 0.0
        end = motion.positions[-1]
        while not present.is_whole:
            time += PERIOD
            # As where a hand is in the ray at the end: a stretch and its stop are still clear.
            short = extended(
                present,
                time,
                alone,
                SETTINGS,
                lambda curve, end=end: np.abs(curve.positions[-1] - end).max() > 0.1,
            )
            none = extended(present, time, alone, SETTINGS, lambda curve: False)
            assert isinstance(none, Blocked)
            assert (none.bar, none.box) == ('the rest of the motion', 'the wearer')
            present = extended(present, time, alone, SETTINGS)
            if isinstance(short, Commitment):
                assert not short.is_whole
                assert np.abs(short.trajectory.positions[-1] - end).max() > 0.1
                check_commitment(short, alone)
                n_shortened += present.is_whole
    assert n_shortened > 3
