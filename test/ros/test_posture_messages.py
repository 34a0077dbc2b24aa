# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What trackers publish is a posture, with its stamp and frame, or is rejected in a sentence."""

from human_urdf import human_urdf
from hypothesis import given, strategies as st
import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('yourdfpy')

from builtin_interfaces.msg import Time  # noqa: E402
from geometry_msgs.msg import PoseArray  # noqa: E402
from rrth_planner.io.skeleton_file import load_skeleton  # noqa: E402
from rrth_planner.io.urdf.tree import link_tree_from_urdf  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.model.rotation import rotation_matrix  # noqa: E402
from rrth_planner.ros.messages.posture import (  # noqa: E402
    posture_from_joint_state,
    posture_from_markers,
    posture_from_poses,
)
from rrth_planner.ros.messages.tracked_person import poses_to_msg  # noqa: E402
from rrth_planner.wearer.link_tree import link_poses  # noqa: E402
from rrth_planner.wearer.posture import Posture  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

NAMES = ('a', 'b', 'c')
STAMP = Time(sec=12, nanosec=34)
NANOSECONDS = 12_000_000_034
UNORDERED = load_skeleton('tum_bvh')
TREE = link_tree_from_urdf(human_urdf(), 'robot_description')


def sphere(number, place=(1.0, 2.0, 3.0), frame='camera', stamp=STAMP, **fields):
    """Return a SPHERE marker."""
    marker = Marker(id=number, **{'type': Marker.SPHERE, **fields})
    marker.header.frame_id, marker.header.stamp = frame, stamp
    p = marker.pose.position
    p.x, p.y, p.z = place
    return marker


def markers(*given_markers):
    """Return an array of markers."""
    return MarkerArray(markers=list(given_markers))


def test_markers_are_the_points_of_one_person():
    line = Marker(id=7, type=Marker.LINE_LIST)
    array = markers(line, sphere(302, (1.0, 0.0, 0.0)), sphere(300), sphere(100))
    found = posture_from_markers(array, NAMES, 3)
    assert (found.stamp, found.frame) == (NANOSECONDS, 'camera')
    assert found.posture.names == NAMES
    np.testing.assert_array_equal(found.posture.positions, [[1, 2, 3], [np.nan] * 3, [1, 0, 0]])
    assert found.posture.rotations is None
    only = posture_from_markers(markers(sphere(501)), NAMES)
    np.testing.assert_array_equal(only.posture.positions[1], [1, 2, 3])


def test_of_markers_with_several_stamps_the_oldest_counts():
    array = markers(sphere(0, stamp=Time(sec=13)), sphere(1))
    assert posture_from_markers(array, NAMES).stamp == NANOSECONDS
    # One without a stamp makes the others no younger.
    assert posture_from_markers(markers(sphere(0), sphere(1, stamp=Time())), NAMES).stamp == (
        NANOSECONDS
    )
    unknown = markers(sphere(0, stamp=Time()), sphere(1, stamp=Time()))
    assert posture_from_markers(unknown, NAMES).stamp == 0


@pytest.mark.parametrize(
    ('array', 'person', 'words'),
    [
        (markers(), -1, r'persons \[\], expected those of a person'),
        (markers(sphere(0, type=Marker.CUBE)), -1, r'persons \[\]'),
        (markers(sphere(0, action=Marker.DELETE)), -1, r'persons \[\]'),
        (markers(sphere(0), sphere(100)), -1, r'persons \[0, 1\], .*by the parameter person'),
        (markers(sphere(0)), 2, r'persons \[0\], expected those of person 2'),
        (markers(sphere(3)), -1, 'id 3: joint 3, expected 0 to 2, as .* names_by_id'),
        (markers(sphere(-1)), -1, 'id -1, expected 100 person'),
        (markers(sphere(1), sphere(1)), -1, 'id 1: given twice'),
        (markers(sphere(1), sphere(2, frame='x')), -1, r"frames \['camera', 'x'\], expected one"),
    ],
)
def test_markers_that_are_no_person_are_rejected(array, person, words):
    with pytest.raises(MessageError, match=words):
        posture_from_markers(array, NAMES, person)


@given(seed=st.integers(0, 2**32 - 1), lost=st.sets(st.integers(0, 2)))
def test_poses_come_back_as_they_were_written_lost_ones_too(seed, lost):
    rng = np.random.default_rng(seed)
    positions = rng.standard_normal((3, 3))
    rotations = np.array([rotation_matrix(rng.standard_normal(4)) for _ in NAMES])
    for k in lost:
        positions[k] = np.nan
        rotations[(k + 1) % 3] = np.nan
    given_posture = Posture(names=NAMES, positions=positions, rotations=rotations)
    found = posture_from_poses(poses_to_msg(given_posture, UNORDERED, 'world', STAMP), NAMES)
    assert (found.stamp, found.frame) == (NANOSECONDS, 'world')
    np.testing.assert_array_equal(found.posture.positions, positions)
    np.testing.assert_allclose(found.posture.rotations, rotations, atol=1e-12)


def test_poses_that_are_no_person_are_rejected():
    posture = Posture(names=NAMES, positions=np.zeros((3, 3)), rotations=np.stack([np.eye(3)] * 3))
    array = poses_to_msg(posture, UNORDERED, 'world', STAMP)
    with pytest.raises(MessageError, match='3 poses, expected 2, as the skeleton has names_by_id'):
        posture_from_poses(array, NAMES[:2])
    with pytest.raises(MessageError, match='0 poses, expected 3'):
        posture_from_poses(PoseArray(), NAMES)
    array.poses[1].orientation.w = 0.5
    with pytest.raises(MessageError, match=r'orientation of "b": .* of length 0.5, expected'):
        posture_from_poses(array, NAMES)


def state(values, **fields):
    """Return joint states by name."""
    message = JointState(**{'name': list(values), 'position': list(values.values()), **fields})
    message.header.stamp = STAMP
    return message


def test_joint_states_are_the_links_of_the_person():
    q = np.random.default_rng(1).uniform(-1.0, 1.0, len(TREE.joints))
    values = {'joint_1': 7.0, **dict(zip(TREE.joints, q.tolist(), strict=True))}
    found = posture_from_joint_state(state(dict(reversed(values.items()))), TREE)
    rotations, places = link_poses(TREE, q)
    assert found.stamp == NANOSECONDS
    assert found.posture.names == TREE.names
    np.testing.assert_array_equal(found.posture.rotations, rotations)
    np.testing.assert_array_equal(found.posture.positions, places)


@pytest.mark.parametrize('is_missing', [False, True])
def test_links_beyond_a_joint_that_is_not_known_are_lost(is_missing):
    values = dict.fromkeys(TREE.joints, 0.0)
    if is_missing:
        del values['l_elbow_ab3de']
    else:
        values['l_elbow_ab3de'] = np.nan
    posture = posture_from_joint_state(state(values), TREE).posture
    is_lost = np.isnan(posture.positions).any(axis=1) | np.isnan(posture.rotations).any(
        axis=(1, 2)
    )
    assert {name for name, lost in zip(posture.names, is_lost, strict=True) if lost} == {
        'l_elbow',
        'l_wrist',
    }


@pytest.mark.parametrize(
    ('message', 'words'),
    [
        (state({'joint_1': 0.0}), r"name: \['joint_1'\], expected joints of robot_description: "),
        (state({}), r'name: \[\], expected joints'),
        (state({'waist_ab3de': 0.0}, position=[]), 'position: 0 values for 1 names'),
        (
            state({}, name=['waist_ab3de'] * 2, position=[0.0, 0.0]),
            'name: "waist_ab3de" twice, expected each joint once',
        ),
    ],
)
def test_joint_states_of_nobody_are_rejected(message, words):
    with pytest.raises(MessageError, match=words):
        posture_from_joint_state(message, TREE)
