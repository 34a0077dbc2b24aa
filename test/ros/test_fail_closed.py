# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever goes wrong while a motion is monitored, the arm stops: faults at every call of that."""

from dataclasses import replace
from itertools import count
from pathlib import Path
import sys
from types import FunctionType, SimpleNamespace

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import FAR, Monitored, without_separation  # noqa: E402
from rclpy.node import Node  # noqa: E402
import rrth_planner  # noqa: E402
from rrth_planner.execution import (  # noqa: E402
    commitments,
    decide as decisions,
    fail_safe_stop,
    flight_recorder,
    step,
    tracked_motion,
)
from rrth_planner.execution.commitments import Commitments  # noqa: E402
from rrth_planner.execution.executing_motion import ExecutingMotion  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.requests.request_queue import PlanQueue  # noqa: E402
from rrth_planner.ros.interface.inputs import Input, Inputs  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
from rrth_planner.ros.middleware.qos import LEASE  # noqa: E402
from rrth_planner.ros.monitor import execution_monitor  # noqa: E402
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor  # noqa: E402
from rrth_planner.ros.planner import PlannerNode  # noqa: E402
from rrth_planner.ros.requests.node_host import NodeHost  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
PACKAGE = str(Path(rrth_planner.__file__).parent)
RECORDER = flight_recorder.__file__
# A body comes so often, and the timer of the monitor is due so often [s].
PERIOD = 0.02
# How long the monitor is held up [s].
DELAY = 0.1
# Enough for a stop of the motion below [s].
LONGEST_STOP = 0.6


class Fault(Exception):
    """Nothing that any code expects."""


def is_recording(frame):
    """Return whether a call serves the flight recorder."""
    while frame is not None and frame.f_code.co_filename != RECORDER:
        frame = frame.f_back
    return frame is not None


class Injector:
    """Counts the calls that the package makes, and has the one with this number fail, if any."""

    def __init__(self, at):
        self.n, self.is_hit, self._at = 0, False, at

    def __call__(self, frame, event, _):
        """Check one event of the interpreter."""
        if event.removeprefix('c_') != 'call':
            return
        caller = frame if event.startswith('c_') else frame.f_back
        if caller is None or not caller.f_code.co_filename.startswith(PACKAGE):
            return
        # What cannot be recorded is decided all the same.
        if is_recording(frame):
            return
        self.n += 1
        if self.n - 1 == self._at:
            self.is_hit = True
            raise Fault(f'at call {self._at}')

    def __enter__(self):
        sys.setprofile(self)
        return self

    def __exit__(self, *_):
        sys.setprofile(None)


@pytest.fixture(scope='module')
def monitored(ros_context):
    """Give what makes a monitor of a motion that has just begun."""
    # Monitors do not change their node, which is never spun.
    node = Node('fail_closed')
    parameters = without_separation(node)
    yield lambda: Monitored(node, parameters)
    node.destroy_node()


def supervised(arm, step):
    """Do as the node does where an error is not even within the monitor."""
    try:
        step()
    except Fault as problem:
        arm.monitor.fail(f'{problem}', is_replanned=False)


def follow(arm):
    """Let the arm execute its last motion, with bodies and timers, for the time of a stop."""
    begin, waits = arm.now, 0.0
    while arm.now - begin < LONGEST_STOP:
        arm.now += PERIOD
        waits = arm.now - (arm.alive[-1] if arm.alive else begin)
        if not arm.published and waits > LEASE:
            # The playback, or the controller of a real arm, stops it.
            return 'its planner is lost'
        arm.read(*(arm.executes() if arm.published else arm.on_time(arm.now - 100.0)))
        supervised(arm, lambda: arm.see(*arm.boxes))
        # A body that came while the one before was still checked has waited since then.
        arm.late = 0.0
        supervised(arm, arm.monitor.check)
    return 'stopped' if arm.published and not arm.executes()[1].any() else 'continues'


def steps_of(arm):
    """Return what has a monitor check once, by their names."""
    return {'body': lambda: arm.see(*arm.boxes), 'timer': arm.monitor.check}


@pytest.mark.parametrize(('which', 'is_hand'), [('body', True), ('body', False), ('timer', False)])
def test_a_fault_at_any_call_of_the_monitor_stops_the_arm(monitored, which, is_hand):
    n_hit = 0
    while True:
        arm = monitored()
        arm.boxes = [FAR]
        arm.see(FAR)
        arm.boxes += [arm.hand(0.6, 0.0)] * is_hand
        with Injector(n_hit) as injector:
            supervised(arm, steps_of(arm)[which])
        if not injector.is_hit:
            break
        assert follow(arm) == 'stopped', f'at call {n_hit}'
        arm.monitor.close()
        n_hit += 1
    assert n_hit >= (50 if which == 'body' else 25)


@pytest.mark.parametrize(('which', 'is_hand'), [('body', True), ('body', False), ('timer', False)])
def test_a_monitor_that_is_held_up_anywhere_stops_the_arm(monitored, which, is_hand):
    # Where it is held up between two readings of a clock makes no difference.
    n_readings = None
    for k in count():
        arm = monitored()
        arm.boxes = [FAR]
        arm.see(FAR)
        arm.boxes += [arm.hand(0.6, 0.0)] * is_hand
        readings = count()

        def hold_up(arm=arm, readings=readings, k=k):
            if next(readings) == k:
                arm.now += DELAY
                arm.late += DELAY

        arm.on_reading = hold_up
        supervised(arm, steps_of(arm)[which])
        n_readings = next(readings)
        if n_readings == k:
            # It was held up after all of them.
            hold_up(readings=iter([k]))
        arm.on_reading = lambda: None
        arm.late = max(0.0, arm.late - PERIOD)
        assert follow(arm) == 'stopped', f'before reading {k}'
        arm.monitor.close()
        if n_readings == k:
            break
    assert n_readings >= 2


# What the monitor's functions are in.
MODULES = (execution_monitor, step, decisions, fail_safe_stop, commitments, tracked_motion)


def places():
    """Return what the monitor calls, as (owner, name)."""
    found = [
        (module, name)
        for module in MODULES
        for name, value in vars(module).items()
        if isinstance(value, FunctionType)
        and value.__module__.startswith(('rrth_planner.execution', 'rrth_planner.ros.messages'))
    ]
    for owner in (
        Commitments,
        ExecutionMonitor,
        Inputs,
        Input,
        WearerBody,
        ExecutingMotion,
    ):
        found += [
            (owner, name)
            for name, value in vars(owner).items()
            if isinstance(value, FunctionType) and not name.startswith('__')
        ]
    return found


PLACES = [pytest.param(*place, id=f'{place[0].__name__}.{place[1]}') for place in places()]


@pytest.mark.parametrize('is_hand', [True, False])
@pytest.mark.parametrize(('owner', 'name'), PLACES)
def test_what_fails_for_ever_stops_the_arm_or_loses_its_planner(
    monitored, monkeypatch, owner, name, is_hand
):
    arm = monitored()
    arm.boxes = [FAR, *([arm.hand(0.6, 0.0)] * is_hand)]
    n_calls = []

    def fail(*_, **__):
        n_calls.append(name)
        raise Fault(name)

    monkeypatch.setattr(owner, name, fail)
    found = follow(arm)
    if is_hand or n_calls:
        assert found in ('stopped', 'its planner is lost')
    else:
        assert found == 'continues'


def test_a_message_that_cannot_be_published_is_published_again(monitored, monkeypatch):
    arm = monitored()
    arm.boxes = [FAR, arm.hand(0.6, 0.0)]
    publish, n_tries = arm.publishers.publish_motion, []

    def at_the_third_time(*arguments):
        n_tries.append(arm.now)
        if len(n_tries) < 3:
            raise Fault('no middleware')
        publish(*arguments)

    arm.publishers.publish_motion = at_the_third_time
    assert follow(arm) == 'stopped'
    assert len(n_tries) == 3
    # Meanwhile liveliness was not asserted.
    assert not [time for time in arm.alive if n_tries[0] <= time < n_tries[-1]]


def test_a_rejected_body_stops_the_arm_with_the_reason(monitored):
    arm = monitored()
    arm.boxes = [FAR]

    def reject():
        raise MessageError('marker 3 ("shoe"): pose.position: nan')

    arm.inputs.body.accept(reject, arm.now)
    arm.monitor.on_body(arm.inputs.body.value, 0)
    assert len(arm.published) == 1
    assert arm.reporter.monitor_state[0] == 'stopping'
    assert (
        'the last message on body was rejected: marker 3 ("shoe")' in arm.reporter.monitor_state[1]
    )


def test_joint_positions_that_are_rejected_stop_the_arm(monitored):
    arm = monitored()
    arm.inputs.joint_rejection = MessageError('position: nan')
    arm.monitor.check()
    assert len(arm.published) == 1
    assert (
        'the last message on joints was rejected: position: nan' in arm.reporter.monitor_state[1]
    )


@pytest.mark.parametrize(('late', 'n_stops'), [(0.049, 0), (0.051, 1)])
def test_a_body_that_is_checked_late_stops_the_arm(monitored, late, n_stops):
    arm = monitored()
    arm.late = late
    arm.see(FAR)
    assert len(arm.published) == n_stops
    is_late = 'was checked 0.051 s after its arrival' in arm.reporter.monitor_state[1]
    assert is_late == bool(n_stops)


@pytest.mark.parametrize('replan', [True, False])
@pytest.mark.parametrize(('late', 'n_again'), [(0.0, 0), (0.2, 1)])
def test_after_an_error_nothing_is_planned_by_itself(monitored, replan, late, n_again):
    arm = monitored()
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=replan)
    arm.late = late
    if not late:
        arm.reporter.remaining_motion_checked = lambda *_: 1 / 0
    arm.see(FAR)
    assert len(arm.published) == 1
    (stop,) = arm.monitor.take_stops()
    assert stop.is_replanned == (n_again * replan == 1)


def test_a_motion_that_is_not_wanted_any_more_is_not_planned_again_for_what_fails_then(monitored):
    arm = monitored()
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=True)
    publish, arm.publishers.publish_motion = arm.publishers.publish_motion, lambda *_: 1 / 0
    arm.monitor.brake('of the test')
    arm.monitor.fail('a body is late')
    arm.publishers.publish_motion = publish
    arm.monitor.check()
    assert len(arm.published) == 1
    (stop,) = arm.monitor.take_stops()
    assert not stop.is_replanned
    # The next one may be.
    arm.begin()
    arm.monitor.fail('a body is late')
    (stop,) = arm.monitor.take_stops()
    assert stop.is_replanned


@pytest.mark.parametrize('is_taken', [True, False])
def test_after_an_error_while_the_arm_stops_nothing_is_planned_by_itself(monitored, is_taken):
    arm = monitored()
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=True)
    arm.monitor.fail('a body is late')
    n_stops = arm.monitor.watch.n_stops
    if is_taken:
        (stop,) = arm.monitor.take_stops()
        assert stop.is_replanned
    arm.monitor.fail('the monitor failed', is_replanned=False)
    arm.monitor.fail('the monitor failed', is_replanned=False)
    *before, stop = arm.monitor.take_stops()
    assert not stop.is_replanned
    assert len(before) == (not is_taken)
    # Nor is a motion published that was planned meanwhile.
    assert arm.monitor.watch.n_stops > n_stops
    assert arm.monitor.watch.stop_reason == 'the monitor failed'
    assert len(arm.published) == 1


def test_what_is_tried_after_a_stop_is_withdrawn_after_an_error(monitored):
    arm = monitored()
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=True)
    node = Node('fail_closed_queue')
    publishers = SimpleNamespace(is_view_subscribed=lambda: False)
    host = NodeHost(node, SimpleNamespace(close=lambda: None))
    queue = PlanQueue(host, arm.inputs, arm.reporter, publishers, arm.monitor)
    goal = arm.monitor.watch.goal
    arm.monitor.fail('a body is late')
    queue.follow_up()
    assert queue.pursues(goal)
    arm.monitor.fail('the monitor failed', is_replanned=False)
    queue.follow_up()
    assert not queue.pursues(goal)
    host.close()
    node.destroy_node()


def test_a_planner_that_ends_stops_its_arm(monitored):
    arm = monitored()
    arm.monitor.close()
    assert len(arm.published) == 1
    assert 'the planner is shutting down' in arm.reporter.monitor_state[1]
    arm.monitor.close()
    assert len(arm.published) == 1


def test_a_planner_that_ends_stops_its_arm_before_all_else():
    ended = []

    def part(name):
        return SimpleNamespace(close=lambda: ended.append(name))

    parts = {f'_{name}': part(name) for name in ('point_head', 'monitor', 'queue')}
    PlannerNode.close(SimpleNamespace(**parts))
    assert ended == ['monitor', 'point_head', 'queue']
