# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A point that jumps stays where it was for one posture; what moves is passed on at once."""

from hypothesis import given, strategies as st
import numpy as np
from rrth_planner.wearer.jump_filter import without_jumps
from rrth_planner.wearer.posture import Posture

MOST, PERIOD = 0.3, 1 / 30
LOST = [np.nan] * 3
HOME, AWAY, ELSEWHERE = [0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [5.0, 0.0, 1.0]


def posture(*positions, rotations=None):
    """Return a posture of points a, b, ..."""
    names = tuple('abcdefgh'[: len(positions)])
    return Posture(names=names, positions=np.array(positions, dtype=float), rotations=rotations)


def filtered(postures, period=PERIOD):
    """Return what becomes of postures that come one after another."""
    found, before = [], None
    for k, given_posture in enumerate(postures):
        before = without_jumps(before, given_posture, 100.0 + period * k, MOST)
        found.append(before)
    return found


def places(*points, period=PERIOD):
    """Return where one point is passed on, of places where it is measured, and how often held."""
    found = filtered([posture(point) for point in points], period)
    return [f.posture.positions[0].tolist() for f in found], sum(f.n_held for f in found)


def same(found, expected):
    """Return whether places are equal, lost ones too."""
    return np.array_equal(np.array(found), np.array(expected), equal_nan=True)


def test_a_jump_is_held_back_once_and_then_taken():
    found, n_held = places(HOME, HOME, AWAY, AWAY, AWAY)
    assert same(found, [HOME, HOME, HOME, AWAY, AWAY])
    assert n_held == 1


def test_a_single_outlier_never_passes():
    found, n_held = places(HOME, AWAY, HOME, HOME, ELSEWHERE, HOME)
    assert same(found, [HOME] * 6)
    assert n_held == 2


def test_a_point_in_three_places_is_lost_until_two_measurements_agree():
    found, n_held = places(HOME, AWAY, ELSEWHERE, AWAY, AWAY, AWAY)
    assert same(found, [HOME, HOME, LOST, LOST, AWAY, AWAY])
    assert n_held == 1


def test_a_confirmation_may_move_as_a_person_does():
    near = [0.0, 2.2, 1.0]
    assert same(places(HOME, AWAY, near)[0], [HOME, HOME, near])


def test_a_lost_point_is_taken_where_it_is_found():
    assert same(places(HOME, LOST, AWAY)[0], [HOME, LOST, AWAY])
    # Held back and then lost: the next measurement is the first one.
    assert same(places(HOME, AWAY, LOST, ELSEWHERE)[0], [HOME, HOME, LOST, ELSEWHERE])


def test_after_a_gap_or_a_step_back_of_time_everything_is_taken():
    assert same(places(HOME, AWAY, period=0.21)[0], [HOME, AWAY])
    assert same(places(HOME, AWAY, period=-0.01)[0], [HOME, AWAY])
    assert same(places(HOME, AWAY, period=0.19)[0], [HOME, HOME])


def test_other_points_begin_anew():
    first, second = posture(HOME), posture(AWAY, AWAY)
    assert same(filtered([first, second])[1].posture.positions, [AWAY, AWAY])


def test_only_the_point_that_jumps_is_held_back_with_its_rotation():
    turns = np.stack([np.eye(3), np.diag([1.0, -1.0, -1.0])])
    before = posture(HOME, HOME, rotations=turns)
    near = [0.0, 0.1, 1.0]
    after = posture(AWAY, near, rotations=turns[::-1].copy())
    found = filtered([before, after, posture(AWAY, near, rotations=turns)])
    assert same(found[1].posture.positions, [HOME, near])
    assert same(found[1].posture.rotations, [turns[0], turns[0]])
    assert same(found[2].posture.positions, [AWAY, near])
    assert same(found[2].posture.rotations, turns)


def test_measurements_are_not_changed():
    after = posture(AWAY, HOME)
    filtered([posture(HOME, HOME), after])
    assert same(after.positions, [AWAY, HOME])


def walk(steps, outliers):
    """Return places of a point that moves by small steps, and those of a tracker with outliers."""
    true = np.cumsum([[0.0, 0.0, 0.0], *steps], axis=0)
    return true, np.where(np.isin(np.arange(len(true)), outliers)[:, None], true + 9.0, true)


small = st.tuples(*[st.floats(-0.08, 0.08)] * 3)


@given(st.lists(small, min_size=2, max_size=30), st.data())
def test_what_is_passed_on_is_never_far_from_the_truth(steps, data):
    # Outliers one by one, and never the first one, which nothing contradicts.
    drawn = data.draw(st.sets(st.integers(1, len(steps))))
    outliers = [k for k in drawn if not {k - 1, k + 1} & drawn]
    true, measured = walk(steps, outliers)
    found = filtered([posture(place) for place in measured])
    for k, (truth, f) in enumerate(zip(true, found, strict=True)):
        expected = true[k - 1] if k in outliers else truth
        np.testing.assert_array_equal(f.posture.positions[0], expected)
        assert f.n_held == (k in outliers)
