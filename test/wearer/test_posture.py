# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a tracker sees is checked where it is made."""

import numpy as np
import pytest
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.posture import Posture


def test_a_posture_has_a_position_for_each_name():
    with pytest.raises(SceneError, match=r'positions: shape \(2, 3\), expected \(1, 3\)'):
        Posture(names=('head',), positions=np.zeros((2, 3)))


def test_a_posture_has_a_rotation_for_each_name_or_none():
    with pytest.raises(SceneError, match=r'rotations: shape \(3, 3\), expected \(1, 3, 3\)'):
        Posture(names=('head',), positions=np.zeros((1, 3)), rotations=np.eye(3))
    assert Posture(names=('head',), positions=np.zeros((1, 3))).rotations is None


def test_no_point_comes_twice():
    with pytest.raises(SceneError, match='point "head": given twice'):
        Posture(names=('head', 'head'), positions=np.zeros((2, 3)))
