# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is decided is published first, and then kept; a stop that cannot be is tried again."""

from dataclasses import replace
import math

from decisions import (
    ARM,
    BEGIN,
    begun,
    body,
    DELAY,
    FAR,
    GOAL,
    hand,
    idle,
    on,
    RULES,
    SEPARATION,
    turn,
)
import numpy as np
import pytest
from rrth_planner.execution import event as events
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decide import LONGEST_WAIT
from rrth_planner.execution.event import Look
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.step import Fate, following, step_of
from rrth_planner.execution.watch import Level, MonitorState
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import Trajectory

MOTION = turn()
SEPARATED = replace(RULES, execution=ExecutionRules(SEPARATION, DELAY, False))


def unsent(command):
    """Fail as a middleware does."""
    raise ConnectionError('no middleware')


def at_begin(trajectory=MOTION, rules=RULES):
    """Return the moment at which a motion begins."""
    return on(ExecutingMotion(trajectory=trajectory, start_time=BEGIN), BEGIN, rules)


def moving():
    """Return a watch of a motion that has just begun, and what was commanded."""
    return begun(idle(), MOTION, at_begin())


def separated():
    """
    Return the same of a motion that is given in stretches, and the wearer.

    The whole arm leans fast, and a hand beside it may get into its way.
    """
    before, states = turn(), {}
    for name in ('velocities', 'accelerations'):
        states[name] = np.zeros_like(before.positions)
    q = before.positions[0]
    swing = Trajectory(times=before.times, positions=[q, q - [0.0, 0.8, 0.0, 0.0]], **states)
    tool = tool_pose(ARM, q)[:3, 3]
    near = Scene((*FAR.boxes, Box('hand', tool + [0.0, 0.0, 0.5], [0.05] * 3, np.eye(3))))
    at = at_begin(swing, SEPARATED)
    watch = step_of(idle(SEPARATED), body(at, near), lambda: 0.0, unsent).decision.watch
    return *begun(watch, swing, at, SEPARATED), near


def later(motion, seconds, rules=RULES):
    """Return the moment so long after the begin [s], with the arm on the motion."""
    return on(motion, BEGIN + seconds, rules)


def test_what_is_published_is_kept():
    watch, motion = moving()
    sent = []
    event = body(later(motion, 0.5), hand(MOTION, 0.9))
    step = step_of(watch, event, lambda: 0.001, sent.append)
    # The stop is an event of its own, at its own time.
    assert (step.fate, step.published, sent) == (Fate.KEPT, None, [])
    at = later(motion, 0.51)
    then = [happens() for happens in following(step, lambda: at, lambda _: None, lambda: 0.0)]
    assert [type(one) for one in then] == [events.StopFor]
    assert then[0].at is at
    step = step_of(step.decision.watch, then[0], lambda: 0.001, sent.append)
    assert sent == [step.published]
    assert step.took == 0.001
    assert step.decision.watch.state is MonitorState.STOPPING


def test_a_stop_that_cannot_be_published_stays_pending_until_it_is():
    watch, motion = moving()
    fail = events.Fail(later(motion, 0.5), 'of the test', False, False)
    step = step_of(watch, fail, lambda: 0.0, unsent)
    assert step.fate is Fate.OTHERWISE
    assert step.published is None
    assert [line.level for line in step.decision.lines] == [Level.ERROR]
    assert 'no middleware' in step.decision.lines[0].text
    watch = step.decision.watch
    assert watch.pending is not None
    assert watch.is_monitoring
    sent = []
    step = step_of(watch, events.Tick(later(motion, 0.52)), lambda: 0.0, sent.append)
    assert len(sent) == 1
    assert step.decision.watch.pending is None
    assert step.decision.watch.state is MonitorState.STOPPING


def test_a_motion_that_cannot_be_published_does_not_begin():
    planned = ExecutingMotion(trajectory=MOTION, start_time=BEGIN)
    event = events.Begin(at_begin(), planned, GOAL, RULES, math.inf, None, 0, 0)
    with pytest.raises(ConnectionError):
        step_of(idle(), event, lambda: 0.0, unsent)


@pytest.mark.parametrize(('took', 'fate'), [(0.001, Fate.KEPT), (1.0, Fate.OTHERWISE)])
def test_a_commitment_that_is_found_too_late_is_not_published_but_its_time_counts(took, fate):
    watch, motion, near = separated()
    sent = []
    for seconds in np.arange(0.01, 0.5, 0.01):
        at = later(motion, seconds, SEPARATED)
        step = step_of(watch, body(at, near), lambda: took, sent.append)
        if step.found is not None:
            break
    assert step.found is not None
    assert step.found.within < 1.0
    assert step.fate is fate
    assert len(sent) == (fate is Fate.KEPT)
    is_next = step.decision.watch.commitments.sent is not watch.commitments.sent
    assert is_next == (fate is Fate.KEPT)
    first = next(following(step, lambda: at, lambda _: None, lambda: 0.0))()
    assert (type(first), first.took) == (events.CommitmentTook, took)


def test_a_commitment_that_cannot_be_published_is_an_error():
    watch, motion, near = separated()
    with pytest.raises(ConnectionError):
        for seconds in np.arange(0.01, 0.5, 0.01):
            at = later(motion, seconds, SEPARATED)
            watch = step_of(watch, body(at, near), lambda: 0.0, unsent).decision.watch


def test_a_body_that_has_waited_too_long_is_said_after_all_else():
    watch, motion = moving()
    at = later(motion, 0.5)
    step = step_of(watch, body(at), lambda: 0.0, unsent)
    assert not list(following(step, lambda: at, lambda _: None, lambda: LONGEST_WAIT))
    waits = iter([2.0 * LONGEST_WAIT])
    (happens,) = following(step, lambda: at, lambda _: None, lambda: next(waits))
    late = happens()
    assert isinstance(late, events.BodyWaited)
    assert late.waited == 2.0 * LONGEST_WAIT


def test_the_last_body_is_looked_at_again_where_the_arm_follows_the_motion_before():
    watch, motion = moving()
    step = step_of(watch, events.Tick(later(motion, 0.5)), lambda: 0.0, unsent)
    due = replace(step, decision=replace(step.decision, is_look_due=True))
    at, look = later(motion, 0.6), Look(FAR, Scene(()), 0.0)
    (happens,) = following(due, lambda: at, lambda _: look, lambda: 0.0)
    event = happens()
    assert (type(event), event.at, event.sight, event.look) == (events.BodyCame, at, None, look)
