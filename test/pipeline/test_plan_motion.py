# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""From a body and a target to a motion: what is solved is safe, what is rejected had to be."""

from dataclasses import replace
import re

import numpy as np
import pytest
from rrth_planner.collision import distance_objects
from rrth_planner.collision.penetration import box_depths
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.violation import Violation
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.kinematics.pan_tilt_ik import aim
from rrth_planner.model.arm import forward_kinematics, pointing_error, tool_pose
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionState, sample, StartState
from rrth_planner.pipeline.rejection import goal_rejection
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.pointing_goals import (
    FEW_DRAWS,
    GoalSet,
    MANY_DRAWS,
    target_in_mount,
)
from rrth_planner.timing.lead_in import lead_in
from worlds import (
    dense_touch,
    FOLDED,
    free_configuration,
    limits,
    line,
    MARGIN,
    RAY,
    table_1_arm,
    varied_body,
    wearer,
    wearer_world,
)

pipeline = pytest.importorskip('rrth_planner.pipeline.plan_motion', exc_type=ImportError)
path_planning = pytest.importorskip('rrth_planner.pipeline.plan_path', exc_type=ImportError)
path_timing = pytest.importorskip('rrth_planner.pipeline.time_path', exc_type=ImportError)
OPTIONS = RRTHOptions(club_attempts=2, improve_time=1000.0, time_limit=1000.0, max_samples=4000)


def ask(scene, q_start, target, *, seed=1, options=OPTIONS, margin=MARGIN, **more):
    return pipeline.plan_motion(
        table_1_arm(),
        scene,
        q_start,
        PointingGoal(target),
        limits(),
        options,
        margin=margin,
        ray_guard_length=RAY,
        seed=seed,
        **more,
    )


@pytest.fixture(scope='module')
def answers():
    """Sixty requests round six wearers, and what came of them."""
    rng = np.random.default_rng(91)
    arm, results = table_1_arm(), []
    for i in range(6):
        scene = wearer() if i == 0 else varied_body(rng)
        world = arm_world(arm, scene, MARGIN, RAY)
        for _ in range(10):
            q_start = free_configuration(rng, world)
            # In the space before and round the wearer, some of it inside the wearer.
            target = rng.uniform((-1.0, -1.5, -1.0), (2.0, 1.5, 1.2))
            results.append((scene, q_start, target, ask(scene, q_start, target)))
    return results


def test_most_requests_are_solved(answers):
    solved = [plan.status is PlanStatus.SOLVED for *_, plan in answers]
    assert np.mean(solved) > 0.6


def test_what_is_solved_is_never_in_collision_and_ends_on_target(answers):
    arm, bounds = table_1_arm(), limits()
    for scene, q_start, target, plan in answers:
        if plan.status is not PlanStatus.SOLVED:
            continue
        trajectory = plan.trajectory
        times = np.append(np.arange(0.0, trajectory.duration, 5e-4), trajectory.duration)
        q, v, a = sample(trajectory, times)
        assert first_contact(arm, scene, q, RAY, MARGIN) is None
        reach = np.linalg.norm(target - tool_pose(arm, q[-1])[:3, 3])
        assert first_contact(arm, scene, q[-1:], max(RAY, reach), MARGIN) is None
        assert plan.target_distance == pytest.approx(reach, abs=1e-9)
        assert pointing_error(arm, q[-1], target) < 1e-6
        assert np.array_equal(q[0], q_start)
        assert not trajectory.velocities[[0, -1]].any()
        assert not trajectory.accelerations[[0, -1]].any()
        assert (q >= arm.bounds[0] - 1e-9).all()
        assert (q <= arm.bounds[1] + 1e-9).all()
        assert (np.abs(v) <= bounds.velocity * 1.001).all()
        assert (np.abs(a) <= bounds.acceleration * 1.001).all()
        # Grown by the margin the reference checker found no contact, so the figure cannot be less.
        assert plan.clearance >= MARGIN - 1e-6
        assert 'clearance' in plan.sentence
        assert f'seed {plan.seed}' in plan.sentence


def aiming_postures(arm, scene, target, rng, n):
    """Return random configurations that point at the target, with its distance."""
    world = arm_world(arm, scene, MARGIN, RAY)
    local = target_in_mount(arm, PointingGoal(target))
    for q_near in rng.uniform(*arm.bounds, (n, arm.dof)):
        for branch in range(2):
            q = q_near.copy()
            reach = aim(world.robot, world.bounds, local, q_near, branch, q)
            if reach >= 0.0:
                yield q, reach


def test_what_is_rejected_had_to_be(answers):
    rng = np.random.default_rng(92)
    arm = table_1_arm()
    n_rejected = 0
    for scene, _, target, plan in answers:
        if plan.status is PlanStatus.SOLVED:
            continue
        n_rejected += 1
        assert plan.trajectory is None
        assert plan.path is None
        assert np.isnan(plan.clearance)
        assert plan.status in (
            PlanStatus.GOAL_IN_COLLISION,
            PlanStatus.GOAL_UNREACHABLE,
            PlanStatus.SAMPLE_LIMIT,
        ), plan.sentence
        if plan.status is PlanStatus.GOAL_UNREACHABLE:
            assert not list(aiming_postures(arm, scene, target, rng, 5000))
        if plan.status is PlanStatus.GOAL_IN_COLLISION:
            assert any(f'"{box.name}"' in plan.sentence for box in scene.boxes)
            for q, reach in aiming_postures(arm, scene, target, rng, 5000):
                ray = max(RAY, reach)
                assert dense_touch(arm, scene, MARGIN, ray, line(q, q), 1) >= 0
    assert n_rejected >= 2


def test_a_target_in_the_wearer_is_rejected_by_name():
    for box in wearer().boxes:
        plan = ask(wearer(), FOLDED, box.center)
        assert plan.status is PlanStatus.GOAL_IN_COLLISION
        assert (
            f'inside box "{box.name}", penetration depth {0.5 * box.size.min():.4f} m'
            in plan.sentence
        )
    near = wearer().boxes[0].center + [0.15 + 0.5 * MARGIN, 0.0, 0.0]
    plan = ask(wearer(), FOLDED, near)
    assert plan.status is PlanStatus.GOAL_IN_COLLISION
    assert 'is 0.0100 m from box "torso"' in plan.sentence
    assert 'margin of 0.02 m: penetration depth 0.0100 m' in plan.sentence


def test_a_share_of_configurations_is_at_most_all_of_them():
    # Bars of one link have one name: a box round all of the arm counts once for each.
    box = Box('everywhere', np.zeros(3), np.full(3, 5.0), np.eye(3))
    world = arm_world(table_1_arm(), Scene((box,)), MARGIN, RAY)
    world = replace(world, bar_names=('link 3', 'link 3', 'link 3'))
    q = np.random.default_rng(3).uniform(*table_1_arm().bounds, (40, 4))
    goals = GoalSet(
        q_goals=q[:0], n_bent=0, n_aiming=40, q_blocked=q, blocked_reaches=np.full(40, 2.0)
    )
    rejection = goal_rejection(world, goals)
    (share,) = re.findall(r'\((\d+) %\)', rejection.sentence)
    assert share == '100'
    # The bound of the proof, not a distance that may be greater; of both bars the deeper.
    assert 'box "everywhere" takes all, most often link 3 and' in rejection.sentence
    # Of more than are kept it says how many were looked at.
    some = goal_rejection(world, replace(goals, n_aiming=900))
    assert 'box "everywhere" takes all 40 looked at, most often' in some.sentence
    depths = box_depths(world, q, np.full(40, 2.0)).max(axis=1)
    (deep,) = re.findall(r'penetration depth at least (\d\.\d+) m', rejection.sentence)
    assert float(deep) == pytest.approx(depths.min(), abs=1e-4)


def test_a_part_is_said_to_take_all_postures_whichever_bars_meet_it_only_where_it_does():
    rng, arm = np.random.default_rng(4), table_1_arm()
    q = rng.uniform(*arm.bounds, (400, 4))
    reaches = np.full(400, 1.0)

    def sentence(*boxes):
        world = arm_world(arm, Scene(boxes), MARGIN, RAY)
        met = box_depths(world, q, reaches) > 0.0
        is_met = met.any(axis=(1, 2))
        goals = GoalSet(
            q_goals=q[:0],
            n_bent=0,
            n_aiming=int(is_met.sum()),
            q_blocked=q[is_met],
            blocked_reaches=reaches[is_met],
        )
        return goal_rejection(world, goals).sentence, met[is_met]

    one = Box('hand', [0.3, 0.0, 0.3], [0.8, 0.8, 0.8], np.eye(3))
    said, met = sentence(one)
    # Bars meet it here and there, none of them always.
    assert met.any(axis=2).mean(axis=0).max() < 1.0
    assert 'box "hand" takes all, most often' in said
    said, met = sentence(one, Box('head', [-0.6, 0.0, 0.9], [0.3, 0.3, 0.3], np.eye(3)))
    assert met.any(axis=1).mean(axis=0).max() < 1.0
    assert 'takes all' not in said
    assert 'most often' in said


def test_a_target_that_every_ray_must_cross_the_wearer_for_is_rejected_with_bar_and_box():
    # A target walled in on all sides but not inside a box.
    target = np.array([1.5, -0.1, 0.4])
    walls = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            size = np.full(3, 0.5)
            size[axis] = 0.05
            center = target.copy()
            center[axis] += 0.2 * sign
            walls.append(Box(f'wall_{axis}_{sign:g}', center, size, np.eye(3)))
    scene = Scene((*wearer().boxes, *walls))
    plan = ask(scene, FOLDED, target)
    assert plan.status is PlanStatus.GOAL_IN_COLLISION
    assert 'pointing ray' in plan.sentence
    assert '"wall_' in plan.sentence
    assert 'm including the margin' in plan.sentence


def test_a_start_in_the_wearer_is_rejected_with_bar_and_box():
    rng = np.random.default_rng(93)
    world = wearer_world()
    bare = wearer_world(margin=0.0)
    said = set()
    for _ in range(60):
        q = rng.uniform(*world.bounds)
        if world.is_valid(q):
            continue
        plan = ask(wearer(), q, [1.5, 0.0, 0.3], escape_depth=0.0)
        assert plan.status is PlanStatus.START_IN_COLLISION
        assert 'm including the margin, expected less than 0 m' in plan.sentence
        bar = next(name for name in world.bar_names if plan.sentence.startswith(name))
        box = next(name for name in world.box_names if f'"{name}"' in plan.sentence)
        pair = world.bar_names.index(bar), world.box_names.index(box)
        assert world.clearances(q)[pair] <= 1e-9
        is_inside = bare.clearances(q)[pair] < -1e-6
        if is_inside:
            assert 'inside' in plan.sentence
        said.add(is_inside)
    assert True in said


def test_a_start_beyond_a_limit_is_rejected_with_joint_and_limits():
    arm = table_1_arm()
    for k, name in enumerate(arm.joint_names):
        for side in range(2):
            q = FOLDED.copy()
            q[k] = arm.bounds[side, k] + (0.1 if side else -0.1)
            plan = ask(wearer(), q, [1.5, 0.0, 0.3])
            assert plan.status is PlanStatus.START_OUT_OF_BOUNDS
            assert plan.sentence.startswith(name)
            for value in (q[k], *arm.bounds[:, k]):
                assert f'{value:.6g}' in plan.sentence
            assert 'rad' in plan.sentence
        q = FOLDED.copy()
        q[k] = np.nan
        with pytest.raises(OptionsError, match='q_start: .*nan.*, expected finite numbers'):
            ask(wearer(), q, [1.5, 0.0, 0.3])


def test_an_arm_that_points_already_holds_still():
    rng = np.random.default_rng(94)
    arm, world = table_1_arm(), wearer_world()
    n = 0
    while n < 5:
        q = free_configuration(rng, world)
        T = tool_pose(arm, q)
        target = T[:3, 3] + 0.9 * T[:3, 2]
        if not world.is_valid(q) or world.clearances(q).min() < 0.01:
            continue
        n += 1
        plan = ask(wearer(), q, target)
        assert plan.status is PlanStatus.SOLVED
        assert plan.path.length < 1e-6
        positions, velocities, _ = sample(plan.trajectory, np.linspace(0.0, 1.0, 50))
        assert np.abs(positions - q).max() < 1e-6
        assert np.abs(velocities).max() < 1e-3


def test_the_same_seed_gives_the_same_bits(answers):
    n_compared = 0
    for scene, q_start, target, plan in answers[::6]:
        again = ask(scene, q_start, target)
        assert again.status is plan.status
        if plan.status is PlanStatus.SOLVED:
            n_compared += 1
            for name in ('times', 'positions', 'velocities', 'accelerations'):
                first, second = getattr(plan.trajectory, name), getattr(again.trajectory, name)
                assert first.tobytes() == second.tobytes()
            assert again.clearance == plan.clearance
    assert n_compared > 3


def test_another_second_checker_changes_no_motion(answers, monkeypatch):
    pytest.importorskip('coal')
    asked, library_of = set(), distance_objects.library_of

    def noted(name):
        asked.add(name)
        return library_of(name)

    monkeypatch.setattr(distance_objects, 'library_of', noted)
    for scene, q_start, target, before in answers[:20]:
        after = ask(scene, q_start, target, second_checker='coal')
        assert after.status is before.status
        if before.trajectory is not None:
            np.testing.assert_array_equal(after.trajectory.positions, before.trajectory.positions)
    assert asked == {'coal'}
    with pytest.raises(OptionsError, match="second_checker: 'bullet', expected fcl or coal"):
        ask(wearer(), FOLDED, [1.5, 0.3, 0.4], second_checker='bullet')


def test_a_reserve_costs_no_motion_and_few_draws_of_goals(answers, monkeypatch):
    draws, goal_configurations = [], path_planning.goal_configurations

    def counted(*arguments):
        draws[-1].append(arguments[-1])
        return goal_configurations(*arguments)

    monkeypatch.setattr(path_planning, 'goal_configurations', counted)
    for scene, q_start, target, before in answers:
        draws.append([])
        assert ask(scene, q_start, target, reserve=0.05).status is before.status
    assert max(row.count(FEW_DRAWS) for row in draws) > len(path_planning.SPARE_CLEARANCES)
    assert max(row.count(MANY_DRAWS) for row in draws) == len(path_planning.SPARE_CLEARANCES)


def test_a_request_that_is_cancelled_gives_no_motion(answers):
    solved = [row for row in answers if row[3].status is PlanStatus.SOLVED]
    blocked = [row for row in solved if len(row[3].path.waypoints) > 2]
    assert blocked
    scene, q_start, target, _ = blocked[0]
    plan = ask(scene, q_start, target, should_stop=lambda: True)
    assert plan.status is PlanStatus.CANCELLED
    assert plan.trajectory is None


def test_a_request_cancelled_before_it_began_gives_no_motion():
    # The straight edge to this target is free, so nothing is ever grown.
    plan = ask(wearer(), FOLDED, [-2.0, -0.3, 0.2], should_stop=lambda: True)
    assert plan.status is PlanStatus.CANCELLED
    assert plan.trajectory is None


@pytest.mark.parametrize('excess', [1e-15, 1e-14])
def test_an_arm_that_moves_may_stop_past_a_limit_by_rounding(excess):
    arm, world = table_1_arm(), wearer_world()
    rng, v, still = np.random.default_rng(5), np.array([0.1, 0.02, 0.05, 0.0]), np.zeros(4)
    n_solved = 0
    for _ in range(60):
        q = rng.uniform(*arm.bounds)
        state = MotionState(positions=q, velocities=v, accelerations=still)
        way = lead_in(state, limits()).q_stop[1] - q[1]
        q[1] = arm.bounds[1, 1] - way + excess
        if world.clearances(q).min() < 0.05:
            continue
        state = MotionState(positions=q, velocities=v, accelerations=still)
        assert 0.0 < lead_in(state, limits()).q_stop[1] - arm.bounds[1, 1] < 1e-6
        plan = ask(wearer(), q, [1.5, 0.3, 0.4], moving=StartState(state=state))
        n_solved += plan.status is PlanStatus.SOLVED
    assert n_solved > 2


@pytest.mark.parametrize('opinion', [None, Violation(0.1, 0.01, 'ray', 'torso')])
def test_a_request_is_cancelled_during_the_second_check(monkeypatch, opinion):
    looked = []

    def look(*_, **__):
        looked.append(opinion)
        return opinion

    monkeypatch.setattr(path_timing, 'violation_seen', look)
    target = [1.5, 0.3, 0.4]
    plan = ask(wearer(), FOLDED, target, should_stop=lambda: bool(looked))
    assert looked == [opinion]
    assert plan.status is PlanStatus.CANCELLED
    assert plan.trajectory is None


def test_a_start_a_hair_from_the_margin_is_not_blamed_on_the_goal():
    arm = table_1_arm()
    q = np.array([0.3, -1.2, 0.4, 0.7])
    T = tool_pose(arm, q)
    # A plate beside the ray, 5 micrometres further than the margin.
    center = T[:3, 3] + 0.5 * T[:3, 2] + (0.05 + MARGIN + 5e-6) * T[:3, 0]
    scene = Scene((Box('plate', center, (0.1, 0.2, 0.4), T[:3, :3]),))
    world = arm_world(arm, scene, MARGIN, RAY)
    assert world.is_valid(q)
    # Many configurations point at a target on the other side.
    target = T[:3, 3] - 1.5 * T[:3, 0] + 0.5 * T[:3, 2]
    plan = ask(scene, q, target)
    assert plan.status is not PlanStatus.GOAL_IN_COLLISION, plan.sentence


def test_nothing_in_the_way_is_no_special_case():
    plan = ask(Scene(()), FOLDED, [1.0, 0.5, 0.3])
    assert plan.status is PlanStatus.SOLVED
    assert plan.clearance == np.inf


def test_a_target_beside_the_pan_axis_is_still_reached_from_elsewhere():
    arm = table_1_arm()
    pose = forward_kinematics(arm, FOLDED)[2]
    target = pose[:3, 3] + 0.8 * pose[:3, 2]
    plan = ask(Scene(()), FOLDED, target)
    assert plan.status is PlanStatus.SOLVED
    assert pointing_error(arm, plan.path.waypoints[-1], target) < 1e-6
