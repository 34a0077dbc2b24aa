# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The inspection lets a good motion pass, and names what is wrong with any other."""

import numpy as np
import pytest
from rrth_planner.collision.motion_inspection import inspect_motion, UnsafeMotionError
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory

ARM = load_arm()
START = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])
END = START + [0.4, -0.4, 0.2, 0.0]
LIMITS = MotionLimits(velocity=[1.5] * 4, acceleration=[4.0] * 4, jerk=[40.0] * 4)
TOOL = tool_pose(ARM, END)
TARGET = TOOL[:3, 3] + 2.0 * TOOL[:3, 2]


def motion(**changes):
    """Return a good motion with changes."""
    fields = {
        'times': [0.0, 1.0],
        'positions': [START, END],
        'velocities': np.zeros((2, 4)),
        'accelerations': np.zeros((2, 4)),
    }
    return Trajectory(**(fields | changes))


def box_at(point, size=0.02):
    """Return a scene of one small cube."""
    return Scene((Box('pebble', point, [size] * 3, np.eye(3)),))


def inspect(trajectory, scene=None, **changes):
    """Return what the inspection says of a motion."""
    given = {
        'q_present': START,
        'target': TARGET,
        'margin': 0.02,
        'ray_guard_length': 1.0,
    }
    scene = box_at([0.0, 0.0, -2.0]) if scene is None else scene
    return inspect_motion(ARM, scene, trajectory, LIMITS, **(given | changes))


def test_a_good_motion_passes_with_its_figures():
    found = inspect(motion())
    assert found.length == pytest.approx(0.6, abs=1e-6)
    assert found.duration == 1.0
    assert found.pointing_error < 1e-9
    assert found.clearance > 0.5


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'velocities': [[0.1, 0, 0, 0], [0.0] * 4]}, 'velocity .* at start or end'),
        ({'accelerations': [[0.0] * 4, [0.1, 0, 0, 0]]}, 'acceleration .* at start or end'),
        ({'times': [0.0, 0.45]}, 'velocity reaches|acceleration reaches'),
        ({'positions': [START, START]}, 'misses the target by'),
        ({'positions': [START + 0.01, END]}, 'starts'),
        (
            {
                'times': [0.0, 1.5, 3.0],
                'positions': [START, START + [0.0, 0.36, 0.0, 0.0], END],
                'velocities': np.zeros((3, 4)),
                'accelerations': np.zeros((3, 4)),
            },
            'position limits',
        ),
    ],
)
def test_what_is_wrong_with_a_motion_is_named(changes, words):
    with pytest.raises(UnsafeMotionError, match=words):
        inspect(motion(**changes))


@pytest.mark.parametrize('by', [1e-5, 0.01, 0.05])
def test_a_joint_that_begins_beyond_its_limit_may_move_towards_it_only(by):
    beyond = np.array([0.0, by, *START[2:]])
    inspect(motion(positions=[beyond, END], times=[0.0, 2.0]), q_present=beyond)
    there_and_back = {
        'times': [0.0, 2.0, 4.0, 6.0],
        'positions': [beyond, END, [*END[:1], 0.9 * by, *END[2:]], END],
        'velocities': np.zeros((4, 4)),
        'accelerations': np.zeros((4, 4)),
    }
    with pytest.raises(UnsafeMotionError, match='position limits'):
        inspect(motion(**there_and_back), q_present=beyond)


def test_from_far_beyond_its_limit_no_joint_may_move():
    beyond = np.array([0.0, 0.051, *START[2:]])
    with pytest.raises(UnsafeMotionError, match='position limits'):
        inspect(motion(positions=[beyond, END], times=[0.0, 2.0]), q_present=beyond)


def test_a_contact_on_the_way_is_found_and_named():
    middle = tool_pose(ARM, 0.5 * (START + END))
    with pytest.raises(UnsafeMotionError, match='pebble'):
        inspect(motion(), box_at(middle[:3, 3] + 0.5 * middle[:3, 2]))


def test_the_ray_counts_as_far_as_it_is_guarded_and_at_the_end_as_far_as_the_target():
    middle = tool_pose(ARM, 0.5 * (START + END))
    inspect(motion(), box_at(middle[:3, 3] + 1.1 * middle[:3, 2]))
    with pytest.raises(UnsafeMotionError, match='pebble at 1.000 s'):
        inspect(motion(), box_at(TOOL[:3, 3] + 1.5 * TOOL[:3, 2]))
    inspect(motion(), box_at(TOOL[:3, 3] + 2.1 * TOOL[:3, 2]))


def test_the_margin_is_kept():
    aside = TOOL[:3, 3] + 1.5 * TOOL[:3, 2] + 0.05 * TOOL[:3, 0]
    inspect(motion(), box_at(aside), margin=0.02)
    with pytest.raises(UnsafeMotionError, match='pebble'):
        inspect(motion(), box_at(aside), margin=0.05)


def test_a_target_behind_the_tool_is_not_pointed_at():
    with pytest.raises(UnsafeMotionError, match='misses the target by'):
        inspect(motion(), target=TOOL[:3, 3] - 2.0 * TOOL[:3, 2])
