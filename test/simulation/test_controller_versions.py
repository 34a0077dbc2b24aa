# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What versions of joint_trajectory_controller make of a message that replaces another one."""

from dataclasses import dataclass

import numpy as np
import pytest
from rrth_planner.execution.command import lead_in, led
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import part_of, sample
from rrth_planner.simulation.lagging_arm import LaggingArm
from rrth_planner.simulation.trajectory_controller import (
    ControllerRules,
    ControllerVersion,
    Tolerances,
)
from rrth_planner.timing.braking import brake
from rrth_planner.timing.parameterization import parameterize
from simulation_samples import motion_between, points_of
import worlds

LIMITS = worlds.limits()
# All joints move, the first one at its greatest speed in between.
RUNNING = parameterize(Path([[0.0] * 4, [2.5, -0.5, 0.3, 0.8]]), (), LIMITS)
BEGIN, AHEAD = 100.0, 0.025
# What is looked at: from a little before until so long after a handover; the greatest lag [s].
LATER, SETTLING = 0.15, 0.0423
V4_20, V4_42, V6_9, BLENDING = ControllerVersion


@dataclass(frozen=True)
class Seen:
    """
    What a controller commanded, at most of all joints.

    Parameters
    ----------
    off : float
        From what the planner believes [rad].
    velocity, acceleration : float
        By differences of the setpoints, as shares of the limits.

    """

    off: float
    velocity: float
    acceleration: float


def handed_over(rate, share, rules, lag=0.0, *, ahead=AHEAD, has_lead_in=False, transport=0.0):
    """
    Return what is seen of a handover at a share of the running motion.

    The new motion brakes, as the planner does; it is published AHEAD of its first point, or with
    the running motion up to that in front.
    """
    period = 1.0 / rate
    at = BEGIN + share * RUNNING.duration
    before = ExecutingMotion(trajectory=RUNNING, start_time=BEGIN)
    new = ExecutingMotion(
        trajectory=brake(RUNNING, share * RUNNING.duration, LIMITS), start_time=at
    )
    published = at - ahead
    lead = lead_in(before.trajectory, published - BEGIN, at - BEGIN)
    message = led(lead, new) if has_lead_in else new
    assert (message is new) != has_lead_in
    # It joins the running motion a little before.
    begin = published - SETTLING
    rest = part_of(RUNNING, begin - BEGIN, RUNNING.duration)
    arm = LaggingArm(rest.positions[0], period, lag, rules, begin)
    arm.receive(points_of(rest), begin)
    while arm.time < published - 2 * period:
        arm.step()
    times, setpoints = [], []
    is_sent = False
    while arm.time < at + LATER:
        if arm.time >= published + transport and not is_sent:
            arm.receive(points_of(message.trajectory), message.start_time)
            is_sent = True
        setpoints.append(arm.step().positions)
        times.append(arm.time)
    times, setpoints = np.array(times), np.array(setpoints)
    believed = np.where(
        times[:, None] < at,
        sample(RUNNING, (times - BEGIN).clip(0.0))[0],
        sample(new.trajectory, (times - at).clip(0.0))[0],
    )
    return Seen(
        float(np.abs(setpoints - believed).max()),
        float((np.abs(np.diff(setpoints, axis=0)) / period / LIMITS.velocity).max()),
        float((np.abs(np.diff(setpoints, 2, axis=0)) / period**2 / LIMITS.acceleration).max()),
    )


def worst(rate, rules, lag=0.0, *, n=8, **options):
    """Return the greatest figures of handovers at many places of the motion."""
    shares = np.linspace(0.12, 0.8, n) + np.random.default_rng(1).uniform(0.0, 0.01, n)
    seen = [handed_over(rate, share, rules, lag, **options) for share in shares]
    return Seen(*(max(getattr(s, name) for s in seen) for name in Seen.__annotations__))


def rules(version, is_from_desired=True):
    """Return the rules of a version."""
    return ControllerRules(version=version, is_from_desired=is_from_desired)


@pytest.mark.parametrize(('rate', 'off'), [(200, 7.5e-3), (500, 3.0e-3), (1000, 1.5e-3)])
def test_jazzy_is_a_period_ahead_of_itself_where_the_stamp_is_ahead(rate, off):
    seen = worst(rate, rules(V4_42), ahead=0.125)
    assert seen.off == pytest.approx(off, rel=0.02)
    # 3 rad/s of 1.5; one step too many within a period.
    assert seen.velocity == pytest.approx(2.0, rel=0.02)
    assert seen.acceleration * 4.0 == pytest.approx(1.5 * rate, rel=0.05)


def test_a_shorter_time_ahead_hides_half_of_the_error_in_the_speed():
    # The piece is led back to its end meanwhile.
    assert 1.5 < worst(200, rules(V4_42), ahead=0.025).velocity < 1.9


@pytest.mark.parametrize('version', ControllerVersion)
@pytest.mark.parametrize('rate', [200, 500, 1000])
def test_a_message_that_begins_with_the_running_motion_is_followed_by_all_versions(version, rate):
    seen = worst(rate, rules(version), has_lead_in=True)
    assert seen.off < (5e-7 if version is not BLENDING else 1.51 / rate)
    assert seen.velocity < 1.001
    assert seen.acceleration < 1.001 or version is BLENDING


def test_the_release_of_jazzy_of_old_leads_exactly():
    seen = worst(200, rules(V4_20), ahead=0.025)
    assert seen.off < 1e-6
    assert seen.velocity < 1.001
    assert seen.acceleration < 1.01
    # Over a longer time one quintic is not quite what several were.
    assert 1e-5 < worst(200, rules(V4_20), ahead=0.125).off < 2e-4


@pytest.mark.parametrize('version', [V6_9, BLENDING])
def test_a_message_of_the_future_is_deferred_until_its_stamp(version):
    seen = worst(200, rules(version), ahead=0.125)
    # In the last cycle before the stamp the old motion goes on until after it.
    assert 1e-8 < seen.off < 7e-6
    assert seen.velocity < 1.001
    assert seen.acceleration < 1.001


@pytest.mark.parametrize('version', [V4_20, V4_42])
@pytest.mark.parametrize(('lag', 'off'), [(0.005, 4.4e-3), (0.01, 1.2e-2), (0.02, 2.6e-2)])
def test_from_the_measured_state_an_arm_that_lags_steps_back(version, lag, off):
    seen = worst(200, rules(version, is_from_desired=False), lag)
    assert off / 1.6 < seen.off < 1.6 * off
    assert 20 * lag < seen.acceleration / 400.0 * 9.0
    # One that does not lag hardly does.
    perfect = worst(200, rules(version, is_from_desired=False), 0.0, ahead=0.125)
    assert perfect.off < 1.1e-3
    assert perfect.acceleration * 4.0 < 6.7


@pytest.mark.parametrize('late', [0.004, 0.008, 0.02])
def test_what_blends_plays_a_late_message_from_its_beginning(late):
    seen = worst(200, rules(BLENDING), has_lead_in=True, transport=late)
    # Late by that, up to the next cycle, at 1.5 rad/s.
    assert 1.5 * late < seen.off < 1.5 * (late + 0.0051)
    assert worst(200, rules(V4_42), has_lead_in=True, transport=late).off < 5e-7


@pytest.mark.parametrize('stamp', [0.0, BEGIN + 0.0123])
def test_what_blends_begins_as_any_other_where_the_stamp_is_not_set_or_ahead(stamp):
    arm, other = (
        LaggingArm(RUNNING.positions[0], 0.005, rules=rules(version), time=BEGIN)
        for version in (BLENDING, V4_42)
    )
    for one in (arm, other):
        one.receive(points_of(RUNNING), stamp)
    for _ in range(100):
        np.testing.assert_allclose(arm.step().positions, other.step().positions, atol=2e-7)


def test_a_cycle_commands_what_is_due_a_period_later():
    arm = LaggingArm(RUNNING.positions[0], 0.005, time=BEGIN)
    arm.receive(points_of(RUNNING), 0.0)
    for k in range(200):
        setpoint = arm.step()
        expected = sample(RUNNING, [0.005 * (k + 1)])
        np.testing.assert_allclose(setpoint.positions, expected[0][0], atol=1e-12)
        np.testing.assert_allclose(setpoint.velocities, expected[1][0], atol=1e-9)
        np.testing.assert_allclose(arm.measured.positions, setpoint.positions)


def test_of_two_messages_in_a_cycle_only_the_last_counts():
    arm, other = (LaggingArm(RUNNING.positions[0], 0.005, time=BEGIN) for _ in range(2))
    aside = motion_between(RUNNING.positions[0], RUNNING.positions[0] + 0.3, 1.0)
    arm.receive(points_of(aside), 0.0)
    for one in (arm, other):
        one.receive(points_of(RUNNING), BEGIN)
    for _ in range(20):
        assert (arm.step().positions == other.step().positions).all()


def test_a_message_that_waits_is_dropped_for_a_newer_one():
    arm = LaggingArm(RUNNING.positions[0], 0.005, rules=rules(V6_9), time=BEGIN)
    aside = motion_between(RUNNING.positions[0], RUNNING.positions[0] + 0.3, 1.0)
    arm.receive(points_of(aside), BEGIN + 0.02)
    arm.step()
    arm.receive(points_of(RUNNING), BEGIN)
    for k in range(1, 20):
        expected = sample(RUNNING, [0.005 * (k + 1)])[0][0]
        np.testing.assert_allclose(arm.step().positions, expected, atol=1e-12)


def test_an_arm_lags_by_its_time_also_between_two_cycles():
    for lag in (0.0, 0.005, 0.0125, 0.03):
        arm = LaggingArm(RUNNING.positions[0], 0.005, lag, time=BEGIN)
        arm.receive(points_of(RUNNING), 0.0)
        for _ in range(150):
            arm.step()
        expected = sample(RUNNING, [arm.time - lag - BEGIN])
        np.testing.assert_allclose(arm.measured.positions, expected[0][0], atol=2e-5)
        np.testing.assert_allclose(arm.measured.velocities, expected[1][0], atol=1e-2)
        assert np.isnan(arm.measured.accelerations).all()


def moving(rules, lag=0.02):
    """Return an arm in the midst of the motion."""
    arm = LaggingArm(RUNNING.positions[0], 0.005, lag, rules, BEGIN)
    arm.receive(points_of(RUNNING), 0.0)
    while arm.time < BEGIN + 0.5 * RUNNING.duration:
        last = arm.step()
    return arm, last


def test_a_cancel_steps_back_by_the_lag_and_holds():
    arm, last = moving(ControllerRules())
    measured = arm.measured
    arm.controller.cancel(arm.time, measured)
    held = arm.step()
    assert (held.positions == measured.positions).all()
    assert np.abs(last.positions - held.positions).max() == pytest.approx(0.03, rel=0.02)
    assert (arm.step().positions == held.positions).all()


def test_where_it_decelerates_on_cancel_it_steps_back_all_the_same():
    arm, last = moving(ControllerRules(deceleration=np.full(4, 3.0)))
    measured = arm.measured
    arm.controller.cancel(arm.time, measured)
    setpoints = np.array([arm.step().positions for _ in range(150)])
    # A period further on, of 1.5 rad/s.
    assert np.abs(last.positions - setpoints[0]).max() == pytest.approx(0.03 - 0.0075, rel=0.02)
    slowing = np.diff(setpoints, 2, axis=0)[:, 0] / 0.005**2
    np.testing.assert_allclose(slowing[:95], -3.0, atol=1e-6)
    v = measured.velocities
    np.testing.assert_allclose(
        setpoints[-1], measured.positions + 0.5 * v * np.abs(v) / 3.0, atol=1e-9
    )


def test_a_lag_beyond_the_path_tolerance_gives_the_motion_up():
    tolerances = Tolerances(path=np.full(4, 0.025), goal=np.zeros(4))
    arm = LaggingArm(
        RUNNING.positions[0], 0.005, 0.02, ControllerRules(tolerances=tolerances), BEGIN
    )
    arm.receive(points_of(RUNNING), 0.0)
    setpoints = []
    while arm.controller.given_up is None:
        setpoints.append(arm.step().positions)
    assert arm.controller.given_up[0] == 0
    assert 'path_tolerance 0.025' in arm.controller.given_up[1]
    assert setpoints[-2][0] - setpoints[-1][0] > 0.02
    arm.step()
    assert arm.controller.given_up is None
    assert arm.controller.command.is_holding


def test_bad_periods_and_lags_are_named():
    with pytest.raises(OptionsError, match='period: 0'):
        LaggingArm(np.zeros(4), 0.0)
    with pytest.raises(OptionsError, match='lag_time: -0.1'):
        LaggingArm(np.zeros(4), 0.005, -0.1)
