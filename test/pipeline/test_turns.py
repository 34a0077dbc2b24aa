# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Continuous joints: no wall at half a turn, a start of any turn, and cables that may wind."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest

pytest.importorskip('fcl')

from rrth_planner.collision.certificate import certify  # noqa: E402
from rrth_planner.collision.motion_inspection import inspect_motion  # noqa: E402
from rrth_planner.collision.trajectory_validation import violation_seen  # noqa: E402
from rrth_planner.collision.world import arm_world  # noqa: E402
from rrth_planner.io.settings import load_settings  # noqa: E402
from rrth_planner.io.wearer_file import load_body  # noqa: E402
from rrth_planner.model.arm import ArmModel, pointing_error, tool_pose  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.required_clearance import RequiredClearance  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.status import PlanStatus  # noqa: E402
from rrth_planner.model.trajectory import MotionState, sample, StartState  # noqa: E402
from rrth_planner.pipeline.plan_motion import plan_motion  # noqa: E402
from rrth_planner.planning.options import (  # noqa: E402
    InformedRRTStarOptions,
    RRTHOptions,
    RRTStarOptions,
)
from rrth_planner.planning.pointing_goals import (  # noqa: E402
    FEW_DRAWS,
    goal_configurations,
    pointing_problem,
)
from worlds import examples  # noqa: E402

HALF, TURN, QUARTER = np.pi, 2.0 * np.pi, 0.5 * np.pi
TURNS = 3
MARGIN, RAY = 0.02, 0.5
# Kinematics of a Kinova Gen3 of seven joints, from the URDF of ros2_kortex: origin [m] and first
# angle [rad] of each joint; those without a limit are continuous.
GEN3 = (
    ((0.0, 0.0, 0.15643), HALF, None),
    ((0.0, 0.005375, -0.12838), QUARTER, 2.41),
    ((0.0, -0.21038, -0.006375), -QUARTER, None),
    ((0.0, 0.006375, -0.21038), QUARTER, 2.66),
    ((0.0, -0.20843, -0.006375), -QUARTER, None),
    ((0.0, 0.00017505, -0.10593), QUARTER, 2.23),
    ((0.0, -0.10593, -0.00017505), -QUARTER, None),
)
FREE = np.array([limit is None for _, _, limit in GEN3])


def gen3(max_turns=TURNS):
    """Return a Gen3 with bars of 4 cm on the back."""
    dh_parameters = pytest.importorskip('rrth_planner.io.urdf.dh_parameters')
    T, points, directions = np.eye(4), [], []
    for xyz, roll, _ in GEN3:
        c, s = np.cos(roll), np.sin(roll)
        T = T @ np.block(
            [
                [np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([xyz]).T],
                [np.zeros((1, 3)), np.ones((1, 1))],
            ]
        )
        points.append(T[:3, 3])
        directions.append(T[:3, 2])
    points.append(T[:3, 3] - 0.061525 * T[:3, 2])
    directions.append(-T[:3, 2])
    T_0, dh, _ = dh_parameters.rows_of_axes(
        np.array(points), np.array(directions), np.array([1.0, 0.0, 0.0])
    )
    high = np.array([TURN * max_turns if limit is None else limit for _, _, limit in GEN3])
    T_base_link = np.eye(4)
    T_base_link[:3, 3] = -0.21, 0.0, 0.25
    return ArmModel(
        joint_names=tuple(f'joint_{k + 1}' for k in range(7)),
        is_prismatic=(False,) * 7,
        dh=dh,
        bounds=np.array([-high, high]),
        radii=np.full(8, 0.04),
        T_base_mount=T_base_link @ T_0,
        is_continuous=tuple(FREE),
    )


def pan_tilt(max_turns=TURNS, radius=0.0):
    """Return a pan and tilt unit whose pan joint is continuous; its ray is along x at 0."""
    return ArmModel(
        joint_names=('pan', 'tilt'),
        is_prismatic=(False, False),
        dh=np.array(
            [[0.0, 0.0, 0.0, 0.1], [QUARTER, 0.0, QUARTER, 0.0], [QUARTER, 0.1, 0.0, 0.0]]
        ),
        bounds=np.array([[-TURN * max_turns, -0.4], [TURN * max_turns, 0.4]]),
        radii=np.full(3, radius),
        T_base_mount=np.eye(4),
        is_continuous=(True, False),
    )


def ask(arm, scene, q_start, target, *, options=None, seed=1, **more):
    """Plan without a clock, so that the answer is always the same."""
    return plan_motion(
        arm,
        scene,
        np.array(q_start, float),
        PointingGoal(target),
        load_settings(arm.dof).limits,
        options or RRTHOptions(time_limit=600.0, improve_time=600.0),
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=seed,
        **more,
    )


def along_the_ray(arm, q, far=1.2):
    """Return a target on the ray of an arm at q [m]."""
    T = tool_pose(arm, np.array(q, float))
    return T[:3, 3] + far * T[:3, 2]


def wall(angle, wide=0.6):
    """Return a box in the way of a pan and tilt unit at an angle of its pan joint [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    size, R = np.array([0.2, wide, 3.0]), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return Box('post', R @ np.array([0.4, 0.0, 0.0]), size, R)


def free_starts(arm, scene, rng, n, low, high):
    """Return free configurations of the arm, the joints within limits of their own."""
    world, found = arm_world(arm, scene, MARGIN + 0.01, RAY), []
    while len(found) < n:
        q = rng.uniform(low, high)
        if world.is_valid(q):
            found.append(q)
    return np.array(found)


def assert_good(arm, scene, plan, q_start, target):
    """Check a motion by all checkers; it begins where the arm is and ends on the target."""
    assert plan.status is PlanStatus.SOLVED, plan.sentence
    motion = plan.trajectory
    assert np.abs(motion.positions[0] - q_start).max() < 1e-9
    assert pointing_error(arm, motion.positions[-1], target) < 1e-6
    world = arm_world(arm, scene, MARGIN, RAY)
    assert certify(motion, world, plan.escape_time).is_proven
    reach = float(np.linalg.norm(target - tool_pose(arm, motion.positions[-1])[:3, 3]))
    required = RequiredClearance(arm, MARGIN, RAY)
    assert violation_seen(required, scene, motion, reach, plan.escape_time) is None
    if plan.escape_time == 0.0:
        limits = load_settings(arm.dof).limits
        inspect_motion(
            arm,
            scene,
            motion,
            limits,
            q_present=np.asarray(q_start, float),
            target=target,
            margin=MARGIN,
            ray_guard_length=RAY,
        )


@pytest.mark.parametrize('start', [3.1, -3.1, 9.0, -15.0, 0.0])
def test_there_is_no_wall_at_half_a_turn(start):
    arm, scene = pan_tilt(), Scene(())
    for way in (-0.4, 0.4, -2.5, 2.5, -3.1, 3.1):
        q_goal = np.array([start + way, 0.2])
        target = along_the_ray(arm, q_goal)
        plan = ask(arm, scene, [start, 0.0], target)
        assert_good(arm, scene, plan, [start, 0.0], target)
        np.testing.assert_allclose(plan.trajectory.positions[-1], q_goal, atol=1e-6)


def test_the_other_way_round_is_taken_where_a_box_is_in_the_way():
    arm = pan_tilt(radius=0.03)
    for start in (0.0, TURN, -2.0 * TURN):
        for side in (-1.0, 1.0):
            scene = Scene((wall(start + side),))
            target = along_the_ray(arm, [start + 2.0 * side, 0.0])
            plan = ask(arm, scene, [start, 0.0], target)
            assert_good(arm, scene, plan, [start, 0.0], target)
            end = plan.trajectory.positions[-1, 0] - start
            assert end == pytest.approx(2.0 * side - TURN * side, abs=1e-3)


def test_a_cable_that_is_nearly_wound_up_is_unwound():
    arm, scene = pan_tilt(), Scene(())
    start = TURN * TURNS - 0.1
    target = along_the_ray(arm, [start + 1.0, 0.0])
    plan = ask(arm, scene, [start, 0.0], target)
    assert_good(arm, scene, plan, [start, 0.0], target)
    assert plan.trajectory.positions[-1, 0] == pytest.approx(start + 1.0 - TURN)
    assert np.abs(plan.trajectory.positions[:, 0]).max() <= TURN * TURNS


@pytest.mark.parametrize('beyond', [1e-3, 0.3, 6.0])
def test_a_start_beyond_the_turns_leads_back_at_once(beyond):
    arm, scene = pan_tilt(), Scene(())
    for side in (-1.0, 1.0):
        start = np.array([side * (TURN * TURNS + beyond), 0.0])
        target = along_the_ray(arm, [0.7, 0.3])
        plan = ask(arm, scene, start, target)
        assert_good(arm, scene, plan, start, target)
        assert 'pan led in from' in plan.sentence
        turned = side * plan.trajectory.positions[:, 0]
        assert (np.diff(turned[turned > TURN * TURNS]) <= 0.0).all()


def test_a_start_that_is_a_turn_beyond_is_one_sentence():
    arm = pan_tilt()
    start = TURN * (TURNS + 1) + 0.1
    plan = ask(arm, Scene(()), [start, 0.0], along_the_ray(arm, [0.0, 0.3]))
    assert plan.status is PlanStatus.START_OUT_OF_BOUNDS
    assert plan.sentence.startswith(f'pan is at {start:.6g} rad, expected -18.8496 to 18.8496 rad')


def shifted_plans(arm, scene, q_start, turns, target, **more):
    """Return the plan from a start, and that from the same pose whole turns further."""
    away = TURN * np.array(turns)
    return ask(arm, scene, q_start, target, **more), ask(
        arm, scene, q_start + away, target, **more
    )


def assert_shifted(one, other, turns):
    assert one.status is other.status, (one.sentence, other.sentence)
    if one.trajectory is None:
        return
    assert one.trajectory.duration == pytest.approx(other.trajectory.duration, abs=1e-6)
    instants = np.linspace(0.0, one.trajectory.duration, 50)
    q, q_other = sample(one.trajectory, instants)[0], sample(other.trajectory, instants)[0]
    np.testing.assert_allclose(q_other - q, np.tile(TURN * turns, (50, 1)), atol=1e-5)


@examples(30)
@given(st.integers(0, 2**32 - 1))
def test_a_motion_is_the_same_from_every_turn(seed):
    rng, arm, scene = np.random.default_rng(seed), gen3(), load_body()
    near = np.where(FREE, HALF, arm.bounds[1])
    q_start = free_starts(arm, scene, rng, 1, -near, near)[0]
    target = rng.uniform([-2.0, -2.0, -1.2], [2.5, 2.0, 1.8])
    turns = np.where(FREE, rng.integers(-1, 2, 7), 0)
    one, other = shifted_plans(arm, scene, q_start, turns, target)
    assert_shifted(one, other, turns)
    if other.trajectory is not None:
        assert_good(arm, scene, other, q_start + TURN * turns, target)


@pytest.mark.parametrize('kind', [RRTStarOptions, InformedRRTStarOptions])
def test_it_is_with_every_algorithm(kind):
    arm, options = pan_tilt(radius=0.03), kind(time_limit=600.0, max_samples=400)
    scene = Scene((wall(1.0),))
    target = along_the_ray(arm, [2.0, 0.0])
    one, other = shifted_plans(arm, scene, np.array([0.3, 0.0]), (1, 0), target, options=options)
    assert_shifted(one, other, np.array([1, 0]))
    assert one.trajectory.positions[-1, 0] == pytest.approx(2.0 - TURN, abs=1e-3)


@pytest.mark.parametrize('turns', [-2, 1])
def test_an_escape_and_a_handover_are_the_same_from_every_turn(turns):
    arm, away = pan_tilt(radius=0.03), np.array([turns, 0])
    # The ray is 1 cm in the margin of a box beside it.
    box = Box('hand', np.array([-0.45, -0.1, 0.2]), np.array([0.2, 0.1, 0.1]), np.eye(3))
    target = along_the_ray(arm, [HALF - 0.9, 0.1])
    q_start = np.array([HALF + 0.02, 0.0])
    one, other = shifted_plans(arm, Scene((box,)), q_start, away, target)
    assert one.status is PlanStatus.SOLVED and one.escape_time > 0.0, one.sentence
    assert_shifted(one, other, away)
    motion = ask(arm, Scene(()), [3.0, 0.0], along_the_ray(arm, [3.9, 0.2])).trajectory
    for time in (0.1, 0.5 * motion.duration):
        q, v, a = (row[0] for row in sample(motion, [time]))
        plans = []
        for shift in (0.0, TURN * turns):
            running = replace(motion, positions=motion.positions + [shift, 0.0])
            now = q + [shift, 0.0]
            moving = StartState(
                state=MotionState(positions=now, velocities=v, accelerations=a),
                running=running,
                time=time,
            )
            plans.append(ask(arm, Scene(()), now, along_the_ray(arm, [2.5, 0.0]), moving=moving))
        assert plans[0].status is PlanStatus.SOLVED, plans[0].sentence
        assert_shifted(*plans, away)


def test_goals_are_of_the_nearest_turn_and_the_nearest_comes_first():
    arm, scene = gen3(), load_body()
    rng = np.random.default_rng(2)
    near = np.where(FREE, HALF, arm.bounds[1])
    for q in free_starts(arm, scene, rng, 5, -near, near) + TURN * FREE:
        world, goal = arm_world(arm, scene, MARGIN, RAY), PointingGoal(rng.uniform(-1.5, 1.5, 3))
        goals = goal_configurations(arm, goal, world, q, FEW_DRAWS)
        if len(goals.q_goals) == 0:
            continue
        distances = np.linalg.norm(goals.q_goals - q, axis=1)
        assert (np.diff(distances) >= 0.0).all()
        away = np.abs(goals.q_goals - q)[:, FREE]
        # Another turn only in one joint.
        assert (np.sort(away, axis=1)[:, :-1] <= HALF + 1e-9).all()
        assert away.max() <= TURN
        for q_goal in goals.q_goals:
            assert pointing_error(arm, q_goal, goal.target) < 1e-6
            assert world.is_valid(q_goal)
        straight = [world.is_edge_valid(q, q_goal) for q_goal in goals.q_goals]
        assert not any(straight[: goals.n_bent])
        problem = pointing_problem(arm, goal, world, q, goals)
        low, high = problem.world.bounds
        assert (high - low)[FREE] == pytest.approx(2.0 * TURN)
        assert ((low <= goals.q_goals) & (goals.q_goals <= high)).all()


def test_none_of_forty_motions_is_longer_than_needed_by_over_a_fifth():
    scene, rng = load_body(), np.random.default_rng(3)
    arm, walled = gen3(), gen3(0.5)
    starts = free_starts(walled, scene, rng, 40, *walled.bounds)
    targets = rng.uniform([-2.0, -2.0, -1.2], [2.5, 2.0, 1.8], (40, 3))
    lengths, walled_lengths, n_solved = [], [], 0
    for q, target in zip(starts, targets, strict=True):
        plan = ask(arm, scene, q, target)
        if plan.path is None:
            continue
        n_solved += 1
        # The best of all: from every start of the same pose in the range of one turn, moved so
        # that the walls are elsewhere.
        least = plan.path.length
        with_walls = ask(walled, scene, q, target)
        for middle in np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1).T[::3]:
            shift = np.zeros(7)
            shift[FREE] = middle * QUARTER
            other = replace(walled, bounds=walled.bounds + shift)
            low, high = other.bounds
            q_in = np.where(FREE, q + TURN * np.ceil((low - q) / TURN), q)
            # Another seed finds the same.
            tried = ask(other, scene, q_in, target, seed=1)
            if tried.path is not None:
                least = min(least, tried.path.length)
        lengths.append(plan.path.length / least)
        walled_lengths.append(
            with_walls.path.length / least if with_walls.path is not None else np.inf
        )
    assert n_solved >= 38
    assert (np.array(lengths) <= 1.2).all(), np.sort(lengths)[-5:]
    assert (np.array(walled_lengths) > 1.2).sum() >= 3, np.sort(walled_lengths)[-8:]
