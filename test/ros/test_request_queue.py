# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The queue of requests: what is withdrawn and refused while its worker goes on."""

import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import ARM, FAR, without_separation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.execution.joint_reading import JointReading  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.ros.interface.inputs import Inputs  # noqa: E402
from rrth_planner.ros.interface.parameters import NEVER  # noqa: E402
from rrth_planner.ros.interface.publishers import PlanPublishers  # noqa: E402
from rrth_planner.ros.interface.reporter import Reporter  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import BodyPart  # noqa: E402
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor  # noqa: E402
from rrth_planner.ros.requests.request_queue import MOST_WAITING, PlanQueue  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
GOAL = PointingGoal(np.array([1.5, 0.1, 0.3]))


@pytest.fixture(name='queue')
def _queue():
    """Give the queue of a node that nobody spins: its worker publishes, too."""
    node = Node('queue')
    inputs, parameters = Inputs('body', 'target', 'joints'), without_separation(node)
    now = node.get_clock().now().nanoseconds * 1e-9
    inputs.body.value = WearerBody(((('far', 0), BodyPart((FAR,), float('inf'))),))
    inputs.joints.value = JointReading(
        np.array(worlds.FOLDED), np.zeros(ARM.dof), now, now, float('inf')
    )
    inputs.body.measured = inputs.joints.measured = now
    publishers, reporter = PlanPublishers(node, NEVER), Reporter(node, inputs, parameters)
    monitor = ExecutionMonitor(node, inputs, reporter, publishers)
    queue = PlanQueue(node, inputs, reporter, publishers, monitor, InProcessPlanner())
    yield queue
    queue.close()
    node.destroy_node()


def ask(queue, goal):
    """Begin a request, and return what is to be resumed until it is answered."""
    request = queue.respond(goal)
    request.send(None)
    return request


def resumed(requests):
    """Resume what waits; return the answers that have come, and the others."""
    answers, waiting = [], []
    for request in requests:
        try:
            request.send(None)
            waiting.append(request)
        except StopIteration as end:
            answers.append(end.value)
    return answers, waiting


def test_a_goal_is_withdrawn_while_the_worker_ends_others(queue):
    goals = [PointingGoal(GOAL.target + [0.0, 0.0, 1e-3 * k]) for k in range(60)]
    waiting, answers, interval = [ask(queue, goal) for goal in goals], [], sys.getswitchinterval()
    # The threads take turns within each other's loops.
    sys.setswitchinterval(1e-6)
    try:
        while waiting:
            for _ in range(200):
                queue.withdraw(GOAL)
            new, waiting = resumed(waiting)
            answers += new
    finally:
        sys.setswitchinterval(interval)
    assert len(answers) == len(goals)
    assert sum(answer.is_solved for answer in answers) > 0


def test_more_requests_than_may_wait_are_refused_at_once(queue):
    waiting = [ask(queue, GOAL) for _ in range(MOST_WAITING)]
    with pytest.raises(StopIteration) as end:
        queue.respond(GOAL).send(None)
    refused = end.value.value
    assert not refused.is_solved
    assert refused.code is ErrorCode.PREEMPTED
    assert refused.sentence.startswith(f'{MOST_WAITING} requests wait for their answers already')
    queue.cancel()
    while waiting:
        _, waiting = resumed(waiting)
    # There is room again.
    waiting = [ask(queue, GOAL)]
    while waiting:
        answers, waiting = resumed(waiting)
    assert answers[0].sentence != refused.sentence
