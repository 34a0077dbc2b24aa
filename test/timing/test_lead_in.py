# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motions that begin while the arm moves: no jump, within limits, on free ground."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.reference_checker import quintic_states
from rrth_planner.execution.executing_motion import predict_start_state, sharp_phase_of
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import (
    joined,
    MotionState,
    piece_coefficients,
    REST_SPEED,
    sample,
    StartState,
)
from rrth_planner.pipeline import time_path
from rrth_planner.pipeline.plan_motion import plan_motion
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.timing.braking import brake
from rrth_planner.timing.lead_in import lead_in, reserved
from rrth_planner.timing.parameterization import limit_ratio, parameterize
from worlds import (
    dense_touch,
    examples,
    free_configuration,
    limits,
    MARGIN,
    RAY,
    table_1_arm,
    wearer,
    wearer_world,
)

SEEDS = st.integers(0, 2**32 - 1)


def random_state(rng, bounds):
    """Return a state whose velocity stays within the limits while its acceleration fades."""
    a = bounds.acceleration * rng.uniform(-1.0, 1.0, len(bounds.velocity)) * rng.integers(0, 2)
    fading = 0.52 * a**2 / bounds.jerk + 2e-3
    v = (bounds.velocity - fading) * rng.uniform(-1.0, 1.0, len(a))
    return MotionState(positions=rng.uniform(-1.0, 1.0, len(a)), velocities=v, accelerations=a)


@examples(200)
@given(seed=SEEDS)
def test_a_lead_in_begins_with_the_state_and_ends_straight_ahead(seed):
    rng = np.random.default_rng(seed)
    bounds = limits(int(rng.integers(1, 7)))
    state = random_state(rng, bounds)
    lead = lead_in(state, bounds)
    first = lead.trajectory
    assert np.array_equal(first.positions[0], state.positions)
    assert np.array_equal(first.velocities[0], state.velocities)
    assert np.abs(first.accelerations[0] - state.accelerations).max() < 1e-12
    assert not first.accelerations[-1].any()
    rest = parameterize(Path([first.positions[-1], lead.q_stop]), (), reserved(bounds), lead.speed)
    whole = joined(first, rest)
    assert limit_ratio(whole, bounds) <= 1.002
    # The reference checker's quintics through the points: velocity and acceleration have no jumps.
    grid, q, v, a = quintic_states(whole, 0.001)
    step = np.diff(grid)[:, None]
    assert (np.abs(np.diff(a, axis=0)) <= 1.01 * bounds.jerk * step + 1e-4).all()
    assert (np.abs(np.diff(v, axis=0)) <= 1.01 * bounds.acceleration * step + 1e-6).all()
    assert not whole.velocities[-1].any()
    assert np.array_equal(whole.positions[-1], lead.q_stop)


def motion(scene, q_start, target, seed, moving=None):
    return plan_motion(
        table_1_arm(),
        scene,
        q_start,
        PointingGoal(target),
        limits(),
        RRTHOptions(),
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=seed,
        moving=moving,
    )


@examples(60)
@given(seed=SEEDS)
def test_a_running_motion_is_taken_over_at_any_instant(seed):
    rng = np.random.default_rng(seed)
    scene, world = wearer(), wearer_world()
    before = motion(scene, free_configuration(rng, world), rng.uniform(-2.0, 2.0, 3), 1)
    if before.trajectory is None:
        return
    time = rng.uniform(0.0, before.trajectory.duration)
    q, v, a = (values[0] for values in sample(before.trajectory, [time]))
    state = MotionState(positions=q, velocities=v, accelerations=a)
    plan = motion(scene, q, rng.uniform(-2.0, 2.0, 3), 2, StartState(state=state))
    if plan.trajectory is None:
        assert plan.status is not PlanStatus.NOT_CERTIFIED
        return
    first = plan.trajectory
    assert np.array_equal(first.positions[0], q)
    assert np.abs(first.velocities[0] - v).max() < 1e-12
    assert np.abs(first.accelerations[0] - a).max() < 1e-12
    assert not first.velocities[-1].any()
    assert limit_ratio(first, limits()) <= 1.003
    for curve, width in zip(piece_coefficients(first), np.diff(first.times), strict=True):
        n = 2 + int(width / 2e-4)
        assert dense_touch(table_1_arm(), scene, MARGIN, RAY, curve, n) < 0


def test_an_arm_with_no_room_ahead_is_told_so():
    q = np.array([0.0, -0.8, 0.0, 0.0])
    # The tool would be inside of a box before the arm could stop.
    arm = table_1_arm()
    state = MotionState(
        positions=q, velocities=np.array([1.4, 0.0, 0.0, 0.0]), accelerations=np.zeros(4)
    )
    ahead = tool_pose(arm, lead_in(state, limits()).q_stop)[:3, 3]
    box = Box('wall', ahead, np.full(3, 0.02), np.eye(3))
    plan = motion(Scene((box,)), q, [0.0, 0.0, 2.0], 3, StartState(state=state))
    assert plan.status is PlanStatus.START_MOVES
    assert 'straight ahead' in plan.sentence


@pytest.mark.parametrize('rate', [0.1, 0.5, 1.0])
@examples(40)
@given(seed=SEEDS)
def test_an_arm_that_follows_a_motion_is_foreseen_to_go_on(rate, seed):
    rng = np.random.default_rng(seed)
    running = parameterize(Path(rng.standard_normal((2, 4))), (), limits())
    time, lead = rng.uniform(0.1, 0.7) * running.duration, 0.05
    q, v, _ = (values[0] for values in sample(running, [time]))
    found = predict_start_state(q, rate * v, running, lead).state
    q, v, a = (values[0] for values in sample(running, [time + rate * lead]))
    assert np.abs(found.positions - q).max() < 1e-6
    # In the time of the motion: what comes next is followed at the same rate.
    assert np.abs(found.velocities - v).max() < 1e-5
    assert np.abs(found.accelerations - a).max() < 1e-3


@pytest.mark.parametrize('rate', [0.1, 0.5, 1.0])
@examples(40)
@given(seed=SEEDS)
def test_an_arm_that_hardly_moves_is_found_where_its_reading_is_exact(rate, seed):
    rng = np.random.default_rng(seed)
    running = parameterize(Path(rng.standard_normal((2, 4))), (), limits())
    time = rng.uniform(0.005, 0.02)
    q, v, _ = (values[0] for values in sample(running, [time]))
    assert np.abs(v).max() <= REST_SPEED
    np.testing.assert_allclose(sharp_phase_of(q, rate * v, running), (time, rate), rtol=1e-3)
    # Noise, even that of a good encoder, has no direction; nor is an arm ahead of its motion.
    across = np.linalg.norm(v) * np.linalg.svd(v[None])[2][-1]
    for other in (rate * v + 0.1 * across, np.zeros(4), 1.1 * v, -v):
        assert sharp_phase_of(q, other, running) is None


@examples(30)
@given(seed=SEEDS)
def test_an_arm_with_no_room_ahead_stops_along_its_motion_first(seed):
    rng = np.random.default_rng(seed)
    scene, world = wearer(), wearer_world()
    before = motion(scene, free_configuration(rng, world), rng.uniform(-2.0, 2.0, 3), 1)
    if before.trajectory is None:
        return
    time = rng.uniform(0.0, before.trajectory.duration)
    q, v, a = (values[0] for values in sample(before.trajectory, [time]))
    state = MotionState(positions=q, velocities=v, accelerations=a)
    moving = StartState(state=state, running=before.trajectory, time=time)
    plan = motion(scene, q, rng.uniform(-2.0, 2.0, 3), 2, moving)
    # Along a motion that is proven free it can stop; it may just fail to be proven, since the
    # curve through the points of the stop is off the path by a little.
    if plan.status is PlanStatus.START_MOVES:
        assert not certify(brake(before.trajectory, time, limits()), world).is_proven
    if plan.trajectory is not None:
        assert np.array_equal(plan.trajectory.positions[0], q)
        assert np.abs(plan.trajectory.velocities[0] - v).max() < 1e-12


def test_an_arm_on_another_way_goes_on_at_its_velocity():
    running = parameterize(Path([np.zeros(4), np.ones(4)]), (), limits())
    q, v = np.full(4, 0.5) + [0.1, 0.0, 0.0, 0.0], np.array([0.3, 0.0, 0.0, 0.0])
    found = predict_start_state(q, v, running, 0.1).state
    assert np.allclose(found.positions, q + 0.1 * v)
    assert np.array_equal(found.velocities, v)
    assert not found.accelerations.any()


@pytest.mark.parametrize('before_end', [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.05])
def test_a_motion_is_taken_over_where_it_ends(before_end):
    scene, world = wearer(), wearer_world()
    q_start = np.array([0.0, -0.35, 0.5 * np.pi, 0.5 * np.pi])
    # By several corners, so that rounding leaves something of the speed.
    running = motion(scene, q_start, [0.3, 1.4, 0.2], 1).trajectory
    assert running is not None
    q, v, a = (values[0] for values in sample(running, [running.duration - before_end]))
    # As the end of a motion comes out of `sample` on its own: nearly, not quite, at rest.
    state = MotionState(positions=q, velocities=v + 3e-16, accelerations=a - 8e-15)
    moving = StartState(state=state, running=running, time=running.duration - before_end)
    found = motion(scene, q, [0.5, 0.3, 1.6], 1, moving)
    assert found.status is PlanStatus.SOLVED, found.sentence
    assert np.array_equal(found.trajectory.positions[0], q)
    assert certify(found.trajectory, world).is_proven


@examples(150)
@given(seed=SEEDS)
def test_in_its_last_milliseconds_a_motion_is_taken_over_within_the_limits(seed):
    rng = np.random.default_rng(seed)
    scene, world = wearer(), wearer_world()
    before = motion(scene, free_configuration(rng, world), rng.uniform(-2.0, 2.0, 3), 1).trajectory
    if before is None:
        return
    time = before.duration - rng.uniform(0.0, 0.012)
    q, v, a = (values[0] for values in sample(before, [time]))
    moving = StartState(
        state=MotionState(positions=q, velocities=v, accelerations=a), running=before, time=time
    )
    taken = motion(scene, q, rng.uniform(-2.0, 2.0, 3), 2, moving).trajectory
    if taken is None:
        return
    grid, q, v, a = quintic_states(taken, 1e-4)
    assert np.abs(v).max() <= 1.01 * limits().velocity[0]
    assert np.abs(a).max() <= 1.01 * limits().acceleration[0]
    assert np.abs(np.diff(a, axis=0) / np.diff(grid)[:, None]).max() <= 1.01 * limits().jerk[0]
    assert (q >= table_1_arm().bounds[0] - 1e-6).all()
    assert (q <= table_1_arm().bounds[1] + 1e-6).all()


def test_a_motion_that_would_break_the_limits_is_none(monkeypatch):
    rng = np.random.default_rng(3)
    q = free_configuration(rng, wearer_world())
    state = MotionState(positions=q, velocities=np.full(4, 0.3), accelerations=np.zeros(4))
    assert motion(wearer(), q, [1.5, 0.1, 0.3], 2, StartState(state=state)).trajectory is not None
    monkeypatch.setattr(time_path, 'EXCESS', 0.5)
    plan = motion(wearer(), q, [1.5, 0.1, 0.3], 2, StartState(state=state))
    assert plan.status is PlanStatus.START_MOVES
    assert plan.trajectory is None
    assert 'respects the limits of its joints' in plan.sentence
