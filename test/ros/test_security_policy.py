# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The SROS 2 policy allows what the nodes do, and nothing else."""

from xml.etree import ElementTree

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.expand_topic_name import expand_topic_name  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.ros.body_boxes_node import BodyBoxesNode  # noqa: E402
from rrth_planner.ros.messages.frames import tf2_ros  # noqa: E402
from rrth_planner.ros.messages.point_head import PointHead  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.playback_node import PlaybackNode  # noqa: E402
from rrth_planner.ros.simulation_node import SimulationNode  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
NODES = {
    '/rrth_planner': PlannerNode,
    '/arm_playback': PlaybackNode,
    '/arm_simulation': SimulationNode,
    '/body_boxes_node': BodyBoxesNode,
}
# What is done with topics and services, and how a node names its own.
DEEDS = {
    ('topics', 'publish'): 'publisher',
    ('topics', 'subscribe'): 'subscriber',
    ('services', 'reply'): 'service',
    ('services', 'request'): 'client',
}
# Actions are services and topics, by these names.
ACTIONS = ('actions', 'execute'), ('actions', 'call')
PARTS = {
    ('services', 'reply'): ('send_goal', 'cancel_goal', 'get_result'),
    ('topics', 'publish'): ('feedback', 'status'),
}
TF = {'/tf', '/tf_static'} if tf2_ros is None else set()
# These decide whether the arm is safe: only their owner may publish them. An arm is one of two.
ONE_SPEAKER = {
    '/markers': ['/wearer'],
    '/body_boxes': ['/body_boxes_node'],
    '/target': ['/operator'],
    '/joint_states': ['/arm_playback', '/arm_simulation'],
    '/joint_trajectory': ['/rrth_planner'],
}


@pytest.fixture(scope='module')
def policy():
    """Return by enclave and deed the resolved names that are allowed."""
    root = ElementTree.parse(resource_path('config/sros2_policy.xml')).getroot()
    assert (root.tag, root.attrib) == ('policy', {'version': '0.2.0'})
    found = {}
    for enclave in root.findall('enclaves/enclave'):
        (profile,) = enclave.findall('profiles/profile')
        assert enclave.get('path') == f'/{profile.get("node")}'
        allowed = found[enclave.get('path')] = {deed: set() for deed in (*DEEDS, *ACTIONS)}
        for group in profile:
            ((deed, word),) = group.attrib.items()
            assert word == 'ALLOW'
            for entry in group:
                assert entry.tag == group.tag[:-1]
                name = expand_topic_name(entry.text, profile.get('node'), profile.get('ns'))
                assert name not in allowed[group.tag, deed], 'named twice'
                allowed[group.tag, deed].add(name)
    return found


@pytest.mark.parametrize('path', NODES)
def test_a_node_may_do_what_it_does_and_nothing_else(path, policy, wait_until):
    if path == '/arm_simulation':
        pytest.importorskip('mujoco')
    overrides = [Parameter('use_sim_time', value=True)]
    if path == '/rrth_planner':
        # With all that it may publish.
        overrides.append(Parameter('separation', value=True))
    node = NODES[path](parameter_overrides=overrides)
    watcher = Node('watcher')

    def done():
        return {
            deed: {
                name
                for name, _ in getattr(watcher, f'get_{what}_names_and_types_by_node')(
                    node.get_name(), node.get_namespace()
                )
            }
            for deed, what in DEEDS.items()
        }

    allowed = {deed: set(policy[path][deed]) for deed in DEEDS}
    if PointHead is not None:
        for action in policy[path]['actions', 'execute']:
            for deed, parts in PARTS.items():
                allowed[deed] |= {f'{action}/_action/{part}' for part in parts}
    if path == '/rrth_planner':
        assert allowed['topics', 'subscribe'] >= TF
        allowed['topics', 'subscribe'] -= TF
    try:
        wait_until(lambda: path[1:] in watcher.get_node_names())
        wait_until(lambda: sum(map(len, done().values())) >= sum(map(len, allowed.values())))
        assert done() == allowed
    finally:
        watcher.destroy_node()
        if isinstance(node, PlannerNode):
            node.close()
        node.destroy_node()


def test_what_decides_safety_has_one_speaker(policy):
    for topic, owners in ONE_SPEAKER.items():
        speakers = [path for path, deeds in policy.items() if topic in deeds['topics', 'publish']]
        assert speakers == owners


def test_nobody_may_set_parameters_or_use_wildcards(policy):
    for deeds in policy.values():
        assert not [name for name in deeds['services', 'request'] if 'set_parameters' in name]
        assert not [name for names in deeds.values() for name in names if '*' in name]


def test_what_the_operator_calls_is_served(policy):
    served = policy['/rrth_planner']['services', 'reply']
    served = served | policy['/arm_playback']['services', 'reply']
    assert policy['/operator']['services', 'request'] <= served
    called = policy['/operator']['actions', 'call']
    assert called == policy['/rrth_planner']['actions', 'execute'] == {'/rrth_planner/point_head'}
