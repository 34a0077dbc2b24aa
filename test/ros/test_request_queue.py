# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The queue of requests: their turns, and what is withdrawn, refused and answered for."""

from dataclasses import replace
from threading import Event
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import ARM, FAR, without_separation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.execution.flight_recorder import FlightRecorder  # noqa: E402
from rrth_planner.execution.joint_reading import JointReading  # noqa: E402
from rrth_planner.model.errors import RecordError, RequestError  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.requests.request_queue import MOST_WAITING, PlanQueue  # noqa: E402
from rrth_planner.ros.interface.inputs import Inputs  # noqa: E402
from rrth_planner.ros.interface.parameters import NEVER  # noqa: E402
from rrth_planner.ros.interface.publishers import PlanPublishers  # noqa: E402
from rrth_planner.ros.interface.reporter import Reporter  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import BodyPart  # noqa: E402
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor  # noqa: E402
from rrth_planner.ros.requests.node_host import NodeHost  # noqa: E402
from stranger import Scripted  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
GOAL = PointingGoal(np.array([1.5, 0.1, 0.3]))


@pytest.fixture(name='queue')
def _queue():
    """Give the queue of a node that the test spins by hand."""
    node = Node('queue')
    inputs, parameters = Inputs('body', 'target', 'joints'), without_separation(node)
    now = node.get_clock().now().nanoseconds * 1e-9
    inputs.body.value = WearerBody(((('far', 0), BodyPart((FAR,), float('inf'))),))
    inputs.joints.value = JointReading(
        np.array(worlds.FOLDED), np.zeros(ARM.dof), now, now, float('inf')
    )
    inputs.body.measured = inputs.joints.measured = now
    publishers, reporter = PlanPublishers(node, NEVER, 'torso'), Reporter(node, inputs, parameters)
    monitor = ExecutionMonitor(node, inputs, reporter, publishers)
    script = Scripted()
    host = NodeHost(node, script)
    queue = PlanQueue(host, inputs, reporter, publishers, monitor)
    queue.host, queue.reporter, queue.monitor, queue.script = host, reporter, monitor, script
    yield queue
    queue.close()
    node.destroy_node()


def ask(queue, goal):
    """Begin a request, and return the future of its outcome."""
    return queue.host.future_of(queue.respond(goal))


def outcomes_of(queue, requests):
    """Return how some requests end."""
    end = time.monotonic() + 30.0
    while not all(request.done() for request in requests):
        assert time.monotonic() < end
        queue.host.go_on()
        time.sleep(1e-4)
    return [request.result() for request in requests]


def test_a_goal_that_is_withdrawn_is_planned_for_no_more(queue):
    goals = [PointingGoal(GOAL.target + [0.0, 0.0, 1e-3 * k]) for k in range(6)]
    waiting = [ask(queue, goal) for goal in goals]
    assert all(queue.pursues(goal) for goal in goals)
    for goal in goals[::2]:
        queue.withdraw(goal)
    outcomes = outcomes_of(queue, waiting)
    assert [outcome.code is ErrorCode.PREEMPTED for outcome in outcomes] == 3 * [True, False]
    assert outcomes[1].trajectory is not None
    assert not any(queue.pursues(goal) for goal in goals)


def test_requests_are_answered_in_turn(queue):
    order = []

    async def note(k):
        await queue.respond(PointingGoal(GOAL.target + [0.0, 0.0, 1e-3 * k]))
        order.append(k)

    outcomes_of(queue, [queue.host.future_of(note(k)) for k in range(10)])
    assert order == list(range(10))


def test_more_requests_than_may_wait_are_refused_at_once(queue):
    waiting = [ask(queue, GOAL) for _ in range(MOST_WAITING)]
    refused = ask(queue, GOAL).result()
    assert refused.code is ErrorCode.PREEMPTED
    assert refused.sentence.startswith(f'{MOST_WAITING} requests wait for their answers already')
    queue.cancel()
    outcomes_of(queue, waiting)
    # There is room again.
    (outcome,) = outcomes_of(queue, [ask(queue, GOAL)])
    assert outcome.sentence != refused.sentence


def test_a_planner_that_hangs_is_answered_for(queue, monkeypatch):
    monkeypatch.setattr('rrth_planner.ros.requests.node_host.LONGEST_ANSWER', 0.0)
    end = Event()

    def hang(*_):
        end.wait(30.0)

    options = replace(queue.reporter.parameters.options, time_limit=0.1)
    queue.reporter.parameters = replace(queue.reporter.parameters, options=options)
    queue.script.plans = hang
    outcomes = outcomes_of(queue, [ask(queue, GOAL) for _ in range(2)])
    end.set()
    for outcome in outcomes:
        assert outcome.code is ErrorCode.FAILURE
        assert 'the planner has not answered within 0.1 s' in outcome.sentence


def test_a_request_whose_motion_could_not_begin_can_still_be_cancelled(queue, monkeypatch):
    tries = []

    def cannot_begin(*_):
        tries.append(queue.pursues(GOAL))
        assert queue.cancel() == 1
        raise RequestError(ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE, 'of the test')

    monkeypatch.setattr(ExecutionMonitor, 'begin', cannot_begin)
    (outcome,) = outcomes_of(queue, [ask(queue, GOAL)])
    assert outcome.code is ErrorCode.PREEMPTED
    assert tries == [True]
    assert not queue.pursues(GOAL)


def test_a_flight_record_that_cannot_be_made_costs_no_answer(queue, monkeypatch):
    monkeypatch.setattr(FlightRecorder, 'to_bytes', lambda _: 1 / 0)
    queue.script.plans = lambda *_: 1 / 0
    (outcome,) = outcomes_of(queue, [ask(queue, GOAL)])
    assert outcome.code is ErrorCode.FAILURE
    assert 'ZeroDivisionError' in outcome.sentence
    end = queue.host.future_of(queue.save())
    with pytest.raises(RecordError, match='no flight record was written: ZeroDivisionError'):
        outcomes_of(queue, [end])


def test_an_error_that_comes_again_and_again_leaves_one_record(queue, monkeypatch, tmp_path):
    parameters = replace(queue.reporter.parameters, incident_folder=str(tmp_path))
    queue.reporter.parameters = parameters
    for _ in range(20):
        queue.monitor.fail('of the test', is_replanned=False)
        queue.follow_up()
        queue.host.go_on()
        time.sleep(0.01)
    end = time.monotonic() + 10.0
    while not list(tmp_path.iterdir()) and time.monotonic() < end:
        queue.host.go_on()
        time.sleep(0.01)
    assert len(list(tmp_path.glob('flight-*.flight'))) == 1


def test_a_request_that_is_turned_away_overtakes_nothing(queue):
    waiting = [ask(queue, GOAL) for _ in range(MOST_WAITING)]
    n = queue.n_taken
    refused = ask(queue, GOAL).result()
    assert refused.number == MOST_WAITING + 1
    assert queue.n_taken == n == MOST_WAITING
    queue.cancel()
    outcomes_of(queue, waiting)
