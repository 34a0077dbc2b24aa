# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The proof that a motion is free: never wrong, seldom undecided, silent about nonsense."""

from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
import json
import os
import subprocess
import sys

import numba
from numba.core.types import boolean, float64
import numpy as np
import pytest
from rrth_planner.collision.box_tree import pack_boxes
from rrth_planner.collision.certificate import derivative_bounds
from rrth_planner.collision.reference_checker import bar_box_contact, bars, first_contact
from rrth_planner.collision.world import arm_world
from rrth_planner.kernels.collision.arm_clearance import free_radius
from rrth_planner.kernels.collision.arm_validity import (
    is_configuration_free,
    is_edge_free,
    MAX_NODES,
    MAX_OPEN,
    prove_curve,
)
from rrth_planner.kernels.jit import CHAIN, first_class, kernel, MAT, VEC
from rrth_planner.kernels.layout import BOX_ALLOWED, BOX_HALF, BOX_OFFSET, BOX_ROWS, D
from rrth_planner.model.errors import RrthError
from rrth_planner.model.scene import Box, Scene
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from worlds import (
    bezier_quintic,
    compiled_chain,
    dense_touch,
    edge_touches,
    FOLDED,
    free_configuration,
    line,
    MARGIN,
    random_boxes,
    random_chain,
    RAY,
    table_1_arm,
    varied_body,
    wearer,
    wearer_world,
)


def decide(world, q_from, q_to):
    """Return 1, 0 or -1: free, collision, undecided."""
    curve = np.ascontiguousarray(line(q_from, q_to))
    return prove_curve(
        curve,
        np.abs(curve[1]),
        np.zeros(len(q_from)),
        world.resolution,
        world.chain,
        world.robot,
        world.obstacles,
    )


def is_free(world, q_from, q_to):
    return is_edge_free(q_from, q_to, world.resolution, world.chain, world.robot, world.obstacles)


@pytest.fixture(scope='module')
def shortened_edges():
    """Edges of shortened paths round the standing wearer: they pass its corners closely."""
    world = wearer_world()
    rng = np.random.default_rng(11)
    options = RRTHOptions(club_attempts=0, improve_time=0.0)
    edges = []
    while len(edges) < 250:
        q_start, q_goal = free_configuration(rng, world), free_configuration(rng, world)
        if world.is_edge_valid(q_start, q_goal):
            continue
        problem = PlanningProblem(world=world, q_start=q_start, q_goals=[q_goal])
        path = plan(problem, options, rng).path
        if path is not None:
            edges += zip(path.waypoints[:-1], path.waypoints[1:], strict=True)
    return edges


def test_configurations_are_checked_as_by_the_reference_checker():
    rng = np.random.default_rng(12)
    for arm in (table_1_arm(), table_1_arm(radius=0.03)):
        for scene in (wearer(), varied_body(rng)):
            world = arm_world(arm, scene, MARGIN, RAY)
            q = rng.uniform(*arm.bounds, (2500, arm.dof))
            got = [
                is_configuration_free(row, RAY, world.chain, world.robot, world.obstacles)
                for row in q
            ]
            ends, touched = bars(arm, q, RAY), np.zeros(len(q), dtype=bool)
            for box in scene.boxes:
                half = 0.5 * box.size + MARGIN + arm.radii[0]
                touched |= bar_box_contact(ends, box.center, box.rotation, half).any(axis=1)
            assert np.array_equal(got, ~touched)
            assert 300 < np.sum(got) < 2450


def test_the_dense_oracle_of_the_tests_is_the_reference_checker():
    rng = np.random.default_rng(13)
    n_touching = n_later = 0
    for i in range(60):
        arm, scene = random_chain(rng, i % 2 == 0), random_boxes(rng, 4, spread=0.6)
        thin = np.full(arm.dof + 1, 0.02)
        object.__setattr__(arm, 'radii', thin)
        q_from, q_to = rng.uniform(*arm.bounds, (2, arm.dof))
        control = q_from + 0.3 * (rng.uniform(*arm.bounds, (6, arm.dof)) - q_from)
        for curve in (line(q_from, q_to), bezier_quintic(control)):
            u = np.linspace(0.0, 1.0, 1000)[:, None]
            q = sum(c * u**power for power, c in enumerate(curve))
            contact = first_contact(arm, scene, q, 0.5, 0.01)
            expected = -1 if contact is None else contact.index
            assert dense_touch(arm, scene, 0.01, 0.5, curve, 1000) == expected
            n_touching += contact is not None
            n_later += contact is not None and contact.index > 0
    assert 20 < n_touching < 116
    assert n_later > 10


def test_no_random_edge_is_certified_that_collides():
    rng = np.random.default_rng(14)
    n_certified = n_touching = 0
    for i in range(20):
        scene = wearer() if i == 0 else varied_body(rng)
        arm = table_1_arm(radius=0.0 if i % 3 else 0.02)
        world = arm_world(arm, scene, MARGIN, RAY)
        for _ in range(80):
            q_from = free_configuration(rng, world)
            step = rng.standard_normal(4)
            step *= rng.choice([0.02, 0.3, 1.0, 3.0]) / np.linalg.norm(step)
            proof = decide(world, q_from, q_from + step)
            touches = edge_touches(arm, scene, MARGIN, RAY, q_from, q_from + step)
            assert not (proof == 1 and touches)
            assert proof != 0 or edge_touches(
                arm, scene, MARGIN + 2e-9, RAY, q_from, q_from + step, 1e-4
            )
            n_certified += proof == 1
            n_touching += touches
    assert n_certified > 500
    assert n_touching > 250


def test_no_edge_of_any_chain_is_certified_that_collides():
    rng = np.random.default_rng(15)
    n_certified = n_rejected = 0
    for i in range(120):
        arm, scene = compiled_chain(rng, i % 2 == 0), random_boxes(rng, 4, spread=0.7)
        world = arm_world(arm, scene, 0.005, 0.6)
        for _ in range(12):
            q_from, q_to = rng.uniform(*arm.bounds, (2, arm.dof))
            q_to = q_from + rng.choice([0.1, 0.5, 1.0]) * (q_to - q_from)
            proof = decide(world, q_from, q_to)
            touches = edge_touches(arm, scene, 0.005, 0.6, q_from, q_to, 1e-3)
            assert not (proof == 1 and touches)
            n_certified += proof == 1
            n_rejected += touches
    assert n_certified > 300
    assert n_rejected > 300


def grazing(world, arm, scene, edge, rng):
    """Return an edge shifted until it touches by dense sampling, then back by a hair."""
    shift = rng.standard_normal(len(edge[0]))
    shift *= 0.3 / np.linalg.norm(shift)

    def touches(share):
        ends = [q + share * shift for q in edge]
        return edge_touches(arm, scene, MARGIN, RAY, *ends)

    low, high = 0.0, 1.0
    if touches(low) or not touches(high):
        return None
    for _ in range(22):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if touches(middle) else (middle, high)
    return low, high, shift


def test_no_shortened_or_grazing_edge_is_certified_that_collides(shortened_edges):
    rng = np.random.default_rng(16)
    arm, scene, world = table_1_arm(), wearer(), wearer_world()
    n_grazing = n_certified = 0
    for edge in shortened_edges:
        assert not edge_touches(arm, scene, MARGIN, RAY, *edge, 2e-4)
        found = grazing(world, arm, scene, edge, rng)
        if found is None:
            continue
        low, high, shift = found
        n_grazing += 1
        for share in (low, high, high + 1e-7, high + 1e-5, low - 1e-7, low - 1e-4):
            ends = [q + share * shift for q in edge]
            if is_free(world, *ends):
                n_certified += 1
                assert not edge_touches(arm, scene, MARGIN, RAY, *ends, 1e-4)
    assert n_grazing > 60
    assert n_certified > 20


def test_truly_free_shortened_edges_are_nearly_all_certified(shortened_edges):
    rng = np.random.default_rng(17)
    arm, scene, world = table_1_arm(), wearer(), wearer_world()
    results = []
    for edge in shortened_edges:
        found = grazing(world, arm, scene, edge, rng)
        if found is None:
            continue
        # About a tenth of a millimetre from the wearer, or less.
        ends = [q + (found[0] - 3e-4) * found[2] for q in edge]
        if not edge_touches(arm, scene, MARGIN, RAY, *ends, 1e-4):
            results.append(is_free(world, *ends))
    assert len(results) > 60
    assert np.mean(results) >= 0.97


def test_planned_edges_are_certified_in_the_other_direction_too(shortened_edges):
    world = wearer_world()
    # But for rounding.
    assert np.mean([is_free(world, b, a) for a, b in shortened_edges]) >= 0.97


@kernel(boolean(VEC, VEC, float64, CHAIN, MAT, MAT))
def is_free_at_instants(q_from, q_to, resolution, chain, robot, boxes):
    """
    Return whether an edge is free at instants of some spacing: no proof.

    Those in the free ball round one that is looked at need no look.
    """
    length = 0.0
    for k in range(q_from.shape[0]):
        length += (q_to[k] - q_from[k]) ** 2
    n = int(np.sqrt(length) / resolution) + 2
    q, stack = np.empty(q_from.shape[0]), np.empty((64, 2), np.int64)
    size, stack[0, 0], stack[0, 1] = 1, 0, n - 1
    while size > 0:
        size -= 1
        first, last = stack[size, 0], stack[size, 1]
        i = (first + last) // 2
        for k in range(q.shape[0]):
            q[k] = q_from[k] + i / (n - 1) * (q_to[k] - q_from[k])
        if not is_configuration_free(q, robot[q.shape[0], D], chain, robot, boxes):
            return False
        # Instants are less than `resolution` apart; by 1e-9 less than the radius, for rounding.
        radius = free_radius(q, chain, robot, boxes) - 1e-9
        n_beside = max(0, int(min(radius / resolution, n)))
        if first < i - n_beside:
            stack[size, 0], stack[size, 1] = first, i - n_beside - 1
            size += 1
        if i + n_beside < last:
            stack[size, 0], stack[size, 1] = i + n_beside + 1, last
            size += 1
    return True


def test_edges_shortened_with_a_sampled_check_are_nearly_all_certified_if_free():
    world, arm, scene = wearer_world(), table_1_arm(), wearer()
    # Between two instants so near to each other an edge dips into a box by 1e-9 m at most.
    check = first_class(is_free_at_instants)
    sampled = replace(world, edge_check=check, resolution=1e-4)
    options = RRTHOptions(club_attempts=0, improve_time=0.0, time_limit=1000.0)
    rng = np.random.default_rng(11)
    results = []
    while len(results) < 300:
        q_start, q_goal = free_configuration(rng, world), free_configuration(rng, world)
        if world.is_edge_valid(q_start, q_goal):
            continue
        problem = PlanningProblem(world=sampled, q_start=q_start, q_goals=[q_goal])
        path = plan(problem, options, rng).path
        if path is None:
            continue
        for a, b in zip(path.waypoints[:-1], path.waypoints[1:], strict=True):
            if not edge_touches(arm, scene, MARGIN + 2e-9, RAY, a, b, 2e-4):
                results.append(is_free(world, a, b))
    assert np.mean(results) >= 0.97


def test_no_quintic_is_proven_that_collides():
    rng = np.random.default_rng(18)
    n_proven = n_touching = 0
    for i in range(500):
        arm = table_1_arm() if i % 2 else compiled_chain(rng, i % 4 == 0)
        scene = random_boxes(rng, 3) if i % 2 == 0 else varied_body(rng)
        world = arm_world(arm, scene, 0.01, 0.7)
        control = rng.uniform(*arm.bounds, (6, arm.dof))
        middle = control.mean(axis=0)
        curve = bezier_quintic(middle + rng.choice([0.05, 0.3, 1.0]) * (control - middle))
        speed, bend = derivative_bounds(curve[None])
        proof = prove_curve(
            curve, speed[0], bend[0], world.resolution, world.chain, world.robot, world.obstacles
        )
        touches = dense_touch(arm, scene, 0.01, 0.7, curve, 8000) >= 0
        assert not (proof == 1 and touches)
        n_proven += proof == 1
        n_touching += touches
    assert n_proven > 80
    assert n_touching > 80


def test_both_directions_of_an_edge_are_never_judged_opposite(shortened_edges):
    rng = np.random.default_rng(19)
    world = wearer_world()
    edges = [rng.uniform(*world.bounds, (2, 4)) for _ in range(1500)]
    n_decided = 0
    for a, b in [*edges, *shortened_edges]:
        forth, back = decide(world, a, b), decide(world, b, a)
        assert {forth, back} != {0, 1}
        n_decided += forth == back != -1
    assert n_decided > 1400


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf, 1e19, 1e200])
def test_an_edge_to_no_configuration_is_never_certified(value):
    world = wearer_world()
    for k in range(4):
        q = FOLDED.copy()
        q[k] = value
        assert not is_free(world, FOLDED, q)
        assert not is_free(world, q, FOLDED)
        assert not is_free(world, q, q)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_a_configuration_that_is_none_is_never_free(value):
    world = wearer_world()
    for k in range(4):
        q = FOLDED.copy()
        q[k] = value
        assert not is_configuration_free(q, RAY, world.chain, world.robot, world.obstacles)
        with pytest.raises(RrthError, match='expected finite numbers'):
            world.is_valid(q)
    assert not is_configuration_free(FOLDED, np.nan, world.chain, world.robot, world.obstacles)


def test_a_curve_with_a_number_that_is_none_is_never_proven():
    world = wearer_world()
    curve, speed, bend = line(FOLDED, FOLDED + 0.1), np.full(4, 0.1), np.zeros(4)
    rest = (world.resolution, world.chain, world.robot, world.obstacles)
    assert prove_curve(curve, speed, bend, *rest) == 1
    for which in range(3):
        for index in range(4):
            parts = [curve.copy(), speed.copy(), bend.copy()]
            parts[which].flat[index] = np.nan
            assert prove_curve(*parts, *rest) != 1, (which, index)


def test_a_box_with_a_number_that_is_none_is_never_passed():
    world = wearer_world()
    # One box that fills the space where the arm is, broken row by row.
    rows = np.zeros((BOX_ROWS, 1))
    rows[:BOX_OFFSET, 0] = np.eye(3).ravel()
    rows[BOX_HALF:BOX_ALLOWED] = 5.0
    for row in range(BOX_ALLOWED):
        for value in (np.nan, np.inf) if row >= BOX_HALF else (np.nan,):
            broken = rows.copy()
            broken[row] = value
            groups, _ = pack_boxes(broken)
            assert not is_free(replace(world, obstacles=groups), FOLDED, FOLDED + 0.1)


def test_no_boxes_leave_everything_free_and_many_are_all_seen():
    rng = np.random.default_rng(20)
    arm = table_1_arm()
    empty = arm_world(arm, Scene(()), MARGIN, RAY)
    many = random_boxes(rng, 300, spread=1.6, largest=0.15)
    crowded = arm_world(arm, many, 0.0, RAY)
    n_certified = n_touching = 0
    for _ in range(200):
        a, b = rng.uniform(*arm.bounds, (2, 4))
        assert is_free(empty, a, b)
        b = a + 0.1 * (b - a)
        touches = edge_touches(arm, many, 0.0, RAY, a, b)
        certified = is_free(crowded, a, b)
        assert not (certified and touches)
        n_certified += certified
        n_touching += touches
    assert n_certified > 20
    assert n_touching > 20


def test_each_single_box_is_seen():
    rng = np.random.default_rng(21)
    arm = table_1_arm()
    decisions = set()
    for box in wearer().boxes:
        alone = Scene((box,))
        world = arm_world(arm, alone, MARGIN, RAY)
        for _ in range(150):
            a, b = rng.uniform(*arm.bounds, (2, 4))
            b = a + 0.4 * (b - a)
            proof = decide(world, a, b)
            decisions.add((box.name, proof))
            assert not (proof == 1 and edge_touches(arm, alone, MARGIN, RAY, a, b, 1e-3))
    assert {(box.name, 1) for box in wearer().boxes} <= decisions
    # The arm cannot reach the thighs, and may or may not find the left forearm.
    for name in ('torso', 'head', 'upper_arm_right', 'upper_arm_left', 'forearm_right'):
        assert (name, 0) in decisions


def test_thousands_of_boxes_far_away_cost_nothing_and_hide_none():
    arm = table_1_arm()
    n = 3000
    far = Box('far', (50.0, 0.0, 0.0), (0.1, 0.1, 0.1), np.eye(3))
    world = arm_world(arm, Scene((far,) * n), MARGIN, RAY)
    assert decide(world, FOLDED, FOLDED + 0.1) == 1
    touched = arm_world(arm, Scene((*(far,) * n, wearer().boxes[0])), MARGIN, RAY)
    rng = np.random.default_rng(22)
    n_touching = 0
    for _ in range(50):
        a, b = rng.uniform(*arm.bounds, (2, 4))
        if edge_touches(arm, Scene((wearer().boxes[0],)), MARGIN, RAY, a, b, 1e-2):
            n_touching += 1
            assert not is_free(touched, a, b)
    assert n_touching > 5


def test_open_pairs_that_outgrow_their_room_are_rejected(shortened_edges):
    crowd = arm_world(table_1_arm(), Scene(wearer().boxes * MAX_OPEN), MARGIN, RAY)
    decisions = [decide(crowd, *edge) for edge in shortened_edges[:60]]
    assert set(decisions) == {1, -1}


def test_an_edge_longer_than_the_proof_has_room_for_is_rejected():
    world = wearer_world()
    q_to = FOLDED + np.array([2.0 * MAX_NODES, 0.0, 0.0, 0.0])
    assert decide(world, FOLDED, q_to) == -1


SAMPLE = """
import json
import numpy as np
from rrth_planner.collision.box_tree import pack_boxes
from rrth_planner.collision.certificate import derivative_bounds
from rrth_planner.kernels.collision.arm_validity import is_configuration_free, prove_curve
from rrth_planner.kernels.collision.bar_box import bar_box_distance
from rrth_planner.kernels.kinematics.trigonometry import sine_cosine
from rrth_planner.planning.pointing_goals import goal_configurations, pointing_problem
from rrth_planner.model.goal import PointingGoal
from rrth_planner.kernels.clock import now
from rrth_planner.kernels.collision.edge_contacts import edge_contacts, GRADIENT
from rrth_planner.kernels.search.random import next_word, normal, random_state, uniform
from rrth_planner.kernels.search.sampling import draw_near
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.problem import PlanningProblem
from worlds import FOLDED, bezier_quintic, blocked_pair, line, table_1_arm, wearer_world

rng = np.random.default_rng(5)
world = wearer_world()
rest = (world.resolution, world.chain, world.robot, world.obstacles)
proofs = []
for _ in range(40):
    q = rng.uniform(*world.bounds, (2, 4))
    curve = np.ascontiguousarray(line(*q))
    proofs.append(int(prove_curve(curve, np.abs(curve[1]), np.zeros(4), *rest)))
    curve = bezier_quintic(rng.uniform(*world.bounds, (6, 4)) * 0.2 + 0.8 * q[0])
    speed, bend = derivative_bounds(curve[None])
    proofs.append(int(prove_curve(curve, speed[0], bend[0], *rest)))
distances = []
for _ in range(40):
    start, step = rng.uniform(-1, 1, (2, 3))
    distances.append(float(bar_box_distance(start, step, rng.uniform(0.1, 0.5, 3))))
q_goal = np.array([2.2, -1.0, 0.3, -0.4])
free = [
    bool(is_configuration_free(q, 1.0, world.chain, world.robot, world.obstacles))
    for q in (FOLDED, q_goal, np.zeros(4))
]
ends = blocked_pair(np.random.default_rng(9), world)
problem = PlanningProblem(world=world, q_start=ends[0], q_goals=ends[1:])
options = RRTHOptions(
    club_attempts=1, corner_moves=3, improve_time=1000.0, time_limit=1000.0
)
result = plan(problem, options, np.random.default_rng(3))
contacts = np.empty((64, GRADIENT + 4))
leans = []
for a, b in zip(result.path.waypoints[:-1], result.path.waypoints[1:]):
    n = edge_contacts(a, b, world.chain, world.robot, world.obstacles, contacts)
    leans += np.delete(contacts[:n], 2, axis=1).tolist()
bits = random_state(np.random.default_rng(4))
words = [int(next_word(bits)) for _ in range(200)]
numbers = [f(bits) for f in (uniform, normal) * 100]
assert draw_near(FOLDED, q_goal, np.inf, world.bounds, bits, q := np.empty(4))
aim = PointingGoal([1.0, 0.5, -1.0])
goals = goal_configurations(table_1_arm(), aim, world, FOLDED, 40)
aimed = plan(
    pointing_problem(table_1_arm(), aim, world, FOLDED, goals), options, np.random.default_rng(5)
)
print(json.dumps([proofs, distances, free, [list(sine_cosine(x)) for x in (0.1, 7.0, -40.0)],
                  result.path.waypoints.tolist(), result.raw_path.waypoints.tolist(), leans, words,
                  numbers, q.tolist(), goals.q_goals.tolist(), aimed.path.waypoints.tolist(),
                  now() < now() + 1.0]))
"""


def interpreted_sample():
    """Return what the sample writes in a process in which nothing is compiled."""
    folder = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    paths = [os.path.dirname(folder), folder, os.environ.get('PYTHONPATH', '')]
    done = subprocess.run(
        [sys.executable, '-c', SAMPLE],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(paths), 'NUMBA_DISABLE_JIT': '1'},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def compiled_sample():
    """Return what the sample writes here."""
    with redirect_stdout(StringIO()) as written:
        exec(SAMPLE, {})
    return json.loads(written.getvalue())


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason='nothing is compiled')
def test_interpreted_kernels_say_what_compiled_ones_say():
    plain, compiled = interpreted_sample(), compiled_sample()
    assert plain[0] == compiled[0]
    assert {0, 1} <= set(plain[0])
    assert np.allclose(plain[1], compiled[1], rtol=0.0, atol=1e-12)
    assert plain[2] == compiled[2]
    assert np.allclose(plain[3], compiled[3], rtol=0.0, atol=1e-15)
    # A path, the raw one it came from, and where it leans.
    assert len(plain[4]) > 2
    assert len(plain[6]) > 0
    for i in (4, 5, 6):
        assert np.allclose(plain[i], compiled[i], rtol=0.0, atol=1e-6)
    # Words, numbers drawn with them, goals and the path to one of them.
    assert plain[7] == compiled[7]
    for i in (8, 9, 10, 11):
        assert np.allclose(plain[i], compiled[i], rtol=0.0, atol=1e-9 if i < 11 else 1e-6)
    assert plain[12]


def first_free_of(world, q, way, spacing, longest, n_halvings):
    """Return what `World.first_free` does, place by place."""
    for far in np.arange(spacing, longest, spacing).tolist():
        if not world.is_in_bounds(q + far * way):
            return np.nan
        if world.is_valid(q + far * way):
            near = far - spacing
            for _ in range(n_halvings):
                middle = 0.5 * (near + far)
                if world.is_valid(q + middle * way):
                    far = middle
                else:
                    near = middle
            return far
    return np.nan


def test_the_first_free_place_of_a_way_is_found_as_place_by_place():
    rng, found = np.random.default_rng(12), []
    shares = np.arange(0.03, 1.2, 0.03)
    for _ in range(60):
        world = arm_world(table_1_arm(0.0), random_boxes(rng, 4), MARGIN, RAY)
        q, way = rng.uniform(*world.bounds), rng.standard_normal(4)
        way /= np.linalg.norm(way)
        far = world.first_free(q, way, shares, 6)
        assert np.array_equal(far, first_free_of(world, q, way, 0.03, 1.2, 6), equal_nan=True)
        found.append(far)
    # There were ways without a free place, some that began there, and some that led out.
    assert np.isnan(found).any() and np.nanmin(found) < 0.001 and np.nanmax(found) > 0.1
    with pytest.raises(RrthError, match='way'):
        world.first_free(q, [1.0, 0.0], shares, 6)
