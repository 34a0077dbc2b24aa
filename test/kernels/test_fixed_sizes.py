# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Nothing that is given writes beyond what kernels have room for: all fixed sizes are listed."""

import ast
from dataclasses import replace
from itertools import combinations
from pathlib import Path
import re

import numpy as np
import pytest
from rrth_planner.collision.box_tree import tree_depth
from rrth_planner.collision.reference_checker import bar_box_contact
from rrth_planner.collision.world import arm_world, FINEST, robot_rows
from rrth_planner.kernels import layout, scratch
from rrth_planner.kernels.collision import arm_validity, bar_bar, edge_contacts
from rrth_planner.kernels.kinematics import pan_tilt_ik
from rrth_planner.kernels.kinematics.generated_fk import chain_source
from rrth_planner.kernels.layout import BOX_ROWS, LANES
from rrth_planner.kernels.search import elastic_band, tree
from rrth_planner.kernels.trajectory import speed_profile
from rrth_planner.model.arm import ArmModel, bar_ends, bar_names, pointing_error, tool_pose
from rrth_planner.model.errors import ModelError, OptionsError, SceneError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.pointing_goals import (
    CLOSED_FORM,
    numerical,
    pointing_kernels,
    pointing_problem,
)
from worlds import (
    edge_touches,
    free_configuration,
    kernel_bars,
    MARGIN,
    oracle_bars,
    QUARTER,
    random_rotation,
    table_1_arm,
    wearer_world,
)

KERNELS = Path(scratch.__file__).parent
TESTS = Path(__file__).parent

# What keeps what is given within each size that has a name: the tests that show it, at the size
# and beyond it.
JOINTS = ('test_an_arm_as_large_as_there_is_room_for', 'test_a_larger_arm_is_rejected')
BOXES = ('test_as_many_boxes_as_there_is_room_for', 'test_more_boxes_are_rejected')
PROOF = (
    'test_open_pairs_that_outgrow_their_room',
    'test_an_edge_longer_than_the_proof_has_room_for',
    'test_the_queue_and_the_points_of_a_proof_hold_all_of_its_nodes',
)
LEANING = (
    'test_a_path_of_more_corners_than_there_is_room_for',
    'test_an_edge_with_more_contacts_than_there_is_room_for',
)
CLOSED = ('test_an_arm_of_many_joints_aims_numerically',)
NEAREST = ('test_nearest_is_the_least_distance_of_numpy',)
PHASES = ('test_a_stretch_has_no_more_phases_than_there_is_room_for',)
GROUPS = ('test_a_group_holds_as_many_boxes_as_it_has_lanes',)
# Rows that the kernel counts itself.
ROWS = ()
NAMED = {
    'MAX_DOF': JOINTS,
    'BARS_ROOM': JOINTS,
    'ENDS_ROOM': JOINTS,
    'BOWS_ROOM': ('test_sizes_that_follow_from_others_do',),
    'SPEEDS_ROOM': ('test_sizes_that_follow_from_others_do',),
    'SEEN_ROOM': ROWS,
    'MAX_GROUPS': BOXES,
    'MAX_NODES': PROOF,
    'POINTS_ROOM': PROOF,
    'QUEUE_ROOM': PROOF,
    'POOL_ROOM': PROOF,
    'MAX_PAIRS': LEANING,
    'PAIRS_ROOM': LEANING,
    'SQUARE': LEANING,
    'MAX_CONTACTS': LEANING,
    'MAX_CLOSED_DOF': CLOSED,
    'GRADIENTS_ROOM': CLOSED,
    'SQUARE_ROOM': CLOSED,
    'ROOM': NEAREST,
    'MOST_PHASES': PHASES,
    'LANES': GROUPS,
    'LOCAL_ROOM': GROUPS,
    'BOX_ROWS': GROUPS,
    'BOX_ROWS * LANES': GROUPS,
    'WORK_ROWS': ROWS,
    'N_HOW': ROWS,
}
# Sizes that are numbers, by what they count: nothing that is given changes it.
NUMBERS = {
    'arm_validity': {'2': 'ends of an edge', '16': 'two bars of two points of four numbers'},
    'boxes': {'3': 'coordinates', '1': 'the part that is all boxes'},
    'containment': {'3': 'coordinates', '9': 'a rotation'},
    'clock': {'2': 'seconds and nanoseconds'},
    'bar_bar': {'3': 'coordinates'},
    'bar_box': {'3': 'coordinates'},
    'trajectory_check': {'6': 'coefficients of a quintic'},
    'pan_tilt_ik': {'12': 'three axes and an origin', '3': 'coordinates'},
    'fast_stop': {
        '3': 'limits; phases',
        '4': 'derivatives; columns',
        '5': 'columns',
        '6': 'coefficients of a quintic',
    },
    'rrt': {'2': 'ends of a path'},
    'speed_profile': {'2': 'columns', '3': 'derivatives'},
    'stop_trajectory': {'3': 'derivatives', '4': 'derivatives'},
    'stop_search': {'3': 'phases', '5': 'columns'},
    'shortcut': {'2': 'sides of a corner'},
    'rate_profile': {
        '3': 'phases; derivatives',
        '4': 'derivatives',
        '6': 'coefficients of a quintic',
    },
    'separation': {
        '1': 'pieces',
        '2': 'ends of a bar; columns',
        '3': 'coordinates',
        '4': 'derivatives; columns',
        '6': 'coefficients of a quintic',
    },
    'timed_path': {
        '2': 'ways to cut blends',
        '3': 'origin, direction, turn',
        '4': 'columns',
        '5': 'columns',
    },
    'lookahead': {'3': 'derivatives', '4': 'derivatives'},
}
MADE = {
    *(f'scratch.{name}' for name in ('floats', 'ints', 'longs')),
    *(f'np.{name}' for name in ('empty', 'zeros', 'ones', 'full')),
}


def fixed_sizes():
    """Return (module, size) of all arrays in kernels with a size that no argument decides."""
    found = set()
    for file in sorted(KERNELS.rglob('*.py')):
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            if not isinstance(node, ast.Call) or ast.unparse(node.func) not in MADE:
                continue
            shape = node.args[0]
            for size in shape.elts if isinstance(shape, ast.Tuple) else [shape]:
                # Constants have capital letters.
                text = ast.unparse(size)
                if text == text.upper():
                    found.add((file.stem, text))
    return found - {('scratch', 'SIZE')}


def test_every_fixed_size_of_the_kernels_is_listed():
    found = fixed_sizes()
    assert {text for _, text in found if not text.isdigit()} == set(NAMED)
    listed = {(module, size) for module, sizes in NUMBERS.items() for size in sizes}
    assert {(module, text) for module, text in found if text.isdigit()} == listed


def test_every_listed_size_has_its_tests():
    there = re.findall(
        r'^def (test_\w+)',
        '\n'.join(file.read_text(encoding='utf-8') for file in TESTS.glob('*.py')),
        re.MULTILINE,
    )
    for name in {name for names in NAMED.values() for name in names}:
        assert any(test.startswith(name) for test in there), name


def test_sizes_that_follow_from_others_do():
    # Each bar with each other one, and no more frames than links.
    assert layout.MAX_BARS * (layout.MAX_BARS - 1) // 2 <= layout.MAX_PAIRS
    assert layout.MAX_DOF <= layout.MAX_FRAMES
    # Each bar seen from each link, the mount among them.
    assert layout.MAX_BARS * (layout.MAX_DOF + 1) <= bar_bar.SPEEDS_ROOM
    # A group is replaced by those below it, on each level but the last.
    n_waiting = 1 + (LANES - 1) * (tree_depth(layout.MAX_BOXES) - 1)
    assert n_waiting <= arm_validity.MAX_GROUPS
    # Groups and lanes of a tree, and parts of bars, are counted by 32 bits.
    assert LANES ** tree_depth(layout.MAX_BOXES) < 2**31
    assert 2 * arm_validity.SPLIT / FINEST < 2**31
    assert tree.ROOM >= tree.CHUNK + 7


def long_arm(n_joints, n_bars):
    """Return an arm of turning joints; so many bars, the ray among them, each of 2 cm."""
    dh = np.zeros((n_joints + 1, 4))
    dh[::2, 0] = QUARTER
    dh[1:-1, 3] = 0.02
    # Beyond one bar a joint some have an `a` offset too; below it some have none.
    n_more = n_bars - (n_joints - 1) - 1
    dh[1 : 1 + max(0, n_more), 1] = 0.02
    dh[1 : 1 + max(0, -n_more), 3] = 0.0
    arm = ArmModel(
        joint_names=tuple(f'j{i}' for i in range(n_joints)),
        is_prismatic=(False,) * n_joints,
        dh=dh,
        bounds=np.array([[-0.6] * n_joints, [0.6] * n_joints]),
        radii=np.full(n_joints + 1, 0.01),
        T_base_mount=np.eye(4),
    )
    # It coils up.
    names = sorted(set(bar_names(arm)))
    return replace(arm, allowed=tuple(combinations(names, 2)))


def boxes_round(rng):
    """Return boxes that leave the mount of an arm free."""
    centers = rng.standard_normal((12, 3))
    centers *= rng.uniform(0.4, 0.6, (12, 1)) / np.linalg.norm(centers, axis=1)[:, None]
    return Scene(
        tuple(
            Box(f'{i}', c, rng.uniform(0.05, 0.25, 3), random_rotation(rng))
            for i, c in enumerate(centers)
        )
    )


@pytest.mark.parametrize('n_joints', [32, layout.MAX_DOF])
def test_an_arm_as_large_as_there_is_room_for_is_checked_as_by_the_reference_checker(n_joints):
    arm, rng = long_arm(n_joints, layout.MAX_BARS), np.random.default_rng(71)
    assert len(bar_ends(arm)) == layout.MAX_BARS
    scene = boxes_round(rng)
    world = arm_world(arm, scene, MARGIN, 0.5)
    n_free = 0
    for q in rng.uniform(*arm.bounds, (100, n_joints)):
        ends = oracle_bars(arm, q, 0.5)
        assert np.abs(kernel_bars(arm, world, q, 0.5) - ends[0]).max() < 1e-12
        touched = [
            bar_box_contact(ends, b.center, b.rotation, 0.5 * b.size + MARGIN + 0.01).any()
            for b in scene.boxes
        ]
        assert world.is_valid(q) == (not any(touched))
        n_free += not any(touched)
    assert 10 < n_free < 90
    proofs = {1: 0, 0: 0, -1: 0}
    rows = np.empty((50, edge_contacts.GRADIENT + n_joints))
    for _ in range(20):
        q = free_configuration(rng, world)
        step = rng.standard_normal(n_joints)
        q_to = q + 0.2 * step / np.linalg.norm(step)
        curve = np.array([q, q_to - q])
        proof = arm_validity.prove_curve(
            curve,
            np.abs(curve[1]),
            np.zeros(n_joints),
            world.resolution,
            world.chain,
            world.robot,
            world.obstacles,
        )
        assert not (proof == 1 and edge_touches(arm, scene, MARGIN, 0.5, q, q_to))
        proofs[proof] += 1
        edge_contacts.edge_contacts(q, q_to, world.chain, world.robot, world.obstacles, rows)
    assert proofs[1] > 5


def test_an_arm_as_large_as_there_is_room_for_plans():
    arm, rng = long_arm(layout.MAX_DOF, layout.MAX_BARS), np.random.default_rng(72)
    scene = boxes_round(rng)
    world = arm_world(arm, scene, MARGIN, 0.5)
    q_start, q_goal = free_configuration(rng, world), free_configuration(rng, world)
    target = tool_pose(arm, q_goal)[:3, 3] + 0.6 * tool_pose(arm, q_goal)[:3, 2]
    problem = pointing_problem(arm, PointingGoal(target), world, q_start)
    options = RRTHOptions(max_samples=500, time_limit=1000.0, improve_time=0.0)
    path = plan(problem, options, rng).path.waypoints
    assert pointing_error(arm, path[-1], target) < 1e-6
    for a, b in zip(path, path[1:], strict=False):
        assert not edge_touches(arm, scene, MARGIN, 0.5, a, b)


@pytest.mark.parametrize('n_joints', [1, 3, 4, 5, 63, 64])
def test_the_kinematics_of_an_arm_make_room_for_all_of_its_joints(n_joints):
    text = chain_source(robot_rows(long_arm(n_joints, min(n_joints, layout.MAX_BARS)), 1.0))
    rooms = set(map(int, re.findall(r'scratch\.floats\((\d+)\)', text)))
    assert rooms == {-(-n_joints // 4) * 4}
    assert max(map(int, re.findall(r'angles\[(\d+)\]', text))) == max(rooms) - 1


def test_a_larger_arm_is_rejected():
    with pytest.raises(ModelError, match=r'joint_names: 65 joints, expected at most 64$'):
        long_arm(layout.MAX_DOF + 1, layout.MAX_BARS)
    with pytest.raises(ModelError, match=r'dh: 64 bars and capsules, expected at most 63: '):
        long_arm(layout.MAX_DOF, layout.MAX_BARS + 1)
    with pytest.raises(ModelError, match=r'dh: 64 bars and capsules, expected at most 63: '):
        long_arm(33, layout.MAX_BARS + 1)


def many_boxes(n):
    """Return the numbers of boxes of 5 mm on a grid of 2 cm, nearest to the origin first."""
    side = np.arange(-16, 17) * 0.02
    grid = np.stack(np.meshgrid(side, side, side), axis=-1).reshape(-1, 3)
    centers = grid[np.argsort(np.abs(grid).max(axis=1), kind='stable')][:n]
    rows = np.zeros((len(centers), layout.NUMBERS))
    rows[:, :3], rows[:, layout.SIZE : layout.ROTATION] = centers, 0.005
    rows[:, layout.ROTATION :] = np.eye(3).ravel()
    return rows


def test_as_many_boxes_as_there_is_room_for_are_checked_as_by_the_reference_checker():
    rows, arm = many_boxes(layout.MAX_BOXES), table_1_arm()
    scene = Scene(tuple(Box.of_row('box', row) for row in rows))
    world = arm_world(arm, scene, 0.0, 0.2)
    assert len(world.obstacles) == (LANES**5 - 1) // (LANES - 1)
    assert sorted(world.lanes) == list(range(layout.MAX_BOXES))
    rng = np.random.default_rng(73)
    ends = {}
    for q in rng.uniform(*arm.bounds, (60, 4)):
        bars = oracle_bars(arm, q, 0.2)
        touched = False
        for a, b in bars[0]:
            near = (
                np.abs(rows[:, :3] - 0.5 * (a + b)).max(axis=1)
                < 0.5 * np.linalg.norm(b - a) + 0.01
            )
            half = np.full(3, 0.0025)
            touched |= any(
                bar_box_contact(np.array([[[a, b]]]), c, np.eye(3), half).any()
                for c in rows[near, :3]
            )
        assert world.is_valid(q) == (not touched)
        ends[touched] = ends.get(touched, 0) + 1
    assert min(ends.values()) > 5


def test_more_boxes_are_rejected():
    box = Box('box', np.zeros(3), np.ones(3), np.eye(3))
    with pytest.raises(SceneError, match='boxes: 32769, expected at most 32768'):
        Scene((box,) * (layout.MAX_BOXES + 1))


def test_the_queue_and_the_points_of_a_proof_hold_all_of_its_nodes():
    # A row of the queue for each interval that was begun with, two for each node beyond.
    assert arm_validity.QUEUE_ROOM >= 4 * 2 * arm_validity.MAX_NODES
    # Of the longest arm, too, there is room for more nodes than one interval needs.
    assert arm_validity.POINTS_ROOM // (8 * layout.MAX_BARS) > 2
    arm = long_arm(layout.MAX_DOF, layout.MAX_BARS)
    world = arm_world(arm, Scene(()), 0.0, 0.5)
    q, n_nodes = np.zeros(layout.MAX_DOF), arm_validity.POINTS_ROOM // (8 * layout.MAX_BARS)
    for length, is_proven in ((n_nodes - 1.5, True), (n_nodes - 0.5, False), (n_nodes, False)):
        q_to = np.eye(layout.MAX_DOF)[3] * length
        rest = (world.resolution, world.chain, world.robot, world.obstacles)
        assert arm_validity.is_edge_free(q, q_to, *rest) == is_proven


@pytest.mark.parametrize('resolution', [0.0, -1.0, 0.99 * FINEST, np.inf, np.nan])
def test_a_proof_that_would_cut_bars_into_too_many_parts_is_rejected(resolution):
    world = wearer_world()
    replace(world, resolution=FINEST)
    with pytest.raises(OptionsError, match=r'resolution: .*, expected a number from 1e-09'):
        replace(world, resolution=resolution)


def test_an_edge_with_more_contacts_than_there_is_room_for_finds_as_many_as_there_is():
    arm, rng = table_1_arm(), np.random.default_rng(74)
    # More boxes in a row, each within reach of the ray as it passes, than pairs are looked at.
    rows = many_boxes(3000)
    rows[:, 2] += 0.55
    world = arm_world(arm, Scene(tuple(Box.of_row('box', row) for row in rows)), 0.0, 1.0)
    n_most = 0
    for _ in range(40):
        q_from, q_to = rng.uniform(*arm.bounds, (2, 4))
        for capacity in (0, 1, 7, elastic_band.MAX_CONTACTS):
            rows = np.full((capacity + 2, edge_contacts.GRADIENT + 4), 7.0)
            n = edge_contacts.edge_contacts(
                q_from, q_to, world.chain, world.robot, world.obstacles, rows[:capacity]
            )
            assert n <= capacity
            assert (rows[capacity:] == 7.0).all()
        n_most = max(n_most, n)
    assert n_most > edge_contacts.MAX_PAIRS


@pytest.mark.parametrize('n_joints', [pan_tilt_ik.MAX_CLOSED_DOF, pan_tilt_ik.MAX_CLOSED_DOF + 1])
def test_an_arm_of_many_joints_aims_numerically_if_it_has_too_many(n_joints):
    dh = np.zeros((n_joints + 1, 4))
    dh[:-3, 3] = 0.1
    dh[:-1:2, 0], dh[1:-1:2, 0], dh[-1, 0] = QUARTER, -QUARTER, QUARTER
    arm = ArmModel(
        joint_names=tuple(f'j{i}' for i in range(n_joints)),
        is_prismatic=(False,) * n_joints,
        dh=dh,
        bounds=np.array([[-2.0] * n_joints, [2.0] * n_joints]),
        radii=np.zeros(n_joints + 1),
        T_base_mount=np.eye(4),
    )
    is_closed = n_joints <= pan_tilt_ik.MAX_CLOSED_DOF
    assert (pointing_kernels(arm) is CLOSED_FORM) == is_closed
    assert (pointing_kernels(arm) is numerical()) != is_closed
    scene = Scene((Box('box', [0.4, 0.0, 0.3], [0.2, 0.2, 0.2], np.eye(3)),))
    world, rng = arm_world(arm, scene, MARGIN, 0.5), np.random.default_rng(75)
    options = RRTHOptions(time_limit=1000.0, improve_time=0.0)
    for _ in range(4):
        q_start, target = free_configuration(rng, world), rng.uniform(-1.0, 1.0, 3)
        problem = pointing_problem(arm, PointingGoal(target), world, q_start)
        path = plan(problem, options, rng).path.waypoints
        assert pointing_error(arm, path[-1], target) < 1e-6


def test_a_stretch_has_no_more_phases_than_there_is_room_for():
    rng = np.random.default_rng(76)
    found = set()
    for _ in range(2000):
        v_from, v_to, top = np.sort(rng.uniform(0.0, 1.0, 3))
        cell = np.array([10.0 ** rng.uniform(-3, 1), top, *10.0 ** rng.uniform(-1, 2, 2)])
        phases = np.full((speed_profile.MOST_PHASES + 1, 2), 7.0)
        n = speed_profile.cell_phases(v_from, v_to, cell, phases[: speed_profile.MOST_PHASES])
        assert (phases[-1] == 7.0).all()
        found.add(n)
    assert max(found) == speed_profile.MOST_PHASES


def test_a_group_holds_as_many_boxes_as_it_has_lanes():
    for n, n_groups in ((0, 1), (1, 1), (LANES, 1), (LANES + 1, 1 + LANES)):
        boxes = tuple(Box.of_row('box', row) for row in many_boxes(n))
        world = arm_world(table_1_arm(), Scene(boxes), 0.0, 1.0)
        assert world.obstacles.shape == (n_groups, BOX_ROWS * LANES)
