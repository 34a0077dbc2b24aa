# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Links are where one joint after another takes them; what is no tree is rejected."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.wearer.link_tree import Link, link_poses, LinkTree


def pose(rng):
    """Return a random pose."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation_matrix(rng.standard_normal(4)), rng.standard_normal(3)
    return T


def random_tree(rng, n):
    """Return a tree of n links in a random order, whose parents are random ones."""
    links = []
    for k in range(n):
        axis = rng.standard_normal(3)
        is_fixed = k == 0 or rng.random() < 0.2
        links.append(
            Link(
                name=f'link {k}',
                parent=f'link {rng.integers(k)}' if k else '',
                joint='' if is_fixed else f'joint {k}',
                origin=np.eye(4) if k == 0 else pose(rng),
                axis=axis / np.linalg.norm(axis),
                is_prismatic=bool(rng.random() < 0.3),
            )
        )
    return LinkTree(tuple(links[k] for k in rng.permutation(n)))


def pose_of(tree, name, q):
    """Return the pose of a link, from the root on, by quaternions of single joints."""
    links = {link.name: link for link in tree.links}
    link = links[name]
    if not link.parent:
        return np.eye(4)
    moved = np.eye(4)
    if link.joint and link.is_prismatic:
        moved[:3, 3] = q[link.joint] * link.axis
    elif link.joint:
        half = 0.5 * q[link.joint]
        moved[:3, :3] = rotation_matrix([*(np.sin(half) * link.axis), np.cos(half)])
    return pose_of(tree, link.parent, q) @ link.origin @ moved


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 12))
def test_links_are_where_one_joint_after_another_takes_them(seed, n):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, n)
    q = rng.uniform(-4.0, 4.0, len(tree.joints))
    rotations, places = link_poses(tree, q)
    for k, name in enumerate(tree.names):
        expected = pose_of(tree, name, dict(zip(tree.joints, q, strict=True)))
        np.testing.assert_allclose(rotations[k], expected[:3, :3], atol=1e-12)
        np.testing.assert_allclose(places[k], expected[:3, 3], atol=1e-11)


@given(seed=st.integers(0, 2**32 - 1))
def test_what_is_beyond_an_unknown_joint_is_unknown_and_nothing_else(seed):
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, 10)
    if not tree.joints:
        return
    q = rng.uniform(-4.0, 4.0, len(tree.joints))
    lost = tree.joints[0]
    q[0] = np.nan
    rotations, places = link_poses(tree, q)
    links = {link.name: link for link in tree.links}
    for k, link in enumerate(tree.links):
        above, is_beyond = link, False
        while above.parent:
            is_beyond |= above.joint == lost
            above = links[above.parent]
        assert np.isnan(rotations[k]).any() == is_beyond
        # The origin of a link that turns is where its joint is.
        if not is_beyond:
            assert np.isfinite(places[k]).all()


def link(name, parent, joint=''):
    """Return a link."""
    return Link(name=name, parent=parent, joint=joint, origin=np.eye(4), axis=np.zeros(3))


@pytest.mark.parametrize(
    ('links', 'words'),
    [
        ((), r'roots: \[\], expected one link without a parent'),
        ((link('a', ''), link('b', '')), r"roots: \['a', 'b'\], expected one"),
        ((link('a', ''), link('a', 'a')), 'link "a": given twice'),
        ((link('a', ''), link('b', 'a', 'j'), link('c', 'a', 'j')), 'joint "j": given twice'),
        ((link('a', ''), link('b', 'x')), 'link "b": no parent "x", expected a link'),
        ((link('a', ''), link('b', 'c'), link('c', 'b')), 'link "b": is its own ancestor'),
    ],
)
def test_what_is_no_tree_is_rejected_in_one_sentence(links, words):
    with pytest.raises(ModelError, match=words):
        LinkTree(links)
