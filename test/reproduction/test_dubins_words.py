# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Dubins' words: where they lead, how short they are, which boxes their pieces enter."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.reproduction.relatives.dubins_words import (
    enters,
    follow,
    FULL_TURN,
    word_pieces,
    WORDS,
)
from worlds import examples

SEEDS = st.integers(0, 2**32 - 1)


def random_poses(rng, n, size):
    """Return poses of any heading in a square, (n, 3)."""
    return np.column_stack([rng.uniform(-size, size, (n, 2)), rng.uniform(-9.0, 9.0, n)])


def followed(pose, curvatures, lengths):
    """Return the pose at the end of some pieces."""
    for curvature, length in zip(curvatures, lengths, strict=True):
        pose = follow(pose, curvature, length)
    return pose


def turn_between(first, second):
    """Return how far apart two headings are [rad]."""
    return np.abs((second - first + np.pi) % FULL_TURN - np.pi)


@given(SEEDS, st.floats(0.1, 5.0))
@examples(50)
def test_every_word_leads_to_the_pose(seed, radius):
    rng = np.random.default_rng(seed)
    begin, ends = random_poses(rng, 1, 6.0), random_poses(rng, 20, 6.0)
    words = word_pieces(begin, ends, radius)
    # RSR and LSL are always there.
    assert np.isfinite(words[:, :2]).all()
    for end, lengths in zip(ends, words, strict=True):
        for turns, pieces in zip(WORDS, lengths, strict=True):
            if np.isfinite(pieces).all():
                assert (pieces >= 0.0).all()
                assert (pieces[turns != 0.0] < FULL_TURN * radius).all()
                last = followed(begin[0], turns / radius, pieces)
                np.testing.assert_allclose(last[:2], end[:2], atol=1e-6)
                assert turn_between(last[2], end[2]) < 1e-6


@given(SEEDS)
@examples(200)
def test_no_path_of_three_arcs_or_lines_is_shorter(seed):
    rng = np.random.default_rng(seed)
    radius, begin = rng.uniform(0.5, 3.0), random_poses(rng, 1, 5.0)
    for turns in WORDS:
        pieces = rng.uniform(0.0, 1.0, 3) * np.where(turns == 0.0, 10.0, FULL_TURN * radius)
        end = followed(begin[0], turns / radius, pieces)
        shortest = word_pieces(begin, end[None], radius).sum(axis=2).min()
        assert shortest <= pieces.sum() + 1e-6


def test_lengths_that_are_known():
    begin = np.zeros((1, 3))
    ahead, behind, turned = word_pieces(
        begin, np.array([[7.0, 0.0, 0.0], [0.0, 4.0, math.pi], [0.0, 0.0, math.pi]]), 2.0
    )
    assert ahead.sum(axis=1).min() == pytest.approx(7.0)
    # Half a turn to the left.
    assert behind.sum(axis=1).min() == pytest.approx(2.0 * math.pi)
    # On the spot: three arcs whose centres are corners of a triangle, 60, 300 and 60 degrees.
    assert turned.sum(axis=1).min() == pytest.approx(2.0 * 7.0 / 3.0 * math.pi)


@given(SEEDS)
@examples(30)
def test_lengths_are_those_of_ompl(seed):
    base = pytest.importorskip('ompl.base')
    rng = np.random.default_rng(seed)
    radius, begin, ends = (
        rng.uniform(0.5, 3.0),
        random_poses(rng, 1, 5.0),
        random_poses(rng, 20, 5.0),
    )
    space = base.DubinsStateSpace(radius)
    states = []
    for x, y, heading in (begin[0], *ends):
        state = space.allocState()
        state.setXY(x, y)
        state.setYaw(math.remainder(heading, FULL_TURN))
        states.append(state)
    theirs = [space.distance(states[0], state) for state in states[1:]]
    ours = word_pieces(begin, ends, radius).sum(axis=2).min(axis=1)
    np.testing.assert_allclose(ours, theirs, atol=1e-5)


@given(SEEDS)
@examples(60)
def test_a_piece_enters_a_box_just_where_its_points_do(seed):
    rng = np.random.default_rng(seed)
    poses = random_poses(rng, 30, 10.0)
    # Lines along the axes and through corners too.
    poses[:6] = np.round(poses[:6])
    poses[:3, 2] = 0.5 * math.pi * rng.integers(0, 4, 3)
    radii = rng.uniform(0.2, 8.0, 30)
    turns = rng.integers(-1, 2, 30)
    lengths = np.where(turns == 0, 15.0, FULL_TURN * radii) * rng.uniform(0.0, 0.99, 30)
    lower = np.round(rng.uniform(-10.0, 8.0, (4, 2)))
    boxes = np.stack([lower, lower + rng.uniform(0.1, 6.0, (4, 2))], axis=1)
    found = enters(poses, turns / radii, lengths, boxes)
    places = np.linspace(0.0, 1.0, 2001) * lengths[:, None]
    points = follow(poses[:, None], (turns / radii)[:, None], places)[:, :, None, :2]

    def are_inside(grown):
        inside = (points > boxes[:, 0] - grown) & (points < boxes[:, 1] + grown)
        return inside.all(axis=3).any(axis=(1, 2))

    # Between two points a piece may reach a little into a box.
    reach = lengths / 2000
    assert (are_inside(-1e-9) <= found).all()
    for i in np.flatnonzero(found):
        assert are_inside(reach[i])[i]
