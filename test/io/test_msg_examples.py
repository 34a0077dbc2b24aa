# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Every example message loads, is what it says, and is taken or rejected by the nodes' checks."""

from pathlib import Path
import re

import numpy as np
import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import PointStamped  # noqa: E402
from rrth_planner.collision.motion_inspection import inspect_motion  # noqa: E402
from rrth_planner.collision.reference_checker import first_contact  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.trajectory import MotionLimits  # noqa: E402
from rrth_planner.pipeline.plan_motion import plan_motion  # noqa: E402
from rrth_planner.planning.options import RRTHOptions  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import configuration_from_msg
from rrth_planner.ros.messages.message_file import message_from_file  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

FOLDER = Path(__file__).parents[2] / 'msg_examples'
ARM = load_arm()
LIMITS = MotionLimits(velocity=[1.5] * 4, acceleration=[4.0] * 4, jerk=[40.0] * 4)
TARGETS = ['front', 'left', 'high', 'behind', 'low']
BODIES = ['body', 'body_arm_raised']
PARTS = {
    'torso',
    'head',
    'right upper arm',
    'left upper arm',
    'right forearm',
    'left forearm',
    'right thigh',
    'left thigh',
}
TYPES = {'body': MarkerArray, 'target': PointStamped, 'joint': JointState}


def example(name):
    """Return the message of an example file."""
    return message_from_file(FOLDER / f'{name}.yaml', TYPES[name.split('_')[0]])


def scene(name):
    """Return the scene of an example body."""
    return scene_of(WearerBody().apply(example(name), 0.0, 'torso'))


def folded():
    """Return the configuration of the example joint states."""
    return configuration_from_msg(example('joint_states_folded'), ARM.joint_names)


def test_there_are_no_other_examples_and_the_table_names_each():
    named = re.findall(r'^\| `(\w+)\.yaml`', (FOLDER / 'README.md').read_text(), re.MULTILINE)
    wanted = {*BODIES, 'body_bad', 'joint_states_folded', *(f'target_{name}' for name in TARGETS)}
    assert {path.stem for path in FOLDER.glob('*.yaml')} == wanted
    assert set(named) == wanted


@pytest.mark.parametrize('path', sorted(FOLDER.glob('*.yaml')), ids=lambda path: path.stem)
def test_ros2_topic_pub_reads_the_same_message(path):
    set_message = pytest.importorskip('rosidl_runtime_py.set_message')
    message = TYPES[path.stem.split('_')[0]]()
    set_message.set_message_fields(message, load_yaml(path))
    # repr, for a number that is none differs from itself.
    assert repr(message) == repr(example(path.stem))


@pytest.mark.parametrize('name', BODIES)
def test_a_body_has_the_parts_of_a_body_and_replaces_all_earlier_ones(name):
    before = WearerBody().apply(example('body'), 0.0, 'torso')
    after = before.apply(example(name), 1.0, 'torso')
    assert {box.name for box in scene_of(after).boxes} == PARTS
    assert after.n_boxes == len(PARTS)
    message = example(name)
    assert message.markers[0].action == message.markers[0].DELETEALL
    assert all(marker.color.a > 0.0 for marker in message.markers[1:])


@pytest.mark.parametrize('side', [-1.0, 1.0])
def test_the_limbs_of_a_body_hang_together(side):
    boxes = {box.name: box for box in scene('body_arm_raised').boxes}
    hand = 'right' if side < 0.0 else 'left'
    upper, fore = boxes[f'{hand} upper arm'], boxes[f'{hand} forearm']
    for one, other in ((upper, fore), (boxes['torso'], upper)):
        points = np.random.default_rng(0).uniform(-0.5, 0.5, (4000, 3)) * one.size
        local = (points @ one.rotation.T + one.center - other.center) @ other.rotation
        assert (np.abs(local) <= 0.5 * other.size + 0.01).all(axis=1).any()


def test_the_raised_arm_is_higher_than_the_head():
    boxes = {box.name: box for box in scene('body_arm_raised').boxes}
    fore, head = boxes['right forearm'], boxes['head']
    top = fore.center[2] + 0.5 * np.abs(fore.rotation[2]) @ fore.size
    assert top > head.center[2] + 0.5 * head.size[2]


def test_the_bad_body_is_rejected_by_name():
    with pytest.raises(MessageError, match='head'):
        WearerBody().apply(example('body_bad'), 0.0, 'torso')


def test_the_folded_arm_is_where_the_playback_begins_and_free():
    settings = load_yaml(resource_path('config/playback.yaml'))['/**']['ros__parameters']
    assert settings['initial_positions'] == folded().tolist()
    for name in BODIES:
        assert first_contact(ARM, scene(name), folded()[None], 1.0, 0.02) is None


@pytest.mark.parametrize('body', BODIES)
@pytest.mark.parametrize('target', TARGETS)
def test_every_target_can_be_pointed_at_from_the_folded_state(body, target):
    goal = goal_from_msg(example(f'target_{target}'), 'torso')
    assert isinstance(goal, PointingGoal)
    plan = plan_motion(
        ARM,
        scene(body),
        folded(),
        goal,
        LIMITS,
        RRTHOptions(),
        margin=0.02,
        ray_guard_length=1.0,
        seed=0,
        should_stop=lambda: False,
    )
    assert plan.trajectory is not None, plan.sentence
    found = inspect_motion(
        ARM,
        scene(body),
        plan.trajectory,
        LIMITS,
        q_present=folded(),
        target=goal.target,
        margin=0.02,
        ray_guard_length=1.0,
    )
    assert found.clearance >= 0.02 - 1e-6


@pytest.mark.parametrize(
    'text',
    [
        *(
            'point: {x: far}',
            'point: 3.0',
            'ponit: {x: 1.0}',
            '[1, 2]',
            'point: {x: [1.0]}',
            ': {',
        ),
        *('point: {x: true}', 'point: {x: "1"}', 'point: {x: 2001-01-01}', 'point: &a {x: 1.0}'),
        *('header: {stamp: {sec: 1.5}}', 'header: {stamp: {sec: 2147483648}}', '', 'header: 7'),
        *('header: {stamp: {nanosec: -1}}', 'header: {frame_id: 7}', 'header: {frame_id: [a]}'),
    ],
)
def test_a_file_that_does_not_fit_its_message_is_named(tmp_path, text):
    path = tmp_path / 'odd.yaml'
    path.write_text(text)
    with pytest.raises(Exception, match='odd.yaml') as caught:
        message_from_file(path, PointStamped)
    assert type(caught.value).__module__ == 'rrth_planner.model.errors'
