# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A part of a trajectory is that trajectory, wherever it is cut."""

import pickle

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.reference_checker import quintic_states
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import (
    cut_at,
    joined,
    near_point,
    part_of,
    positions_at,
    sample,
    Trajectory,
)
from rrth_planner.timing.corner_blends import Blend
from rrth_planner.timing.parameterization import parameterize
from worlds import examples, limits

SEEDS = st.integers(0, 2**32 - 1)
# What rounding leaves of positions of a few radians [rad].
ROUNDING = 2e-14


def a_motion(rng):
    """Return a timed path with stops and rounded corners: the jerk jumps at most of its points."""
    n, dof = int(rng.integers(2, 5)), int(rng.integers(1, 7))
    q = rng.standard_normal((n, dof)) * rng.choice([0.3, 1.0])
    edges = np.diff(q, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    u = edges / lengths[:, None]
    blends = tuple(
        Blend(
            corner=q[i],
            u_in=u[i - 1],
            u_out=u[i],
            half_length=rng.choice([0.0, rng.uniform(0.05, 0.45)]) * min(lengths[i - 1 : i + 1]),
        )
        for i in range(1, n - 1)
    )
    return parameterize(Path(q), blends, limits(dof))


def a_cut(rng, motion):
    """Return a time within a motion, often at or close to one of its points [s]."""
    if rng.random() < 0.3:
        return rng.uniform(0.0, motion.duration)
    away = rng.choice([-1.0, 0.0, 1.0]) * 10.0 ** rng.uniform(-12.0, -3.0)
    return float(np.clip(rng.choice(motion.times) + away, 0.0, motion.duration))


def test_times(motion, *more):
    """Return instants of a motion, close to its points too [s]."""
    near = motion.times[:, None] + [-1e-4, -1e-5, -1e-7, 0.0, 1e-7, 1e-5, 1e-4]
    times = np.concatenate([np.linspace(0.0, motion.duration, 200), near.ravel(), more])
    return np.unique(np.clip(times, 0.0, motion.duration))


test_times.__test__ = False


@examples(400)
@given(seed=SEEDS)
def test_a_part_of_a_trajectory_is_that_trajectory(seed):
    rng = np.random.default_rng(seed)
    motion = a_motion(rng)
    begin, end = sorted(a_cut(rng, motion) for _ in range(2))
    part = part_of(motion, begin, end)
    assert part.duration == end - begin
    times = test_times(part)
    assert np.abs(positions_at(part, times) - positions_at(motion, begin + times)).max() < ROUNDING
    # Its points are those of the motion, but for both ends.
    assert len(part.times) <= len(motion.times) + 1
    for row, whole in zip(part.positions[1:-1], motion.positions, strict=False):
        assert (row == motion.positions).all(axis=1).any(), whole


@examples(200)
@given(seed=SEEDS)
def test_velocity_and_acceleration_of_a_part_are_those_of_the_trajectory(seed):
    rng = np.random.default_rng(seed)
    motion = a_motion(rng)
    begin, end = sorted(a_cut(rng, motion) for _ in range(2))
    part = part_of(motion, begin, end)
    # In a short piece the last digit of a position is a speed.
    if len(part.times) == 1 or np.diff(part.times).min() < 1e-4:
        return
    for mine, its, rounding in zip(
        sample(part, times := test_times(part)),
        sample(motion, np.clip(begin + times, 0.0, motion.duration)),
        (ROUNDING, 1e-8, 2e-3),
        strict=True,
    ):
        assert np.abs(mine - its).max() < rounding


@examples(200)
@given(seed=SEEDS)
def test_a_trajectory_with_cuts_is_that_trajectory_and_has_a_point_at_each(seed):
    rng = np.random.default_rng(seed)
    motion = a_motion(rng)
    cuts = np.sort([a_cut(rng, motion) for _ in range(5)])
    # One of them twice.
    cuts = np.sort(np.append(cuts, cuts[2]))
    part, places = cut_at(motion, cuts)
    assert (part.times[places] == cuts - cuts[0]).all()
    assert len(part.times) <= len(motion.times) + len(cuts)
    times = test_times(part)
    assert np.abs(positions_at(part, times) - positions_at(motion, cuts[0] + times)).max() < (
        ROUNDING
    )


@given(seed=SEEDS)
def test_a_part_of_a_part_is_a_part_of_the_trajectory(seed):
    rng = np.random.default_rng(seed)
    motion = a_motion(rng)
    begin, end = sorted(a_cut(rng, motion) for _ in range(2))
    part = part_of(motion, begin, end)
    first, last = sorted(a_cut(rng, part) for _ in range(2))
    inner, direct = part_of(part, first, last), part_of(motion, begin + first, begin + last)
    times = test_times(inner)
    assert np.abs(positions_at(inner, times) - positions_at(direct, times)).max() < 2 * ROUNDING


@examples(200)
@given(seed=SEEDS)
def test_both_parts_joined_are_the_trajectory(seed):
    rng = np.random.default_rng(seed)
    motion = a_motion(rng)
    # Beside a point, not on it, the two parts go on by different polynomials.
    cut = near_point(motion, a_cut(rng, motion))
    whole = joined(part_of(motion, 0.0, cut), part_of(motion, cut, motion.duration))
    times = test_times(motion, cut)
    assert whole.duration == pytest.approx(motion.duration, abs=1e-12)
    assert np.abs(positions_at(whole, times) - positions_at(motion, times)).max() < 2 * ROUNDING


def test_a_part_from_point_to_point_has_the_rows_of_the_trajectory():
    motion = a_motion(np.random.default_rng(3))
    part = part_of(motion, float(motion.times[2]), float(motion.times[-2]))
    for name in ('positions', 'velocities', 'accelerations'):
        assert np.array_equal(getattr(part, name), getattr(motion, name)[2:-1])
    assert np.array_equal(part.times, motion.times[2:-1] - motion.times[2])


def test_a_part_is_seen_by_the_reference_checker_as_the_trajectory_is():
    motion = a_motion(np.random.default_rng(5))
    begin, end = 0.31 * motion.duration, 0.77 * motion.duration
    part = part_of(motion, begin, end)
    grid, q, v, a = quintic_states(part, 1e-3)
    for mine, its, most in zip(
        (q, v, a), sample(motion, begin + grid), (1e-13, 1e-10, 1e-8), strict=True
    ):
        assert np.abs(mine - its).max() < most


@pytest.mark.parametrize(('begin', 'end'), [(0.4, 0.4), (0.5, 0.4), (2.0, 3.0), (-2.0, -1.0)])
def test_where_nothing_is_left_a_single_point_is(begin, end):
    still = np.zeros((2, 1))
    motion = Trajectory(
        times=[0.0, 1.0], positions=[[0.0], [1.0]], velocities=still, accelerations=still
    )
    part = part_of(motion, begin, end)
    assert part.times.tolist() == [0.0]
    assert part.positions[0] == positions_at(motion, [min(max(end, 0.0), 1.0)])[0]


@examples(50)
@given(seed=SEEDS)
def test_a_trajectory_that_was_sent_is_the_same_and_cannot_be_changed(seed):
    motion = a_motion(np.random.default_rng(seed))
    sent = pickle.loads(pickle.dumps(motion))
    for before, after in zip(
        (motion.times, *motion.states), (sent.times, *sent.states), strict=True
    ):
        np.testing.assert_array_equal(before, after)
        # As compiled code takes it.
        assert after.flags.c_contiguous
        assert after.flags.aligned
        assert not after.flags.writeable
