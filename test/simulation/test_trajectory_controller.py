# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The rules of joint_trajectory_controller: splines, stamps, replacement, tolerances."""

from dataclasses import replace

import numpy as np
import pytest
from rrth_planner.model.errors import MessageError, OptionsError
from rrth_planner.model.trajectory import MotionState, Trajectory
from rrth_planner.simulation.trajectory_controller import (
    commanded_state,
    deviation,
    hold,
    is_moving,
    MeasuredState,
    piece_between,
    replace_command,
    TimedPoints,
    Tolerances,
)

RNG = np.random.default_rng(3)
N, DOF = 5, 3
TIMES = np.array([0.0, 0.3, 0.7, 0.8, 1.4])
P, V, A = RNG.normal(size=(3, N, DOF))
NO = np.full((N, DOF), np.nan)
AT = MotionState(positions=np.ones(DOF), velocities=np.full(DOF, 0.5), accelerations=np.zeros(DOF))


def points(velocities=V, accelerations=A, times=TIMES):
    return TimedPoints(
        times=times, positions=P, velocities=velocities, accelerations=accelerations
    )


def monomials(time, order):
    """Return the derivatives of 1, t, ... t^5 at a time, up to an order."""
    rows = np.zeros((order + 1, 6))
    for k in range(order + 1):
        for power in range(k, 6):
            rows[k, power] = np.prod(np.arange(power - k + 1, power + 1)) * time ** (power - k)
    return rows


@pytest.mark.parametrize(('order', 'unknown'), [(0, 'both'), (1, 'accelerations'), (2, 'none')])
def test_between_points_a_joint_follows_the_spline_that_fits_what_both_have(order, unknown):
    given = points(NO if unknown == 'both' else V, A if unknown == 'none' else NO)
    command = replace_command(given, 10.0, 10.0, AT)
    derivatives = (P, V, A)
    for i in range(N - 1):
        width = TIMES[i + 1] - TIMES[i]
        # Coefficients by solving for both ends, the slow way.
        size = 2 * (order + 1)
        table = np.concatenate([monomials(0.0, order), monomials(width, order)])[:, :size]
        ends = [d[k] for k in (i, i + 1) for d in derivatives[: order + 1]]
        c = np.linalg.solve(table, np.array(ends))
        for share in (0.01, 0.3, 0.99):
            state = commanded_state(command, 10.0 + TIMES[i] + share * width)
            expected = monomials(share * width, 2)[:, :size] @ c
            np.testing.assert_allclose(state.positions, expected[0], atol=1e-9)
            np.testing.assert_allclose(state.velocities, expected[1], atol=1e-8)
            np.testing.assert_allclose(state.accelerations, expected[2], atol=1e-6)


def test_a_point_without_velocities_makes_lines_of_both_pieces_beside_it():
    some = V.copy()
    some[2] = np.nan
    command = replace_command(points(some), 0.0, 5.0, AT)
    for i in (1, 2):
        middle = commanded_state(command, 5.0 + TIMES[i : i + 2].mean())
        np.testing.assert_allclose(middle.positions, P[i : i + 2].mean(axis=0), atol=1e-12)
    # Those beyond are quintics as before.
    whole = replace_command(points(), 0.0, 5.0, AT)
    for time, is_same in ((5.1, True), (5.5, False), (6.1, True)):
        one, other = commanded_state(command, time), commanded_state(whole, time)
        assert (one.positions == other.positions).all() == is_same


def test_after_the_last_point_it_holds():
    command = replace_command(points(), 0.0, 5.0, AT)
    assert is_moving(command, 5.0 + 1.39)
    assert not is_moving(command, 5.0 + 1.4)
    state = commanded_state(command, 99.0)
    assert (state.positions == P[-1]).all()
    bare = commanded_state(replace_command(points(NO, NO), 0.0, 5.0, AT), 99.0)
    assert not bare.velocities.any()
    assert not bare.accelerations.any()


def test_a_later_start_is_led_to_from_the_present_state():
    command = replace_command(points(), 6.0, 5.0, AT)
    begin = commanded_state(command, 5.0)
    np.testing.assert_allclose(begin.positions, AT.positions)
    np.testing.assert_allclose(begin.velocities, AT.velocities)
    lead = piece_between((AT.positions, AT.velocities, AT.accelerations), (P[0], V[0], A[0]), 1.0)
    halfway = commanded_state(command, 5.5)
    c = np.linalg.solve(
        np.concatenate([monomials(0.0, 2), monomials(1.0, 2)]),
        [AT.positions, AT.velocities, AT.accelerations, P[0], V[0], A[0]],
    )
    np.testing.assert_allclose(halfway.positions, (monomials(0.5, 2) @ c)[0], atol=1e-9)
    assert lead.duration == 1.0
    first = commanded_state(command, 6.0)
    np.testing.assert_allclose(first.positions, P[0], atol=1e-12)


def test_a_measured_state_has_no_accelerations_so_a_cubic_leads_from_it():
    measured = MeasuredState(AT.positions, AT.velocities)
    command = replace_command(points(), 6.0, 5.0, measured)
    c = np.linalg.solve(
        np.concatenate([monomials(0.0, 1), monomials(1.0, 1)])[:, :4],
        [AT.positions, AT.velocities, P[0], V[0]],
    )
    expected = (monomials(0.4, 0)[:, :4] @ c)[0]
    np.testing.assert_allclose(commanded_state(command, 5.4).positions, expected, atol=1e-9)


def test_a_first_point_later_than_the_start_is_led_to_as_well():
    command = replace_command(points(times=TIMES + 0.5), 0.0, 5.0, AT)
    np.testing.assert_allclose(commanded_state(command, 5.0).positions, AT.positions)
    np.testing.assert_allclose(commanded_state(command, 5.5).positions, P[0], atol=1e-12)


def test_a_start_in_the_past_is_joined_where_it_is_by_now():
    late, fresh = (replace_command(points(), stamp, 5.0, AT) for stamp in (4.5, 5.0))
    np.testing.assert_allclose(
        commanded_state(late, 5.2).positions, commanded_state(fresh, 5.7).positions
    )
    assert late.end_time == pytest.approx(5.9)


def test_what_holds_a_position_never_gives_up():
    command = hold(np.ones(DOF))
    assert (commanded_state(command, 1e9).positions == 1.0).all()
    tight = Tolerances(path=np.full(DOF, 0.01), goal=np.full(DOF, 0.01), goal_time=0.1)
    assert deviation(command, tight, 99.0, np.full(DOF, 9.0)) is None


def test_tolerances_are_of_the_path_until_the_end_and_then_of_the_goal_after_its_time():
    command = replace_command(points(), 0.0, 5.0, AT)
    given = Tolerances(path=[0.1, 0.0, 0.2], goal=[0.01, 0.0, 0.02], goal_time=0.5)
    moving, arrived, later = 5.5, 6.5, 6.95
    error = np.array([0.05, 9.0, -0.15])
    assert deviation(command, given, moving, error) is None
    joint, words = deviation(command, given, moving, np.array([0.05, 9.0, -0.25]))
    assert joint == 2
    assert words == '0.25 from what is commanded, expected path_tolerance 0.2 [rad]'
    assert deviation(command, given, arrived, error) is None
    joint, words = deviation(command, given, later, error)
    assert joint == 2
    assert 'goal_tolerance 0.5 s after its end 0.02' in words
    assert deviation(command, replace(given, goal_time=0.0), 99.0, error) is None
    assert deviation(command, given, later, np.array([0.005, 9.0, 0.01])) is None


def test_bad_values_are_named():
    with pytest.raises(MessageError, match='strictly increasing'):
        points(times=TIMES[::-1])
    with pytest.raises(MessageError, match='from >= 0'):
        points(times=TIMES - 0.1)
    with pytest.raises(MessageError, match='velocities: shape'):
        points(velocities=V[:3])
    with pytest.raises(OptionsError, match='path_tolerance'):
        Tolerances(path=[-1.0], goal=[0.0])
    with pytest.raises(OptionsError, match='goal_time'):
        Tolerances(path=[1.0], goal=[0.0], goal_time=-1.0)


def test_a_piece_is_a_trajectory_of_the_model():
    piece = piece_between((P[0], V[0], A[0]), (P[1], V[1], A[1]), 0.4)
    assert isinstance(piece, Trajectory)
    assert (piece.accelerations[1] == A[1]).all()
