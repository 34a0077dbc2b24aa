# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A node that talks with the planner as a stranger would, and the planner that it talks with."""

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import PointStamped  # noqa: E402
from nav_msgs.msg import Path  # noqa: E402
from nav_msgs.srv import GetPlan  # noqa: E402
from rcl_interfaces.msg import Log  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rrth_planner.collision.trajectory_validation import violation_seen  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.requests.outcome import Outcome  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from samples import joints, target, wearer  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

NAN = float('nan')
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
VOLATILE = QoSProfile(depth=10)
TOPICS = {
    'body_boxes': (MarkerArray, wearer),
    'target': (PointStamped, target),
    'joint_states': (JointState, joints),
}


class Scripted(InProcessPlanner):
    """
    A planner in this process, and a middleware, with which a test has things happen.

    Whatever the planner is asked it hands on to `plans`, `checks` or `warms_up`, which do that at
    first. Each message of the node goes by `sends`, with the last part of its topic and what
    sends it.
    """

    def __init__(self):
        self.plans, self.checks, self.warms_up = super().plan, violation_seen, super().warm_up
        self.sends = lambda topic, msg, send: send(msg)

    def plan(self, question, should_stop=lambda: False):
        """As of `Planner`."""
        return self.plans(question, should_stop)

    def violation_seen(self, *arguments):
        """As of `Planner`."""
        return self.checks(*arguments)

    def warm_up(self, *arguments):
        """As of `Planner`."""
        self.warms_up(*arguments)


class ScriptedNode(PlannerNode):
    """The planner's node with a scripted planner, and on that middleware."""

    def __init__(self, script, **options):
        self.script = script
        super().__init__(script, **options)

    def create_publisher(self, msg_type, topic, *arguments, **options):
        """As of `Node`."""
        publisher = super().create_publisher(msg_type, topic, *arguments, **options)
        name, send = topic.split('/')[-1], publisher.publish
        publisher.publish = lambda msg: self.script.sends(name, msg, send)
        return publisher


class Stranger:
    """A node that talks with the planner of its namespace."""

    def __init__(self, namespace, wait_until, script=None):
        self.node = Node('stranger', namespace=namespace)
        self.wait_until, self.script = wait_until, script
        self.received = {}
        self.publishers = {}
        for name, msg_type in (
            ('joint_trajectory', JointTrajectory),
            ('rrth_planner/tool_path', Path),
            ('rrth_planner/markers', MarkerArray),
        ):
            self.subscribe(name, msg_type, LATCHED)
        self.subscribe('/diagnostics', DiagnosticArray, 10)
        self.services = {
            name: self.node.create_client(kind, f'rrth_planner/{name}')
            for name, kind in (
                ('plan', Trigger),
                ('get_plan', GetPlan),
                ('cancel', Trigger),
                ('save', Trigger),
            )
        }

    def subscribe(self, name, msg_type, profile):
        self.received[name] = []
        self.node.create_subscription(msg_type, name, self.received[name].append, profile)

    def say(self, topic, msg, profile=LATCHED):
        publisher = self.node.create_publisher(type(msg), topic, profile)
        self.publishers[topic] = publisher
        publisher.publish(msg)

    def ask(self, name, request=None):
        client = self.services[name]
        self.wait_until(client.service_is_ready)
        return client.call_async(client.srv_type.Request() if request is None else request)

    def answer(self, name='plan', request=None):
        future = self.ask(name, request)
        self.wait_until(future.done)
        return future.result()

    def await_turn(self):
        """Return once the node has taken what was sent before, whose requests may wait there."""
        # In each round it takes one request of each service.
        for _ in range(2):
            request = GetPlan.Request()
            request.start.header.frame_id = 'nowhere'
            self.answer('get_plan', request)

    def lines(self, planner):
        """Return the list to which each line that a planner logs is added, as (level, line)."""
        found, name = [], planner.get_logger().name
        self.node.create_subscription(
            Log, '/rosout', lambda m: found.append((m.level, m.msg)) if m.name == name else 0, 100
        )
        self.wait_until(lambda: planner.count_subscribers('/rosout') > 0)
        return found

    def value(self, key):
        """Return a value of the last diagnostics; they are of all namespaces in a process."""
        arrays = self.received['/diagnostics']
        if not arrays:
            return None
        return {v.key: v.value for v in arrays[-1].status[0].values}[key]


@pytest.fixture(name='start')
def _start(spinning, wait_until, request):
    running = []
    name = f'/test_{abs(hash(request.node.name)) % 10**9}'

    def start(**parameters):
        parameters = {'separation': False} | parameters
        given = [Parameter(name=name, value=value) for name, value in parameters.items()]
        # One after another, in a namespace each.
        namespace = f'{name}_{len(running)}' if running else name
        script = Scripted()
        planner = ScriptedNode(script, namespace=namespace, parameter_overrides=given)
        stranger = Stranger(namespace, wait_until, script)
        contexts = [spinning(planner), spinning(stranger.node)]
        for context in contexts:
            context.__enter__()
        running.append((planner, stranger, contexts))
        return planner, stranger

    yield start
    for planner, stranger, contexts in running:
        planner.close()
        for context in contexts:
            context.__exit__(None, None, None)
        planner.destroy_node()
        stranger.node.destroy_node()


def inputs_of(planner):
    return planner._scene_monitor._inputs


def say_all(planner, stranger, but=(), **messages):
    """Publish all inputs, but some, and wait until they have come in."""
    topics = [name for name in TOPICS if name not in but]
    for name in topics:
        stranger.say(name, messages.get(name, TOPICS[name][1]()))
    inputs = inputs_of(planner)
    of_topic = dict(zip(TOPICS, (inputs.body, inputs.target, inputs.joints), strict=True))
    stranger.wait_until(
        lambda: all(of_topic[n].measured is not None or of_topic[n].rejection for n in topics)
    )


@pytest.fixture(name='one_try')
def _one_try(monkeypatch):
    """Have a request planned once, however wearer and arm move."""
    monkeypatch.setattr(Outcome, 'is_outdated', False)
    monkeypatch.setattr(Outcome, 'is_in_the_way', False)
