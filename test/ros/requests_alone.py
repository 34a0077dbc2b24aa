# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The requests of a planner without its messages: inputs are set, and a test spins them."""

from itertools import count
import time

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.requests.request_queue import PlanQueue  # noqa: E402
from rrth_planner.ros.interface.inputs import Inputs  # noqa: E402
from rrth_planner.ros.interface.parameters import declare_parameters, NEVER  # noqa: E402
from rrth_planner.ros.interface.publishers import PlanPublishers  # noqa: E402
from rrth_planner.ros.interface.reporter import Reporter  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
from rrth_planner.ros.messages.joint_state import joint_reading  # noqa: E402
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor  # noqa: E402
from rrth_planner.ros.requests.node_host import NodeHost  # noqa: E402
import samples  # noqa: E402
from stranger import Scripted  # noqa: E402

LONGEST_WAIT = 30.0
_numbers = count()


class Publishers(PlanPublishers):
    """Keeps the motions that are published, and has others know when one is shown."""

    def __init__(self, node):
        super().__init__(node, NEVER, 'torso')
        self.motions, self.on_view = [], lambda: None

    def publish_motion(self, trajectory, parameters, begin):
        """As of `PlanPublishers`."""
        self.motions.append((trajectory, begin))
        super().publish_motion(trajectory, parameters, begin)

    def is_view_subscribed(self):
        """As of `PlanPublishers`."""
        return True

    def publish_view(self, *arguments):
        """As of `PlanPublishers`."""
        self.on_view()
        super().publish_view(*arguments)


class Host(NodeHost):
    """Has a test do something just before a motion is published."""

    on_read = staticmethod(lambda: None)

    async def read(self):
        """As of `RequestHost`."""
        self.on_read()
        await super().read()


class RequestsAlone:
    """The queue of requests with all that it needs; a folded arm rests beside a wearer."""

    def __init__(self, **given):
        given = {'separation': False, **given}
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        self.node = Node(f'requests_{next(_numbers)}', parameter_overrides=overrides)
        parameters = declare_parameters(self.node)
        self.names = parameters.arm.joint_names
        self.inputs = Inputs('body', 'target', 'joints')
        self.script, self.publishers = Scripted(), Publishers(self.node)
        self.reporter = Reporter(self.node, self.inputs, parameters)
        self.monitor = ExecutionMonitor(self.node, self.inputs, self.reporter, self.publishers)
        self.host = Host(self.node, self.script)
        self.queue = PlanQueue(
            self.host, self.inputs, self.reporter, self.publishers, self.monitor
        )
        self._streamed = None
        self.goal = PointingGoal([1.5, 0.1, 0.3])
        self.inputs.target.accept(lambda: self.goal, self.now)
        self.see(samples.wearer())
        self.read(samples.joints())

    @property
    def now(self):
        """What time it is for the node [s]."""
        return self.node.get_clock().now().nanoseconds * 1e-9

    def see(self, msg):
        """Let a body come."""
        self.inputs.body.accept(lambda: WearerBody().apply(msg, self.now, 'torso'), self.now)

    def read(self, msg):
        """Let joint states come."""
        before, now = self.inputs.joints.value, self.now
        self.inputs.joints.accept(lambda: joint_reading(msg, self.names, now, before), now)

    def stream(self, msg):
        """Let the same joint states come again and again from now on."""
        self._streamed = msg

    def ask(self, goal=None):
        """Begin a request; return the future of its outcome."""
        return self.host.future_of(self.queue.respond(goal))

    def answer(self, goal=None):
        """Return the outcome of a request."""
        asked = self.ask(goal)
        self.run_until(asked.done)
        return asked.result()

    def run_until(self, condition):
        """Go on until something is so."""
        end = time.monotonic() + LONGEST_WAIT
        while not condition():
            assert time.monotonic() < end, 'the condition did not come true in time'
            self.step()

    def run_for(self, seconds):
        """Go on for a time [s]."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()

    def step(self):
        """Do what is due."""
        if self._streamed is not None:
            self.read(self._streamed)
        self.queue.follow_up()
        self.host.go_on()
        time.sleep(1e-3)

    def close(self):
        """End it."""
        self.queue.close()
        self.node.destroy_node()


@pytest.fixture(name='alone')
def _alone(ros_context):
    """Give what makes the requests of a planner with some parameters."""
    made = []

    def make(**given):
        made.append(RequestsAlone(**given))
        return made[-1]

    yield make
    for one in made:
        one.close()
