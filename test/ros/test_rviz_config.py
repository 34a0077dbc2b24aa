# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""RViz shows inputs and outputs of the planner, and its clicks are received."""

from xml.etree import ElementTree

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.qos import DurabilityPolicy, ReliabilityPolicy  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.text_file import load_yaml
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
NODE, NAMESPACE = 'rrth_planner', '/in_rviz'
# What displays and tools of RViz take and give.
TYPES = {
    'MarkerArray': 'visualization_msgs/msg/MarkerArray',
    'Path': 'nav_msgs/msg/Path',
    'PointStamped': 'geometry_msgs/msg/PointStamped',
    'PublishPoint': 'geometry_msgs/msg/PointStamped',
}
# The plugins that RViz of Jazzy brings along and this file may name.
PLUGINS = {
    *TYPES,
    'FocusCamera',
    'Grid',
    'Measure',
    'MoveCamera',
    'Orbit',
    'RobotModel',
    'Select',
    'TF',
}


@pytest.fixture(scope='module')
def manager():
    """Return what RViz is to show."""
    return load_yaml(resource_path('rviz/rrth_planner.rviz'))['Visualization Manager']


@pytest.fixture(scope='module')
def planner(ros_context):
    """Return a planner node."""
    node = PlannerNode(InProcessPlanner(), namespace=NAMESPACE)
    yield node
    node.close()
    node.destroy_node()


@pytest.fixture(scope='module')
def topics(planner):
    """Return the planner's topics and types, without its namespace: published and subscribed."""
    return [
        {name.removeprefix(NAMESPACE): types[0] for name, types in names}
        for names in (
            planner.get_publisher_names_and_types_by_node(NODE, NAMESPACE),
            planner.get_subscriber_names_and_types_by_node(NODE, NAMESPACE),
        )
    ]


def by_topic(entries, key='Topic'):
    """Return the class and the topic's settings of displays or tools, by the name of the topic."""
    return [
        (entry['Class'].split('/')[1], entry[key]['Value'], entry[key])
        for entry in entries
        if key in entry
    ]


def test_every_topic_is_one_of_the_planner_and_of_its_type(manager, topics):
    published, subscribed = topics
    shown = by_topic(manager['Displays'])
    clicked = by_topic(manager['Tools'])
    assert shown
    for kind, topic, _ in shown:
        assert {**published, **subscribed}.get(topic) == TYPES[kind], topic
    ((kind, topic, _),) = clicked
    assert kind == 'PublishPoint'
    assert subscribed.get(topic) == TYPES[kind]


def test_all_that_can_be_shown_is_shown(manager, topics):
    shown = {topic for _, topic, _ in by_topic(manager['Displays'])}
    can_be = {
        name for names in topics for name, kind in names.items() if kind in set(TYPES.values())
    }
    assert shown == can_be


def test_displays_receive_latched_messages_of_every_quality(manager, topics, planner):
    said, _ = topics
    for _, topic, settings in by_topic(manager['Displays']):
        asked = settings['Durability Policy'], settings['Reliability Policy']
        if topic not in said:
            # Any publisher there is received.
            assert asked == ('Volatile', 'Best Effort')
            continue
        (info,) = planner.get_publishers_info_by_topic(f'{NAMESPACE}{topic}')
        assert info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert asked == ('Transient Local', 'Reliable')


def test_the_fixed_frame_is_the_base_frame_of_planner_and_urdf(manager, planner):
    fixed = manager['Global Options']['Fixed Frame']
    assert fixed == planner.get_parameter('base_frame').value
    robot = ElementTree.parse(resource_path('urdf/arm.urdf')).getroot()
    children = {joint.find('child').get('link') for joint in robot.findall('joint')}
    assert {link.get('name') for link in robot.findall('link')} - children == {fixed}


def test_the_arm_is_shown_as_robot_state_publisher_describes_it(manager):
    ((kind, topic, settings),) = by_topic(manager['Displays'], 'Description Topic')
    assert (kind, topic) == ('RobotModel', '/robot_description')
    assert settings['Durability Policy'] == 'Transient Local'


def test_only_plugins_of_rviz_itself_are_named(manager):
    named = [entry['Class'] for entry in [*manager['Displays'], *manager['Tools']]]
    named += [manager['Views']['Current']['Class'], manager['Transformation']['Current']['Class']]
    assert {name.split('/')[0] for name in named} == {'rviz_default_plugins'}
    assert {name.split('/')[1] for name in named} <= PLUGINS
