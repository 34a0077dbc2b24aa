# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Rounded corners: smooth, within limits, and on free ground."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.world import arm_world
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Scene
from rrth_planner.timing.corner_blends import Blend, EDGE_SHARE, round_corners
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


def random_blend(rng, dof=4):
    u_in, u_out = rng.standard_normal((2, dof))
    u_in /= np.linalg.norm(u_in)
    u_out /= np.linalg.norm(u_out)
    if rng.random() < 0.2:
        u_out = -u_in
    elif rng.random() < 0.2:
        u_out = u_in
    half_length = float(10.0 ** rng.uniform(-3, 0))
    corner = rng.uniform(-2, 2, dof)
    return Blend(corner=corner, u_in=u_in, u_out=u_out, half_length=half_length)


def top_speed(blend, limits):
    """Return the greatest constant speed that holds all limits within a blend [rad/s]."""
    turn = np.abs(blend.u_out - blend.u_in) + 1e-300
    width = 2 * blend.half_length
    along = np.maximum(np.abs(blend.u_in), np.abs(blend.u_out)) + 1e-300
    # q'' peaks at 3/2 and q''' at 6 times the turn, over width and width^2.
    return min(
        (limits.velocity / along).min(),
        np.sqrt((limits.acceleration * width / (1.5 * turn)).min()),
        np.cbrt((limits.jerk * width**2 / (6.0 * turn)).min()),
    )


def states(blend, tau):
    """Return position and the first three derivatives by tau, each (n, dof)."""
    c, result = blend.coefficients(), []
    for order in range(4):
        value = np.zeros((len(tau), c.shape[1]))
        for power in range(order, len(c)):
            factor = np.prod(np.arange(power - order + 1, power + 1))
            value += factor * c[power] * tau[:, None] ** (power - order)
        result.append(value)
    return result


@examples(200)
@given(seed=SEEDS)
def test_a_blend_meets_both_edges_with_two_derivatives(seed):
    blend = random_blend(np.random.default_rng(seed))
    d = blend.half_length
    q, first, second, _ = states(blend, np.array([0.0, 1.0]))
    assert np.abs(q[0] - (blend.corner - d * blend.u_in)).max() < 1e-12
    assert np.abs(q[1] - (blend.corner + d * blend.u_out)).max() < 1e-12
    assert np.abs(first[0] - 2 * d * blend.u_in).max() < 1e-12
    assert np.abs(first[1] - 2 * d * blend.u_out).max() < 1e-12
    assert np.abs(second).max() < 1e-12


@examples(200)
@given(seed=SEEDS)
def test_its_derivative_bounds_hold_and_its_curve_stays_at_the_corner(seed):
    blend = random_blend(np.random.default_rng(seed))
    q, first, second, _ = states(blend, np.linspace(0.0, 1.0, 400))
    speed, bend = blend.derivative_bounds()
    assert (np.abs(first) <= speed + 1e-12).all()
    assert (np.abs(second) <= bend + 1e-12).all()
    assert (np.abs(second).max(axis=0) >= 0.99 * bend - 1e-12).all()
    away = np.linalg.norm(q - blend.corner, axis=1)
    assert (away <= blend.half_length * (1 + 1e-12)).all()


@examples(200)
@given(seed=SEEDS)
def test_its_top_speed_holds_the_limits_and_reaches_one(seed):
    blend, bounds = random_blend(np.random.default_rng(seed)), limits()
    rate = top_speed(blend, bounds) / (2 * blend.half_length)
    _, first, second, third = states(blend, np.linspace(0.0, 1.0, 401))
    ratios = [
        (np.abs(value) * rate**order / allowed).max()
        for order, value, allowed in (
            (1, first, bounds.velocity),
            (2, second, bounds.acceleration),
            (3, third, bounds.jerk),
        )
    ]
    assert max(ratios) <= 1 + 1e-9
    assert max(ratios) >= 0.999


def corners(seed, n):
    """Return paths of three free points whose two edges are proven free."""
    world, rng = wearer_world(), np.random.default_rng(seed)
    paths = []
    while len(paths) < n:
        q = np.stack([free_configuration(rng, world) for _ in range(3)])
        if world.is_edge_valid(q[0], q[1]) and world.is_edge_valid(q[1], q[2]):
            paths.append(Path(q))
    return paths


def test_rounded_corners_are_free_and_fit_their_edges():
    world, arm, scene = wearer_world(), table_1_arm(), wearer()
    n_rounded = 0
    for path in corners(71, 60):
        (blend,) = round_corners(path, world, limits())
        lengths = np.linalg.norm(np.diff(path.waypoints, axis=0), axis=1)
        assert 0.0 <= blend.half_length <= EDGE_SHARE * lengths.min() + 1e-12
        assert np.array_equal(blend.corner, path.waypoints[1])
        if blend.half_length > 0.0:
            n_rounded += 1
            assert dense_touch(arm, scene, MARGIN, RAY, blend.coefficients(), 4000) < 0
    assert n_rounded > 30


def test_with_nothing_in_the_way_every_corner_is_rounded_as_far_as_full_speed_needs():
    empty = arm_world(table_1_arm(), Scene(()), MARGIN, RAY)
    bounds = limits()
    for path in corners(72, 20):
        (blend,) = round_corners(path, empty, bounds)
        assert blend.half_length > 0.0
        lengths = np.linalg.norm(np.diff(path.waypoints, axis=0), axis=1)
        top = min(
            (bounds.velocity / np.abs(u).clip(1e-9)).min() for u in (blend.u_in, blend.u_out)
        )
        is_whole = blend.half_length == pytest.approx(EDGE_SHARE * lengths.min())
        assert is_whole or top_speed(blend, bounds) == pytest.approx(top, rel=1e-6)


def test_a_path_that_goes_nowhere_has_no_corner():
    q = np.zeros((2, 4))
    with np.errstate(all='raise'):
        assert round_corners(Path(q), wearer_world(), limits()) == ()


def test_a_path_of_two_points_has_no_corner():
    assert round_corners(Path(np.eye(2, 4)), wearer_world(), limits()) == ()


def test_points_in_line_are_passed_without_a_stop():
    empty = arm_world(table_1_arm(), Scene(()), MARGIN, RAY)
    q = np.linspace(0.0, 1.0, 3)[:, None] * np.array([1.0, -1.0, 0.5, 0.2])
    (blend,) = round_corners(Path(q), empty, limits())
    assert top_speed(blend, limits()) > 0.1
