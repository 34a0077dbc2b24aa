# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Another process writes to a topic as often as it can; requests are answered."""

import math
import os
import sys

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from benchmarks.common.flood import Flood  # noqa: E402
from conftest import ask, send, spinning, wait_until  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.ros.middleware.child_process import ChildProcess  # noqa: E402
import samples  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TOPICS = {
    'body_boxes': (MarkerArray, samples.wearer),
    'target': (PointStamped, samples.target),
    'joint_states': (JointState, samples.joints),
}
NODE = 'rrth_planner.ros.planner_node'
# Messages published before the first request, and requests. One that waited until nothing is left
# to be read would be answered that the node is busy. How long answers take is judged by the soak:
# here the speed of the machine would decide.
N_MESSAGES, N_REQUESTS = 2000, 50


@pytest.fixture(name='client', scope='module')
def _client(ros_context):
    node = Node('client', namespace='/flooded')
    node.publishers_of = {
        name: node.create_publisher(kind, name, LATCHED) for name, (kind, _) in TOPICS.items()
    }
    node.plan = node.create_client(Trigger, 'rrth_planner/plan')
    yield node
    node.destroy_node()


@pytest.fixture(name='udp', scope='module')
def _udp():
    """Have planner and flood speak UDP; a middleware without such a setting ignores it."""
    # Under a flood the shared memory of Fast DDS, which the node has no hand in, now and then
    # hands on a message a third of a second late.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
        yield


@pytest.fixture(name='planner', scope='module')
def _planner(ros_context, udp):
    arguments = ['--ros-args', '-r', '__ns:=/flooded', '-p', 'seed:=7', '-p', 'separation:=false']
    with ChildProcess(NODE, arguments, lambda _: None) as child:
        yield child


@pytest.fixture(name='inputs', scope='module')
def _inputs(client, planner):
    """Send all inputs once."""
    with spinning(client):
        wait_until(client.plan.service_is_ready, 120.0)
        for name, (_, make) in TOPICS.items():
            send(client, client.publishers_of[name], make())
        request(client, planner)


def request(client, planner):
    """Request a plan, which succeeds."""
    answer = ask(client.plan)
    assert answer.success, answer.message
    planner.check()


@pytest.mark.usefixtures('inputs')
@pytest.mark.parametrize('topic', TOPICS)
def test_requests_are_answered_while_a_topic_is_flooded(
    client, planner, monkeypatch, tmp_path, topic
):
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(sys.path))
    message = TOPICS[topic][1]()
    with spinning(client), Flood(f'/flooded/{topic}', message, tmp_path, math.inf) as flood:
        wait_until(lambda: flood.count > N_MESSAGES)
        begin = flood.count
        for _ in range(N_REQUESTS):
            request(client, planner)
            flood.check()
        assert flood.count > begin
