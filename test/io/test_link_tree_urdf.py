# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The URDF of a person becomes a tree of links, whose poses are those of yourdfpy."""

import io
import sys

from human_urdf import human_urdf, joint_of, LINKS, MOVING
import numpy as np
import pytest
from rrth_planner.model.errors import ModelError, NotInstalledError
from rrth_planner.wearer.link_tree import link_poses

yourdfpy = pytest.importorskip('yourdfpy')

from rrth_planner.io.urdf.tree import link_tree_from_urdf  # noqa: E402


@pytest.mark.parametrize('identity', ['_ab3de', '_my_id', ''])
def test_links_lose_the_id_of_the_person_and_joints_keep_it(identity):
    tree = link_tree_from_urdf(human_urdf(identity), 'robot_description')
    assert tree.names == ('body', *(name for name, *_ in LINKS))
    assert tree.joints == tuple(f'{joint_of(name)}{identity}' for name in MOVING)


def test_links_are_where_yourdfpy_has_them():
    text = human_urdf()
    tree = link_tree_from_urdf(text, 'robot_description')
    reference = yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = rng.uniform(-2.0, 2.0, len(tree.joints))
        reference.update_cfg(dict(zip(tree.joints, q, strict=True)))
        rotations, places = link_poses(tree, q)
        for k, name in enumerate(tree.names):
            T = reference.get_transform(f'{name}_ab3de', 'body_ab3de')
            np.testing.assert_allclose(rotations[k], T[:3, :3], atol=1e-9)
            np.testing.assert_allclose(places[k], T[:3, 3], atol=1e-9)


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        ('<robot', '<body', 'robot_description: .*readable XML'),
        ('type="fixed"', 'type="floating"', 'floating, expected one of revolute'),
        ('0 0 0.5', '0 0 nan', 'robot_description: origin of joint .*: xyz.*finite numbers'),
        ('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', 'axis .*not all 0'),
        ('<parent link="waist_', '<parent link="waste_', 'no parent "waste", expected a link'),
        ('<child link="torso_', '<child link="waist_', 'expected a tree of links'),
        ('</joint>', '<mimic joint="waist_ab3de"/></joint>', 'moves with "waist_ab3de"'),
    ],
)
def test_what_is_no_person_is_rejected_in_one_sentence(old, new, words):
    with pytest.raises(ModelError, match=words):
        link_tree_from_urdf(human_urdf().replace(old, new, 1), 'robot_description')


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, 'yourdfpy', None)
    with pytest.raises(NotInstalledError, match=r'needs yourdfpy.*pip install'):
        link_tree_from_urdf(human_urdf(), 'robot_description')
