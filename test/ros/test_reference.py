# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The tables behind the reference say what running nodes declare and offer, no more, no less."""

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.expand_topic_name import expand_topic_name  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.skeleton_file import load_skeleton  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.body_boxes_node import BodyBoxesNode  # noqa: E402
from rrth_planner.ros.interface import (  # noqa: E402
    parameters,
    playback_parameters,
    simulation_parameters,
    tracker_parameters,
)
from rrth_planner.ros.interface.posture_inputs import points_of  # noqa: E402
from rrth_planner.ros.interface.topics import Direction, INTERFACES  # noqa: E402
from rrth_planner.ros.messages.point_head import PointHead  # noqa: E402
from rrth_planner.ros.middleware.parameter_declaration import OF_ROS  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.playback_node import PlaybackNode  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LISTS = {
    Direction.SUBSCRIBES: 'subscriber',
    Direction.PUBLISHES: 'publisher',
    Direction.SERVES: 'service',
}
# What each node has by itself, and TF where it is installed.
OF_EACH = {'/rosout', '/parameter_events', '/tf', '/tf_static'}
TYPES_OF_EACH = ('rcl_interfaces/', 'type_description_interfaces/')
SETTINGS = {
    'rrth_planner': (parameters.ARM, *parameters.declared(load_arm().dof)),
    'arm_playback': playback_parameters.SETTINGS,
    'arm_simulation': simulation_parameters.SETTINGS,
    'body_boxes_node': tracker_parameters.SETTINGS,
}
# A node, and the parameters that decide what it offers.
STARTS = [
    ('rrth_planner', {'separation': 'auto'}),
    ('rrth_planner', {'separation': True}),
    ('rrth_planner', {'separation': False}),
    ('arm_playback', {}),
    ('arm_simulation', {'wearer': 'none'}),
    ('arm_simulation', {'wearer': 'standing'}),
    ('body_boxes_node', {'input': 'markers', 'skeleton': 'azure_kinect'}),
    ('body_boxes_node', {'input': 'poses', 'skeleton': 'xsens'}),
    ('body_boxes_node', {'input': 'bodies', 'skeleton': 'xsens'}),
    ('body_boxes_node', {'input': 'joint_states', 'skeleton': 'ros4hri'}),
]


@pytest.fixture(
    name='node', params=STARTS, ids=lambda s: '-'.join(map(str, [s[0], *s[1].values()]))
)
def _node(request):
    """Start a node, in a namespace; give it, its name and the parameters that it was given."""
    name, given = request.param
    if given.get('input') == 'joint_states':
        pytest.importorskip('yourdfpy')
    options = {
        'namespace': '/reference',
        'parameter_overrides': [Parameter(k, value=v) for k, v in given.items()],
    }
    if name == 'rrth_planner':
        node = PlannerNode(InProcessPlanner(), **options)
    elif name == 'arm_simulation':
        pytest.importorskip('mujoco')
        from rrth_planner.ros.simulation_node import SimulationNode

        node = SimulationNode(**options)
    else:
        node = {'arm_playback': PlaybackNode, 'body_boxes_node': BodyBoxesNode}[name](**options)
    yield node, name, given
    if name == 'rrth_planner':
        node.close()
    node.destroy_node()


# What an action consists of.
PARTS = (
    (Direction.SERVES, 'send_goal', '{}_SendGoal'),
    (Direction.SERVES, 'cancel_goal', 'action_msgs/srv/CancelGoal'),
    (Direction.SERVES, 'get_result', '{}_GetResult'),
    (Direction.PUBLISHES, 'feedback', '{}_FeedbackMessage'),
    (Direction.PUBLISHES, 'status', 'action_msgs/msg/GoalStatusArray'),
)


def offered(watcher, node):
    """Return what a node has, as (direction, resolved name, type)."""
    return {
        (direction, name, kind)
        for direction, what in LISTS.items()
        for name, kinds in getattr(watcher, f'get_{what}_names_and_types_by_node')(
            node.get_name(), node.get_namespace()
        )
        for kind in kinds
        if name not in OF_EACH and not kind.startswith(TYPES_OF_EACH)
    }


def expected(node, name, given):
    """Return the same by the table."""
    found = set()
    for i in INTERFACES[name]:
        if i.direction is Direction.PERFORMS:
            action = expand_topic_name(i.name, node.get_name(), node.get_namespace())
            for direction, part, kind in PARTS if PointHead is not None else ():
                found.add((direction, f'{action}/_action/{part}', kind.format(i.type)))
            continue
        if i.parameter and given[i.parameter] not in i.values:
            continue
        names = [i.name]
        if '{name}' in i.name:
            points = points_of(load_skeleton(given['skeleton']))
            names = [i.name.replace('{name}', point) for point in points]
        for topic in names:
            resolved = expand_topic_name(topic, node.get_name(), node.get_namespace())
            found.add((i.direction, resolved, i.type))
    return found


def test_a_node_declares_and_offers_what_the_reference_says(node, wait_until):
    node, name, given = node
    declared = set(node.list_parameters([], 0).names)
    declared = {p for p in declared - set(OF_ROS) if not p.startswith('qos_overrides.')}
    assert declared == {setting.name for setting in SETTINGS[name]}
    for setting in SETTINGS[name]:
        described = node.describe_parameter(setting.name)
        assert described.description == f'{setting.description} [{setting.unit}]'
        assert described.read_only == setting.is_read_only
    watcher = Node('watcher', namespace='/reference')
    try:
        wanted = expected(node, name, given)
        wait_until(lambda: offered(watcher, node) >= wanted)
        assert offered(watcher, node) == wanted
    finally:
        watcher.destroy_node()


def test_tf_is_the_only_input_without_a_topic():
    of_inputs = {
        value
        for i in INTERFACES['body_boxes_node']
        if i.parameter == 'input'
        for value in i.values
    }
    assert of_inputs == set(tracker_parameters.INPUTS) - {'tf'}
