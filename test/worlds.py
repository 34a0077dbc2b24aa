# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arms, wearers and a fast dense oracle that the tests share; nothing random without an rng."""

from dataclasses import replace
import functools
import itertools
import math

from hypothesis import HealthCheck, settings
from numba import njit
import numpy as np
from rrth_planner.collision.bar_pairs import pairs_of
from rrth_planner.collision.reference_checker import bar_distances, bar_ends_at
from rrth_planner.collision.world import arm_world, robot_rows, World
from rrth_planner.io.arm_file import arm_from_mapping
from rrth_planner.model.arm import (
    ArmModel,
    bar_names,
    bars_of,
    Capsule,
    mount_bars,
    NO_BARS,
    tool_pose,
)
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.pipeline.plan_motion import plan_motion
from rrth_planner.planning.options import RRTHOptions, RRTOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.pointing_goals import target_in_mount
from rrth_planner.planning.problem import PlanningProblem

MARGIN, RAY = 0.02, 1.0
# Random arms of each kind that are compiled.
N_CHAINS = 16
HALF_TURN, QUARTER = np.pi, 0.5 * np.pi

# Table 1 of Zou et al. 2024: alpha, a, offset, d, lower, upper.
ROWS = (
    (-QUARTER, 0.0, -QUARTER, 0.126, -HALF_TURN, HALF_TURN),
    (QUARTER, 0.0, -QUARTER, 0.0, -HALF_TURN, 0.0),
    (QUARTER, 0.0, QUARTER, 0.386, -HALF_TURN, HALF_TURN),
    (QUARTER, 0.0, 0.0, 0.038, -HALF_TURN, HALF_TURN),
)
# Name, centre, full size [m], quaternion (x, y, z, w).
UPRIGHT, FLEXED = (0.0, 0.0, 0.0, 1.0), (0.0, -0.17364817766693033, 0.0, 0.984807753012208)
WEARER = (
    ('torso', (0.0, 0.0, 0.0), (0.3, 0.46, 0.6), UPRIGHT),
    ('head', (0.02, 0.0, 0.45), (0.26, 0.24, 0.3), UPRIGHT),
    ('upper_arm_right', (0.0, -0.31, 0.08), (0.16, 0.16, 0.38), UPRIGHT),
    ('upper_arm_left', (0.0, 0.31, 0.08), (0.16, 0.16, 0.38), UPRIGHT),
    ('forearm_right', (0.17, -0.27, -0.06), (0.4, 0.13, 0.13), FLEXED),
    ('forearm_left', (0.17, 0.27, -0.06), (0.4, 0.13, 0.13), FLEXED),
    ('thigh_right', (0.04, -0.12, -0.58), (0.22, 0.21, 0.56), UPRIGHT),
    ('thigh_left', (0.04, 0.12, -0.58), (0.22, 0.21, 0.56), UPRIGHT),
)
# Behind the back, the tool down.
FOLDED = np.array([0.0, -0.35, QUARTER, QUARTER])


def examples(n):
    """Return the settings of a property test: n cases, the same ones on every run."""
    return settings(
        max_examples=n,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )


def table_1_mapping():
    """Return the arm of the paper as `config/arm.yaml` describes it."""
    return {
        'joints': [
            {
                'name': f'joint_{i + 1}',
                'type': 'revolute',
                'alpha': alpha,
                'a': a,
                'offset': offset,
                'd': d,
                'lower': lower,
                'upper': upper,
                'radius': 0.0,
            }
            for i, (alpha, a, offset, d, lower, upper) in enumerate(ROWS)
        ],
        'tool': {'alpha': -QUARTER, 'a': 0.0, 'offset': 0.0, 'radius': 0.0},
        'mount': {'position': [-0.24, -0.1, 0.36], 'quaternion_xyzw': [0.5, 0.5, 0.5, 0.5]},
    }


# What is worked out of an arm once is known of that object, not of its equals.
@functools.cache
def table_1_arm(radius=0.0):
    """Return the arm of the paper, all its bars of one radius [m]."""
    data = table_1_mapping()
    for row in (*data['joints'], data['tool']):
        row['radius'] = radius
    return arm_from_mapping(data)


@functools.cache
def wearer():
    """Return the standing wearer, forearms forward."""
    return Scene(tuple(Box(n, c, s, rotation_matrix(quat)) for n, c, s, quat in WEARER))


@functools.cache
def limits(dof=4):
    """Return the default limits of every joint."""
    return MotionLimits(
        velocity=np.full(dof, 1.5), acceleration=np.full(dof, 4.0), jerk=np.full(dof, 40.0)
    )


def turn(axis, angle):
    """Return the rotation about x, y or z (0, 1, 2) by an angle [rad], shape (3, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i] = np.sin(angle)
    R[i, j] = -np.sin(angle)
    return R


def random_rotation(rng):
    """Return a uniform random rotation, shape (3, 3)."""
    return rotation_matrix(rng.standard_normal(4))


def varied_body(rng):
    """Return a wearer of another build and posture, who leaves the arm room to move."""
    while True:
        scene = _random_body(rng)
        world = arm_world(table_1_arm(), scene, 2 * MARGIN, RAY)
        if np.mean([world.is_valid(q) for q in rng.uniform(*world.bounds, (100, 4))]) > 0.2:
            return scene


def _random_body(rng):
    """Return a wearer with limbs raised and bent, the head turned."""
    boxes = []

    def add(name, center, size, rotation):
        center = np.asarray(center) + rng.uniform(-0.01, 0.01, 3)
        boxes.append(Box(name, center, np.asarray(size) * rng.uniform(0.9, 1.15, 3), rotation))

    add('torso', (0.0, 0.0, 0.0), (0.3, 0.46, 0.6), turn(2, rng.uniform(-0.1, 0.1)))
    nod = turn(2, rng.uniform(-1.0, 1.0)) @ turn(1, rng.uniform(-0.3, 0.5))
    add('head', (0.02, 0.0, 0.45), (0.26, 0.24, 0.3), nod)
    for side, word in ((-1.0, 'right'), (1.0, 'left')):
        shoulder = np.array([0.0, side * 0.3, 0.24])
        # At rest the limb hangs along -z; raised forward about -y, sideways about x.
        upper = turn(0, side * rng.uniform(0.0, 1.4)) @ turn(1, -rng.uniform(-0.3, 2.6))
        elbow = shoulder - 0.32 * upper[:, 2]
        add(f'upper_arm_{word}', shoulder - 0.16 * upper[:, 2], (0.16, 0.16, 0.38), upper)
        fore = upper @ turn(1, -rng.uniform(0.1, 2.2))
        add(f'forearm_{word}', elbow - 0.17 * fore[:, 2], (0.13, 0.13, 0.4), fore)
        thigh = turn(1, -rng.uniform(0.0, 1.5))
        hip = np.array([0.04, side * 0.12, -0.3])
        add(f'thigh_{word}', hip - 0.28 * thigh[:, 2], (0.22, 0.21, 0.56), thigh)
    return Scene(tuple(boxes))


def random_boxes(rng, n, spread=1.0, largest=0.4):
    """Return n boxes anywhere, at any angle."""
    return Scene(
        tuple(
            Box(
                f'box_{i}',
                rng.uniform(-spread, spread, 3),
                rng.uniform(0.05, largest, 3),
                random_rotation(rng),
            )
            for i in range(n)
        )
    )


def random_chain(rng, has_tail, fewest=3):
    """Return an arm of up to 7 joints, at times one of them prismatic; a pan-tilt tail or none."""
    dof = int(rng.integers(fewest, 8))
    angles = np.array([0.0, QUARTER, -QUARTER, HALF_TURN])
    dh = np.zeros((dof + 1, 4))
    dh[:, 0] = np.where(
        rng.random(dof + 1) < 0.6, rng.choice(angles, dof + 1), rng.uniform(-3.0, 3.0, dof + 1)
    )
    dh[:, 1] = np.where(rng.random(dof + 1) < 0.5, 0.0, rng.uniform(-0.3, 0.3, dof + 1))
    dh[:, 2] = rng.uniform(-3.0, 3.0, dof + 1)
    dh[:-1, 3] = np.where(rng.random(dof) < 0.4, 0.0, rng.uniform(-0.4, 0.4, dof))
    if has_tail:
        dh[-2:, 0] = rng.choice([QUARTER, -QUARTER], 2)
        dh[-2:, 1] = 0.0
    is_prismatic = np.zeros(dof, dtype=bool)
    if rng.random() < 0.6:
        is_prismatic[rng.integers(0, dof - 2 if has_tail else dof)] = True
    lower = np.where(is_prismatic, rng.uniform(-0.3, 0.1, dof), rng.uniform(-3.5, -1.0, dof))
    upper = np.where(is_prismatic, lower + rng.uniform(0.1, 0.5, dof), rng.uniform(1.0, 3.5, dof))
    T = np.eye(4)
    T[:3, :3] = random_rotation(rng)
    T[:3, 3] = rng.uniform(-0.5, 0.5, 3)
    arm = ArmModel(
        joint_names=tuple(f'j{i}' for i in range(dof)),
        is_prismatic=tuple(is_prismatic),
        dh=dh,
        bounds=np.stack([lower, upper]),
        radii=rng.uniform(0.0, 0.05, dof + 1) if rng.random() < 0.5 else np.zeros(dof + 1),
        T_base_mount=T,
    )
    # Its links are wherever they are: most of them run through each other.
    names = sorted(set(bar_names(arm)))
    return replace(arm, allowed=tuple(itertools.combinations(names, 2)))


def capsule_arm(rng, dof=7):
    """Return a slim arm of revolute joints whose links and tool are capsules, on a mount."""
    dh = np.zeros((dof + 1, 4))
    dh[:, 0] = [0.0, *([QUARTER, -QUARTER] * dof)[:dof]]
    dh[:, 1] = np.where(rng.random(dof + 1) < 0.4, rng.uniform(-0.06, 0.06, dof + 1), 0.0)
    dh[:-1, 3] = np.where(np.arange(dof) % 2 == 0, rng.uniform(0.25, 0.4, dof), 0.0)
    capsules = [
        Capsule(name='base', link=0, ends=np.array([[0, 0, 0], [0, 0, 0.05]]), radius=0.05)
    ]
    for i in range(dof):
        back = np.array([0.0, 0.0, -0.9 * dh[i, 3]])
        side = rng.uniform(-0.02, 0.02, 3)
        radius = float(rng.uniform(0.015, 0.03))
        capsules.append(
            Capsule(name=f'part {i + 1}', link=i + 1, ends=np.stack([back, side]), radius=radius)
        )
    ends = np.array([[0.0, 0.0, 0.0], [0.05, 0.0, 0.06]])
    capsules.append(Capsule(name='camera', link=dof + 1, ends=ends, radius=0.025))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = random_rotation(rng), rng.uniform(-0.3, 0.3, 3)
    return ArmModel(
        joint_names=tuple(f'j{i}' for i in range(dof)),
        is_prismatic=(False,) * dof,
        dh=dh,
        bounds=np.outer([-1.0, 1.0], np.where(np.arange(dof) % 2 == 0, 2.9, 2.0)),
        radii=np.array([NO_BARS] * dof + [0.0]),
        T_base_mount=T,
        capsules=tuple(capsules),
    )


@functools.cache
def seeded_capsule_arm(seed):
    """Return the same arm of capsules again and again."""
    return capsule_arm(np.random.default_rng(seed))


def compiled_chain(rng, has_tail):
    """Return one of a few random arms: each must be compiled, which takes a moment."""
    return _few_chains(int(rng.integers(N_CHAINS)), bool(has_tail))


@functools.cache
def _few_chains(seed, has_tail):
    return random_chain(np.random.default_rng(seed), has_tail, fewest=3 if has_tail else 2)


@functools.cache
def wearer_world(margin=MARGIN, ray=RAY, radius=0.0):
    """Return the world of the paper's arm round the standing wearer."""
    return arm_world(table_1_arm(radius), wearer(), margin, ray)


def free_configuration(rng, world: World):
    """Return a random valid configuration."""
    for _ in range(10000):
        q = rng.uniform(*world.bounds)
        if world.is_valid(q):
            return q
    raise AssertionError('a world without a free configuration')


def random_motion(rng):
    """Return a motion planned round the wearer from a random start, or None."""
    plan = plan_motion(
        table_1_arm(),
        wearer(),
        free_configuration(rng, wearer_world()),
        PointingGoal(rng.uniform(-2.0, 2.0, 3)),
        limits(),
        RRTHOptions(),
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=1,
    )
    return plan.trajectory


def aiming_candidates(kernels, arm, target, q_near, n_draws, longest=np.inf):
    """Return all postures of a number of draws that aim, and how long their rays are."""
    ratios = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0])[: arm.dof - kernels.n_solved] % 1.0
    candidates, reaches = np.full((2 * n_draws, arm.dof), np.nan), np.full(2 * n_draws, np.nan)
    n = kernels.goal_candidates(
        robot_rows(arm, RAY),
        arm.bounds,
        target_in_mount(arm, PointingGoal(target)),
        q_near,
        ratios,
        0,
        n_draws,
        longest,
        candidates,
        reaches,
    )
    return candidates[:n], reaches[:n]


def slide_goal(kernels, arm, world, target, path, n, finest):
    """Move waypoint n - 1 of a path along the goal manifold; return by how much it got shorter."""
    return kernels.slide_goal(
        world.edge_check,
        world.resolution,
        world.chain,
        world.robot,
        world.obstacles,
        world.bounds,
        target_in_mount(arm, PointingGoal(target)),
        path,
        n,
        finest,
    )


def is_goal_free(arm, scene, margin, q, target):
    """Return whether the oracle finds q free with its ray out to the target and as guarded."""
    ray = max(RAY, np.linalg.norm(target - tool_pose(arm, q)[:3, 3]))
    return dense_touch(arm, scene, margin, ray, line(q, q), 1) < 0


def blocked_pair(rng, world):
    """Return two random valid configurations whose straight edge is not free."""
    while True:
        pair = np.stack([free_configuration(rng, world), free_configuration(rng, world)])
        if not world.is_edge_valid(*pair):
            return pair


def raw_paths(world, rng, n):
    """Return n first paths round what blocks the straight edge, as growth leaves them."""
    paths = []
    options = RRTOptions(step_size=0.5, near_bias=0.0, time_limit=1000.0, max_samples=2000)
    while len(paths) < n:
        pair = blocked_pair(rng, world)
        problem = PlanningProblem(world=world, q_start=pair[0], q_goals=pair[1:])
        path = plan(problem, options, rng).path
        if path is not None:
            paths.append(path.waypoints)
    return paths


def kernel_bars(arm, world, q, ray):
    """Return the bars as the kernel sees them, in the base frame, (n_bars, 2, 3) [m]."""
    n = len(world.bar_names)
    points = np.full(world.stride, np.nan)
    assert world.chain(q, ray, points, 0) == n
    ends = points[: 8 * n].reshape(n, 2, 4)[:, :, :3]
    return ends @ arm.T_base_mount[:3, :3].T + arm.T_base_mount[:3, 3]


def oracle_bars(arm, q, ray):
    """Return the bars that have a length as the oracle sees them, (n, n_bars, 2, 3) [m]."""
    ends: np.ndarray = bar_ends_at(arm, np.atleast_2d(q), ray)
    return ends[:, : len(bars_of(arm))]


def self_distances(arm, q, ray):
    """
    Return the least distance of any pair that must not touch, by numpy, (n, dof) -> (n,) [m].

    Pairs whose middles are so far apart that they cannot be the nearest are left out.
    """
    ends = bar_ends_at(arm, q, ray)
    radii = np.array([bar.radius for bar in (*bars_of(arm), *mount_bars(arm))])
    pairs = pairs_of(arm)
    inner, outer = [pair.inner for pair in pairs], [pair.outer for pair in pairs]
    middles = ends.mean(axis=2)
    halves = 0.5 * np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    away = np.linalg.norm(middles[:, inner] - middles[:, outer], axis=2)
    away -= radii[inner] + radii[outer]
    least = away - halves[:, inner] - halves[:, outer]
    row, k = np.nonzero(least <= away.min(axis=1, keepdims=True) + 1e-9)
    i, j = np.array(inner)[k], np.array(outer)[k]
    distances = np.full(least.shape, np.inf)
    distances[row, k] = bar_distances(ends[row, i], ends[row, j]) - radii[i] - radii[j]
    return distances.min(axis=1)


def line(q_from, q_to):
    """Return the straight motion as polynomial coefficients, lowest first, (2, dof)."""
    return np.stack([q_from, q_to - q_from])


def bezier_quintic(control):
    """Return the polynomial of a Bezier curve of degree five; control, result (6, dof)."""
    to_powers = np.array(
        [
            [1, 0, 0, 0, 0, 0],
            [-5, 5, 0, 0, 0, 0],
            [10, -20, 10, 0, 0, 0],
            [-10, 30, -30, 10, 0, 0],
            [5, -20, 30, -20, 5, 0],
            [-1, 5, -10, 10, -5, 1],
        ],
        dtype=float,
    )
    return np.ascontiguousarray(to_powers @ control)


@njit(cache=True)
def _first_touch(dh, slides, T0, radii, q, reaches, centers, rotations, halves):
    """
    Look at instants, q (n, dof): products of frames, bars clipped by slabs.

    Instants one after the other are passed at once where the arm at the middle one touches no box
    that is grown by the most that any of its points moves to another of them.
    """
    dof = q.shape[1]
    moved, stack = np.zeros(dof + 1), np.empty((64, 2), np.int64)
    size, stack[0, 0], stack[0, 1] = 1, 0, q.shape[0] - 1
    while size > 0:
        size -= 1
        first, last = stack[size, 0], stack[size, 1]
        middle = (first + last) // 2
        for j in range(dof + 1):
            # By more than rounding.
            moved[j] = 1e-9 if first < last else 0.0
        for i in range(dof):
            most = 0.0
            for k in range(first, last + 1):
                most = max(most, abs(q[k, i] - q[middle, i]))
            for j in range(i, dof + 1):
                moved[j] += most * reaches[i, j]
        if not _touches(dh, slides, T0, radii, q[middle], moved, centers, rotations, halves):
            continue
        if first == last:
            return first
        # The earlier half is the next.
        stack[size, 0], stack[size, 1] = middle + 1, last
        stack[size + 1, 0], stack[size + 1, 1] = first, middle
        size += 2
    return -1


@njit(cache=True)
def _touches(dh, slides, T0, radii, q, moved, centers, rotations, halves):
    """Return whether the arm touches a box; the bars of each row grow by what they may move."""
    dof = q.shape[0]
    R, p = np.empty((3, 3)), np.empty(3)
    turned, corner, end = np.empty((3, 3)), np.empty(3), np.empty(3)
    for r in range(3):
        p[r] = T0[r, 3]
        for c in range(3):
            R[r, c] = T0[r, c]
    for i in range(dof + 1):
        alpha, a, theta, d = dh[i, 0], dh[i, 1], dh[i, 2], dh[i, 3]
        if i < dof:
            if slides[i]:
                d += q[i]
            else:
                theta += q[i]
        ca, sa, ct, st = math.cos(alpha), math.sin(alpha), math.cos(theta), math.sin(theta)
        for r in range(3):
            corner[r] = p[r] + a * R[r, 0]
            y, z = ca * R[r, 1] + sa * R[r, 2], ca * R[r, 2] - sa * R[r, 1]
            turned[r, 0], turned[r, 1] = ct * R[r, 0] + st * y, ct * y - st * R[r, 0]
            turned[r, 2] = z
            end[r] = corner[r] + d * z
        for side in range(2):
            length = a if side == 0 else d
            is_mount = i == 0 and (side == 0 or not slides[0])
            # An offset without length is no bar, whatever its radius.
            is_bar = length != 0.0 or (side == 1 and (i == dof or slides[i]))
            if is_mount or not is_bar:
                continue
            start, stop = (p, corner) if side == 0 else (corner, end)
            for j in range(centers.shape[0]):
                if _is_touched(
                    start, stop, centers[j], rotations[j], halves[j], radii[i] + moved[i]
                ):
                    return True
        for r in range(3):
            p[r] = end[r]
            for c in range(3):
                R[r, c] = turned[r, c]
    return False


@njit(cache=True)
def _is_touched(first, last, center, rotation, half, radius):
    """Clip a bar by the slabs of a box that is grown by its radius."""
    enter, leave = 0.0, 1.0
    for axis in range(3):
        at, step = 0.0, 0.0
        for r in range(3):
            at += (first[r] - center[r]) * rotation[r, axis]
            step += (last[r] - first[r]) * rotation[r, axis]
        reach = half[axis] + radius
        if step == 0.0:
            if abs(at) > reach:
                return False
        else:
            s, t = (-reach - at) / step, (reach - at) / step
            enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
        if enter > leave:
            return False
    return True


def dense_touch(arm, scene, margin, ray, curve, n):
    """Return the first of n instants at which a polynomial motion touches a box, or -1."""
    u, q = np.arange(n)[:, None] / max(n - 1, 1), np.zeros((n, arm.dof))
    for coefficients in curve[::-1]:
        q = q * u + coefficients
    boxes, dh, slides = scene.boxes, np.array(arm.dh), np.array(arm.is_prismatic)
    dh[-1, 3] = ray
    return _first_touch(
        dh,
        slides,
        np.array(arm.T_base_mount),
        np.array(arm.radii),
        np.ascontiguousarray(q),
        _reaches(dh, slides, q),
        np.array([box.center for box in boxes]).reshape(-1, 3),
        np.array([box.rotation for box in boxes]).reshape(-1, 3, 3),
        np.array([0.5 * box.size + margin for box in boxes]).reshape(-1, 3),
    )


def _reaches(dh, slides, q):
    """
    Return how far a unit of a joint moves the bars of a row at most, (dof, dof + 1) [m].

    A joint that turns moves a point by no more than its distance from the axis, and that is no
    more than the offsets after the joint; one that slides, by as much as itself.
    """
    lengths = np.abs(dh[:, [1, 3]]).sum(axis=1)
    lengths[:-1] += np.where(slides, np.abs(q).max(axis=0), 0.0)
    reaches = np.zeros((len(slides), len(dh)))
    for i, is_sliding in enumerate(slides):
        reaches[i, i:] = 1.0 if is_sliding else np.append(0.0, np.cumsum(lengths[i + 1 :]))
    return reaches


def longest_ways(arm, q, ray):
    """
    Return how far a point of the arm may have moved until each instant, (n, dof) -> (n,) [m].

    Between two of them none moves further than the difference.
    """
    dh = np.array(arm.dh)
    dh[-1, 3] = ray
    reaches = _reaches(dh, np.array(arm.is_prismatic), q).max(axis=1)
    return np.append(0.0, np.cumsum(np.abs(np.diff(q, axis=0)) @ reaches))


def edge_touches(arm, scene, margin, ray, q_from, q_to, spacing=5e-4):
    """Return whether an edge looked at every `spacing` [rad] touches a box."""
    n = int(np.linalg.norm(q_to - q_from) / spacing) + 2
    return dense_touch(arm, scene, margin, ray, line(q_from, q_to), n) >= 0
