# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Goals keep away from the joints' limits; a start a little beyond one is led in."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.reference_checker import first_contact, quintic_states
from rrth_planner.collision.world import arm_world
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.model.arm import ArmModel, Capsule, tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionState, sample, StartState
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.pointing_goals import numerical, pointing_kernels
from rrth_planner.timing.braking import brake
from worlds import (
    capsule_arm,
    compiled_chain,
    examples,
    FOLDED,
    free_configuration,
    limits,
    MARGIN,
    QUARTER,
    random_boxes,
    RAY,
    self_distances,
    table_1_arm,
    wearer,
    wearer_world,
)

pipeline = pytest.importorskip('rrth_planner.pipeline.plan_motion', exc_type=ImportError)
OPTIONS = RRTHOptions(improve_time=0.0, time_limit=600.0)
AHEAD = np.array([1.5, 0.1, 0.3])
# How far a joint may begin beyond its limit, and how far from it goals keep [rad], [m].
BEYOND, BEYOND_SLIDING = 0.05, 0.005
ROOM, ROOM_SLIDING = 0.005, 0.0005


def ask(arm, scene, q_start, target, *, ray=RAY, options=OPTIONS, seed=1, **more):
    return pipeline.plan_motion(
        arm,
        scene,
        q_start,
        PointingGoal(target),
        limits(arm.dof),
        options,
        margin=MARGIN,
        ray_guard_length=ray,
        seed=seed,
        **more,
    )


def excesses(arm, q):
    """Return how far joints are beyond their limits, (n, dof) -> (n, dof) [rad or m]; < 0: not."""
    return np.maximum(arm.bounds[0] - q, q - arm.bounds[1])


def assert_led_in(arm, scene, q_start, motion, *, ray=RAY, escape_time=0.0, excess=1.001):
    """Each joint that begins beyond a limit moves towards it only; all else is as ever."""
    times, q, v, a = quintic_states(motion, 1e-3)
    assert np.array_equal(q[0], q_start)
    begin = np.maximum(excesses(arm, q[:1])[0], 0.0)
    # No further from its range than at any time before.
    least = np.minimum.accumulate(np.maximum(excesses(arm, q), 0.0), axis=0)
    assert (excesses(arm, q)[1:] <= least[:-1] + 1e-9).all()
    assert (least[-1] == 0.0).all()
    for k in np.flatnonzero(begin > 0.0):
        side = 1.0 if q[0, k] > arm.bounds[1, k] else -1.0
        outside = q[: np.argmax(excesses(arm, q)[:, k] <= 0.0) + 1, k]
        assert (side * np.diff(outside) <= 1e-9).all()
    assert (np.abs(v) <= limits(arm.dof).velocity * excess).all()
    assert (np.abs(a) <= limits(arm.dof).acceleration * excess).all()
    assert first_contact(arm, scene, q[times >= escape_time], ray, MARGIN - 1e-6) is None


def at_limits(arm, rng, world, joints, sides, by):
    """Return a start with some joints beyond a limit by so much, and free at the limit."""
    for _ in range(10_000):
        q = rng.uniform(*arm.bounds)
        q[joints] = arm.bounds[sides, joints]
        if world.is_valid(q):
            q[joints] += np.where(sides, by, -by)
            if world.is_free(q):
                return q
    return None


def test_of_400_motions_from_the_folded_start_none_ends_at_a_limit():
    arm, rng, n_solved = table_1_arm(), np.random.default_rng(3), 0
    for _ in range(400):
        plan = ask(arm, wearer(), FOLDED, rng.uniform([-2.0, -2.0, -1.2], [2.5, 2.0, 1.8]))
        if plan.trajectory is not None:
            n_solved += 1
            assert -excesses(arm, plan.trajectory.positions[-1]).max() >= ROOM - 1e-9
    assert n_solved > 380


@pytest.mark.parametrize('seed', range(3))
def test_goals_of_an_arm_that_aims_numerically_keep_away_from_limits(seed):
    rng = np.random.default_rng(seed)
    arm = capsule_arm(rng)
    dh = arm.dh.copy()
    dh[-1, 1] = 0.02
    arm = replace(arm, dh=dh)
    assert pointing_kernels(arm) is numerical()
    world, n_found = arm_world(arm, Scene(()), MARGIN, 0.2), 0
    for _ in range(30):
        q_start, target = free_configuration(rng, world), rng.uniform(-1.5, 1.5, 3)
        plan = ask(arm, Scene(()), q_start, target, ray=0.2)
        if plan.trajectory is not None:
            n_found += 1
            assert -excesses(arm, plan.trajectory.positions[-1]).max() >= ROOM - 1e-9
    assert n_found > 10


def pan_tilt(pan=(-1.0, 1.0), tilt=(-1.0, 1.0), slide=None):
    """Return a pan and tilt unit whose ray is along x at 0; on a rail along z, where it slides."""
    rows = [[0.0, 0.0, 0.0, 0.1], [QUARTER, 0.0, QUARTER, 0.0], [QUARTER, 0.0, 0.0, 0.0]]
    joint_limits, first = [pan, tilt], 0
    if slide is not None:
        rows, joint_limits, first = [[0.0, 0.0, 0.0, 0.0], *rows], [slide, *joint_limits], 1
    dof = len(joint_limits)
    return ArmModel(
        joint_names=('rail', 'pan', 'tilt')[-dof:],
        is_prismatic=(True, False, False)[1 - first :],
        dh=np.array(rows),
        bounds=np.array(joint_limits).T,
        radii=np.zeros(dof + 1),
        T_base_mount=np.eye(4),
    )


def along_the_ray(arm, q):
    """Return a target on the ray of an arm at q [m]."""
    T = tool_pose(arm, np.array(q))
    return T[:3, 3] + 1.2 * T[:3, 2]


@pytest.mark.parametrize('near', [0.003, 1e-4, 0.0])
def test_where_every_goal_is_near_a_limit_one_of_them_is_taken(near):
    arm = pan_tilt()
    q_goal = np.array([1.0 - near, 0.4])
    target = along_the_ray(arm, q_goal)
    plan = ask(arm, Scene(()), np.zeros(2), target)
    assert plan.status is PlanStatus.SOLVED, plan.sentence
    np.testing.assert_allclose(plan.trajectory.positions[-1], q_goal, atol=1e-6)


def test_a_goal_that_keeps_away_is_taken_before_one_that_is_nearer():
    arm = pan_tilt(slide=(-0.3, 0.3))
    # At the end of the rail the arm would have to move least.
    q_start = np.array([0.2999, 0.0, 0.0])
    plan = ask(arm, Scene(()), q_start, along_the_ray(arm, q_start + [0.0, 0.3, 0.2]))
    assert 0.3 - plan.trajectory.positions[-1, 0] >= ROOM_SLIDING - 1e-9


def test_a_joint_with_next_to_no_range_keeps_to_the_middle_of_it():
    arm = pan_tilt(slide=(0.1, 0.1004))
    plan = ask(arm, Scene(()), [0.1, 0.0, 0.0], along_the_ray(arm, [0.1001, 0.5, 0.5]))
    assert plan.status is PlanStatus.SOLVED
    assert 0.1 + 0.99e-4 <= plan.trajectory.positions[-1, 0] <= 0.1004 - 0.99e-4
    arm = pan_tilt(pan=(-0.004, 0.004))
    plan = ask(arm, Scene(()), [0.004, 0.0], along_the_ray(arm, [0.001, 0.5]))
    np.testing.assert_allclose(plan.trajectory.positions[-1], [0.001, 0.5], atol=1e-6)


@pytest.mark.parametrize('by', [1e-5, 1e-3, 0.01, 0.05])
def test_a_start_beyond_a_limit_is_led_in(by):
    arm, rng = table_1_arm(), np.random.default_rng(7)
    n_solved = 0
    for k in range(arm.dof):
        for side in range(2):
            q = at_limits(arm, rng, wearer_world(), np.array([k]), np.array([side]), by)
            plan = ask(arm, wearer(), q, AHEAD)
            assert plan.status is PlanStatus.SOLVED, plan.sentence
            assert (
                f'{arm.joint_names[k]} led in from {by:.2g} rad beyond its limit' in plan.sentence
            )
            assert np.array_equal(plan.path.waypoints[0], q)
            assert_led_in(arm, wearer(), q, plan.trajectory, escape_time=plan.escape_time)
            n_solved += 1
    assert n_solved == 8


def test_further_beyond_the_start_is_rejected():
    arm = table_1_arm()
    for k, name in enumerate(arm.joint_names):
        for side, sign in ((0, -1.0), (1, 1.0)):
            q = FOLDED.copy()
            q[k] = arm.bounds[side, k] + sign * 0.051
            plan = ask(arm, wearer(), q, AHEAD)
            low, high = arm.bounds[:, k]
            assert plan.status is PlanStatus.START_OUT_OF_BOUNDS
            assert plan.sentence == (
                f'{name} is at {q[k]:.6g} rad, expected {low:.6g} to {high:.6g} rad, seed 1'
            )


def test_several_joints_are_led_in_at_once_turning_and_sliding():
    arm = pan_tilt(slide=(-0.3, 0.3))
    for by, by_sliding in ((BEYOND, BEYOND_SLIDING), (0.02, 1e-4)):
        q = np.array([0.3 + by_sliding, -1.0 - by, 1.0 + by])
        plan = ask(arm, Scene(()), q, along_the_ray(arm, [0.0, 0.3, -0.3]))
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        assert f'rail led in from {by_sliding:.2g} m' in plan.sentence
        assert_led_in(arm, Scene(()), q, plan.trajectory)
    q = np.array([0.3 + BEYOND_SLIDING + 1e-4, 0.0, 0.0])
    plan = ask(arm, Scene(()), q, along_the_ray(arm, [0.0, 0.3, -0.3]))
    assert plan.status is PlanStatus.START_OUT_OF_BOUNDS
    assert plan.sentence.startswith('rail is at 0.3051 m, expected -0.3 to 0.3 m')


def test_a_continuous_joint_is_led_in_from_up_to_a_turn_beyond():
    arm = replace(pan_tilt(pan=(-np.pi, np.pi)), is_continuous=(True, False))
    target = along_the_ray(arm, [0.0, 0.3])
    assert ask(arm, Scene(()), [np.pi, 0.0], target).status is PlanStatus.SOLVED
    for beyond in (1e-5, 0.01, 6.28):
        plan = ask(arm, Scene(()), [np.pi + beyond, 0.0], target)
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        assert 'pan led in from' in plan.sentence
    plan = ask(arm, Scene(()), [3.01 * np.pi, 0.0], target)
    assert plan.status is PlanStatus.START_OUT_OF_BOUNDS
    assert plan.sentence.startswith('pan is at 9.456')
    assert ask(arm, Scene(()), [np.pi, 1.01], target).status is PlanStatus.SOLVED


def test_an_arm_that_is_being_led_in_can_be_given_another_motion_or_stopped():
    arm, rng, n_handed = table_1_arm(), np.random.default_rng(8), 0
    q = np.array([0.0, 0.05, QUARTER, QUARTER])
    motion = ask(arm, wearer(), q, AHEAD).trajectory
    for time in rng.uniform(0.02, 0.3, 12):
        q_now, v, a = (row[0] for row in sample(motion, [time]))
        if excesses(arm, q_now).max() <= 1e-4:
            continue
        moving = StartState(
            state=MotionState(positions=q_now, velocities=v, accelerations=a),
            running=motion,
            time=time,
        )
        target = rng.uniform([0.8, -1.5, -0.5], [2.0, 1.5, 1.0])
        plan = ask(arm, wearer(), q_now, target, moving=moving)
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        assert_led_in(arm, wearer(), q_now, plan.trajectory, excess=1.02)
        n_handed += 1
        stop = brake(motion, time, limits())
        ends = quintic_states(stop, 1e-3)[1]
        assert (np.diff(ends[:, 1]) <= 1e-9).all()
        plan = ask(arm, wearer(), stop.positions[-1], target)
        assert plan.status is PlanStatus.SOLVED, plan.sentence
        assert_led_in(arm, wearer(), stop.positions[-1], plan.trajectory)
    assert n_handed >= 4


def test_an_arm_that_moves_out_beyond_its_limit_is_not_led_in():
    arm, still = table_1_arm(), np.zeros(4)
    q = np.array([0.0, 0.01, QUARTER, QUARTER])
    state = MotionState(
        positions=q, velocities=np.array([0.0, 0.2, 0.0, 0.0]), accelerations=still
    )
    plan = ask(arm, wearer(), q, AHEAD, moving=StartState(state=state))
    assert plan.status is PlanStatus.START_MOVES
    assert 'joint_2 moves too fast to stop straight ahead' in plan.sentence


def test_an_escape_from_beyond_a_limit_is_one_motion_or_one_sentence():
    arm, rng, said = table_1_arm(), np.random.default_rng(9), []
    for _ in range(60):
        k, side = int(rng.integers(4)), int(rng.integers(2))
        q = at_limits(arm, rng, wearer_world(), np.array([k]), np.array([side]), 0.02)
        T = tool_pose(arm, q)
        # A hand that the tool, or the ray near it, is a little inside of.
        place = T[:3, 3] + rng.uniform(0.0, 0.05) * T[:3, 2] + rng.normal(0.0, 0.02, 3)
        scene = Scene((*wearer().boxes, Box('hand', place, np.full(3, 0.05), np.eye(3))))
        if arm_world(arm, scene, MARGIN, RAY).is_free(q):
            continue
        plan = ask(arm, scene, q, AHEAD)
        said.append(plan.status)
        if plan.status is PlanStatus.SOLVED:
            assert plan.escape_time > 0.0
            assert_led_in(arm, scene, q, plan.trajectory, escape_time=plan.escape_time)
        else:
            assert plan.status in (
                PlanStatus.START_IN_COLLISION,
                PlanStatus.START_OUT_OF_BOUNDS,
                PlanStatus.GOAL_IN_COLLISION,
            )
    assert said.count(PlanStatus.SOLVED) >= 5


def test_where_the_way_to_the_limit_is_not_free_the_start_is_rejected():
    arm = pan_tilt(pan=(-1.0, 1.0))
    q = np.array([1.05, 0.0])
    # Beside the ray, on the side of the limit.
    T = tool_pose(arm, np.array([1.01, 0.0]))
    box = Box('hand', T[:3, 3] + 0.9 * T[:3, 2], np.full(3, 0.01), np.eye(3))
    plan = ask(arm, Scene((box,)), q, along_the_ray(arm, [0.0, 0.3]))
    assert plan.status is PlanStatus.START_OUT_OF_BOUNDS, plan.sentence
    assert plan.sentence.startswith(
        'pan is at 1.05 rad, expected -1 to 1 rad, or a way to its limit that is free'
    )


def folding_arm():
    """Return an arm whose third link meets the first one 0.03 rad beyond a limit of joint 3."""
    dh = np.zeros((5, 4))
    dh[1:3, 1] = 0.3
    dh[3] = [QUARTER, 0.0, 0.0, 0.0]
    bar = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    capsules = (
        Capsule(name='upper arm', link=1, ends=bar, radius=0.02),
        Capsule(
            name='hand', link=3, ends=np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]]), radius=0.02
        ),
    )
    last = np.pi + np.arcsin((0.3 - 0.04) / 0.4) - QUARTER - 0.03
    return ArmModel(
        joint_names=('a', 'b', 'c', 'd'),
        is_prismatic=(False,) * 4,
        dh=dh,
        bounds=np.array([[-1.0, QUARTER - 1e-4, last - 1.0, -1.0], [1.0, QUARTER, last, 1.0]]),
        radii=np.array([-1.0, -1.0, -1.0, -1.0, 0.0]),
        T_base_mount=np.eye(4),
        capsules=capsules,
    )


def test_links_that_meet_only_beyond_the_limits_are_seen_to_meet():
    arm = folding_arm()
    last = arm.bounds[1, 2]
    target = np.array([0.3, 0.3, 1.5])
    free = ask(arm, Scene(()), [0.0, QUARTER, last + 0.01, 0.0], target, ray=0.05)
    assert free.status is not PlanStatus.START_IN_COLLISION
    plan = ask(arm, Scene(()), [0.0, QUARTER, last + 0.045, 0.0], target, ray=0.05)
    assert plan.status is PlanStatus.START_IN_COLLISION, plan.sentence
    assert 'upper arm and hand of the arm collide' in plan.sentence


@examples(60)
@given(seed=st.integers(0, 2**32 - 1))
def test_random_arms_are_led_in_among_random_boxes(seed):
    rng = np.random.default_rng(seed)
    arm = capsule_arm(rng) if seed % 6 == 0 else compiled_chain(rng, seed % 2)
    scene = random_boxes(rng, 3)
    world = arm_world(arm, scene, MARGIN, RAY)
    slides = np.array(arm.is_prismatic)
    joints = np.flatnonzero(rng.random(arm.dof) < 0.5)
    sides = rng.integers(0, 2, len(joints))
    by = rng.choice([0.0, 0.2, 1.0]) * np.where(slides, BEYOND_SLIDING, BEYOND)[joints]
    by = np.maximum(by, 1e-5)
    q = at_limits(arm, rng, world, joints, sides, by)
    if q is None:
        return
    plan = ask(arm, scene, q, rng.uniform(-2.0, 2.0, 3), seed=0)
    if plan.trajectory is not None:
        assert_led_in(arm, scene, q, plan.trajectory, escape_time=plan.escape_time)
        _, places, _, _ = quintic_states(plan.trajectory, 0.01)
        if world.pair_names:
            assert self_distances(arm, places, RAY).min() > -1e-6
    else:
        assert plan.status is not PlanStatus.NOT_CERTIFIED, plan.sentence


def test_the_example_of_a_continuous_joint_is_one():
    arm = load_arm(resource_path('config/examples/chest_arm.yaml'))
    assert [n for n, c in zip(arm.joint_names, arm.is_continuous, strict=True) if c] == [
        'wrist_roll'
    ]
