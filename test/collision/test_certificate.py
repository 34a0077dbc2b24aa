# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The proof of a timed curve: its bounds hold, and a violation is never proven."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.certificate import (
    certify,
    CLEARANCE_PERIOD,
    derivative_bounds,
    least_clearance,
)
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.collision.world import arm_world
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import piece_coefficients, sample, Trajectory
from rrth_planner.timing.parameterization import parameterize
from worlds import (
    bezier_quintic,
    compiled_chain,
    dense_touch,
    examples,
    FOLDED,
    free_configuration,
    limits,
    MARGIN,
    random_boxes,
    RAY,
    table_1_arm,
    varied_body,
    wearer,
    wearer_world,
)

SEEDS = st.integers(0, 2**32 - 1)


def random_motion(rng, bounds, n, reach):
    """Return a trajectory through random states: quintics that swing wide of their points."""
    dof = bounds.shape[1]
    middle = rng.uniform(*bounds)
    positions = middle + reach * (rng.uniform(*bounds, (n, dof)) - middle)
    return Trajectory(
        times=np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 1.0, n - 1))]),
        positions=positions,
        velocities=rng.uniform(-reach, reach, (n, dof)),
        accelerations=rng.uniform(-2 * reach, 2 * reach, (n, dof)),
    )


@examples(200)
@given(seed=SEEDS)
def test_derivative_bounds_bound_the_derivatives(seed):
    rng = np.random.default_rng(seed)
    if seed % 2:
        c = rng.uniform(-1, 1, (4, 6, 3)) * 10.0 ** rng.uniform(-6, 2, (4, 6, 3))
    else:
        c = np.stack([bezier_quintic(rng.uniform(-3, 3, (6, 3))) for _ in range(4)])
    speed, bend = derivative_bounds(c)
    u = np.linspace(0.0, 1.0, 500)[:, None]
    for i in range(4):
        first = sum(k * c[i, k] * u ** (k - 1) for k in range(1, 6))
        second = sum(k * (k - 1) * c[i, k] * u ** (k - 2) for k in range(2, 6))
        assert (np.abs(first) <= speed[i]).all()
        assert (np.abs(second) <= bend[i]).all()


def test_derivative_bounds_of_a_line_are_its_speed():
    c = np.zeros((1, 6, 2))
    c[0, 1] = [2.0, -3.0]
    speed, bend = derivative_bounds(c)
    assert speed[0] == pytest.approx([2.0, 3.0])
    assert bend[0] == pytest.approx([0.0, 0.0], abs=1e-14)


def check_certificate(arm, scene, trajectory):
    """Check a certificate against the reference checker; return it."""
    world = arm_world(arm, scene, MARGIN, RAY)
    certificate = certify(trajectory, world)
    pieces = piece_coefficients(trajectory)
    touched = [dense_touch(arm, scene, MARGIN, RAY, c, 4000) >= 0 for c in pieces]
    if certificate.is_proven:
        assert certificate.piece == -1
        assert not certificate.is_violated
        assert not any(touched)
    else:
        assert 0 <= certificate.piece < len(pieces)
        # Those before it are proven.
        assert not any(touched[: certificate.piece])
        if certificate.is_violated:
            curve = pieces[certificate.piece]
            assert dense_touch(arm, scene, MARGIN + 1e-6, RAY, curve, 40000) >= 0
    return certificate


def test_no_trajectory_that_collides_is_certified():
    rng = np.random.default_rng(81)
    n_proven = n_touching = n_later = 0
    for i in range(250):
        scene = wearer() if i % 2 else varied_body_of(i)
        arm = table_1_arm(radius=0.0 if i % 3 else 0.02)
        trajectory = random_motion(rng, arm.bounds, 4, rng.choice([0.05, 0.2, 0.6]))
        certificate = check_certificate(arm, scene, trajectory)
        n_proven += certificate.is_proven
        n_touching += certificate.is_violated
        n_later += certificate.piece > 0
    assert n_proven > 30
    assert n_touching > 60
    assert n_later > 15


BODIES = {}


def varied_body_of(i):
    """Return one of five bodies."""
    if i % 5 not in BODIES:
        BODIES[i % 5] = varied_body(np.random.default_rng(i % 5))
    return BODIES[i % 5]


def test_no_trajectory_of_any_chain_that_collides_is_certified():
    rng = np.random.default_rng(82)
    said = []
    for i in range(80):
        arm = compiled_chain(rng, i % 2 == 0)
        # Points between rests keep each joint, so also a prismatic one, within its bounds.
        q = rng.uniform(*arm.bounds)
        q = q + rng.choice([0.2, 1.0]) * (rng.uniform(*arm.bounds, (3, arm.dof)) - q)
        trajectory = Trajectory(
            times=[0.0, 1.0, 2.0],
            positions=q,
            velocities=np.zeros_like(q),
            accelerations=np.zeros_like(q),
        )
        said.append(check_certificate(arm, random_boxes(rng, 3), trajectory).is_proven)
    assert 10 < sum(said) < 75


def test_the_reference_checker_finds_no_contact_in_certified_motions():
    rng = np.random.default_rng(83)
    arm, scene, world = table_1_arm(), wearer(), wearer_world()
    n_proven = 0
    while n_proven < 8:
        q = np.stack([free_configuration(rng, world) for _ in range(2)])
        trajectory = parameterize(Path(q), (), limits())
        if not certify(trajectory, world).is_proven:
            continue
        n_proven += 1
        dense, _, _ = sample(trajectory, np.arange(0.0, trajectory.duration, 5e-4))
        assert first_contact(arm, scene, dense, RAY, MARGIN) is None


def test_the_piece_that_is_not_proven_is_named():
    arm, world = table_1_arm(), wearer_world()
    rng = np.random.default_rng(84)
    blocked = rng.uniform(*arm.bounds)
    while world.is_valid(blocked):
        blocked = rng.uniform(*arm.bounds)
    for piece in range(4):
        positions = np.tile(FOLDED, (6, 1))
        positions[piece + 1] = blocked
        trajectory = Trajectory(
            times=np.arange(6.0),
            positions=positions,
            velocities=np.zeros((6, 4)),
            accelerations=np.zeros((6, 4)),
        )
        certificate = certify(trajectory, world)
        assert (certificate.is_proven, certificate.piece) == (False, piece)
        assert certificate.is_violated


def test_standing_still_in_the_wearer_is_not_certified():
    arm, world = table_1_arm(), wearer_world()
    rng = np.random.default_rng(85)
    q = rng.uniform(*arm.bounds)
    while world.is_valid(q):
        q = rng.uniform(*arm.bounds)
    for times in ([0.0, 1.0], [0.0]):
        still = np.zeros((len(times), 4))
        trajectory = Trajectory(
            times=times,
            positions=np.tile(q, (len(times), 1)),
            velocities=still,
            accelerations=still,
        )
        assert not certify(trajectory, world).is_proven, times


def test_least_clearance_is_the_least_over_the_motion():
    arm, world = table_1_arm(), wearer_world(margin=0.0)
    rng = np.random.default_rng(86)
    for _ in range(5):
        q = np.stack([free_configuration(rng, world) for _ in range(2)])
        trajectory = parameterize(Path(q), (), limits())
        dense, _, _ = sample(trajectory, np.arange(0.0, trajectory.duration, 1e-3))
        expected = min(world.clearances(row).min() for row in dense)
        got = least_clearance(trajectory, world)
        assert got >= expected - 1e-6
        assert got <= expected + 0.02
    empty = arm_world(arm, Scene(()), 0.0, RAY)
    assert least_clearance(trajectory, empty) == np.inf


@examples(50)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.99))
def test_least_clearance_is_that_of_its_instants(seed, share):
    rng = np.random.default_rng(seed)
    world = wearer_world(margin=0.0)
    low, high = world.bounds
    q = rng.uniform(low, high, (2, len(low)))
    trajectory = parameterize(Path(q), (), limits())
    begin = share * trajectory.duration
    n = int(np.ceil((trajectory.duration - begin) / CLEARANCE_PERIOD)) + 1
    states = sample(trajectory, np.linspace(begin, trajectory.duration, n))[0]
    expected = world.clearances(states).min()
    assert least_clearance(trajectory, world, begin) == pytest.approx(expected, abs=1e-9)
