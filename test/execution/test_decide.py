# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The table of what the monitor may be doing after each event, cell by cell."""

from dataclasses import is_dataclass, replace
import pickle
import re

from decisions import (
    ARM,
    at_later,
    BEGIN,
    begun,
    body,
    DELAY,
    GOAL,
    hand,
    idle,
    moment,
    on,
    RULES,
    SEPARATION,
    turn,
)
import numpy as np
import pytest
from rrth_planner.collision.reference_checker import bars
from rrth_planner.execution import decide as module, event as events, fail_safe_stop
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decide import decide, PATIENCE, SOON_IN_THE_WAY
from rrth_planner.execution.watch import MonitorState, PendingStop, Watch
from rrth_planner.model.errors import RequestError
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory
from same_values import differences
from worlds import FOLDED

MOTION = turn()
END = BEGIN + MOTION.duration
# Long after the end of a motion; and within it [s].
LATE, WITHIN = END + 2.0, BEGIN + 0.5
ELSEWHERE = MOTION.positions[-1] + 0.3
STALE = 'the last good message on joints is 1.000 s old'


def table():
    """Return the table of the docstring: {event: {state: set of states}}."""
    lines = [line for line in module.__doc__.splitlines() if line.strip()]
    rules = [k for k, line in enumerate(lines) if line.startswith('====')]
    starts = [m.start() for m in re.finditer('=+', lines[rules[0]])]
    spans = [slice(a, b) for a, b in zip(starts, [*starts[1:], None], strict=True)]
    heads = [lines[rules[0] + 1][span].strip() for span in spans]
    found, name = {}, ''
    for line in lines[rules[1] + 1 : rules[2]]:
        cells = [line[span].strip() for span in spans]
        name = cells[0] or name
        row = found.setdefault(name, {head: [] for head in heads[1:]})
        for head, cell in zip(heads[1:], cells[1:], strict=True):
            row[head] += [state.strip() for state in cell.split(',') if state.strip()]
    return {name: {k: set(v) for k, v in row.items()} for name, row in found.items()}


def monitoring():
    """Return a watch of a motion, with the motion."""
    return begun(idle(), MOTION, moment(BEGIN, MOTION.positions[0]))


def stopping(is_replanned=True, now=WITHIN):
    """Return a watch of a stop."""
    watch, motion = monitoring()
    fail = events.Fail(on(motion, now), 'of the test', is_replanned, not is_replanned)
    found = decide(watch, fail)
    return found.watch, found.command.motion


def holding():
    """Return a watch of an arm that stays where its stop ended."""
    watch, stop = stopping(is_replanned=False)
    return decide(watch, events.Tick(on(stop, LATE))).watch


def stopped_but_on_the_motion_before():
    """Return a watch of a stop of a second motion, and that the arm executes the first one."""
    watch, first = monitoring()
    second = replace(first, trajectory=MOTION, start_time=WITHIN)
    away = replace(MOTION, positions=MOTION.positions[::-1])
    tracked = replace(watch.tracked, motion=replace(second, trajectory=away), previous=first)
    watch = replace(watch, tracked=tracked)
    watch = decide(watch, events.Fail(on(first, WITHIN + 0.01), 'of the test', True, False)).watch
    return watch, events.Tick(on(first, WITHIN + 0.3))


WATCHES = {
    'no motion': [(idle(), None)],
    'monitoring': [monitoring()],
    'stopping': [stopping(), stopping(is_replanned=False)],
    'holding': [(holding(), None)],
}


def moments(motion, state):
    """Return when something may happen: within a motion, with stale inputs, after it."""
    if motion is None:
        return [moment(LATE, MOTION.positions[-1])]
    found = [on(motion, motion.start_time + 0.1), on(motion, LATE)]
    if state == 'monitoring':
        found += [on(motion, WITHIN, overdue=STALE), moment(LATE, ELSEWHERE)]
    return found


def happening(name, state):
    """Return (watch, event) for each way in which an event may find a state."""
    kind = getattr(events, name)
    for watch, motion in WATCHES[state]:
        for at in moments(motion, state):
            near = hand(MOTION, at.now - BEGIN + 0.6) if at.now < END else hand(MOTION, 0.5)
            words = {
                'Begin': lambda at=at, watch=watch: (
                    replace(monitoring()[1], start_time=at.now, trajectory=MOTION),
                    GOAL,
                    RULES,
                    *(None, None, watch.n_stops, watch.n_faults),
                ),
                'BodyCame': lambda at=at: (body(at).sight, body(at).look),
                'BodyWaited': lambda: (0.08,),
                'StopFor': lambda at=at, near=near: ('of the test', near, WITHIN, at.now),
                'StopUnproven': lambda motion=motion, near=near: (
                    motion or monitoring()[1],
                    near,
                ),
                'CommitmentTook': lambda: (0.01,),
                'Fail': lambda: ('of the test', False, True),
                'ClockStepped': lambda: (0.5, 'the clock was set forward'),
                'Hold': lambda at=at: (at.now + 1.0,),
                'Rest': lambda: ('of the test',),
            }.get(name, lambda: ())()
            if name == 'StopFor':
                phases = (0.5, MOTION.duration)
                events_ = [kind(at, words[0], words[1], phase, words[3]) for phase in phases]
            else:
                events_ = [kind(at, *words)]
            for event in events_:
                yield watch, event
    if name == 'Tick' and state == 'stopping':
        yield stopped_but_on_the_motion_before()
    if name == 'BodyWaited' and state == 'monitoring':
        watch, motion = monitoring()
        known = replace(watch.commitments, sent='a commitment')
        yield replace(watch, commitments=known), kind(on(motion, WITHIN), 0.08)


CELLS = [(name, state) for name, row in table().items() for state in row]


def test_the_table_has_all_events_and_states():
    kinds = {kind.__name__ for kind in events.Event.__subclasses__()}
    assert set(table()) == kinds
    assert all(set(row) == {s.value for s in MonitorState} for row in table().values())


@pytest.mark.parametrize(('name', 'state'), CELLS)
def test_a_cell_of_the_table_is_what_happens(name, state):
    found = set()
    for watch, event in happening(name, state):
        assert watch.state.value == state
        before = pickle.dumps(watch)
        decision = decide(watch, event)
        # The former watch counts where nothing is published.
        assert not list(differences(pickle.loads(before), watch))
        found.add(decision.watch.state.value)
        is_moving = decision.command is not None and name not in ('Begin', 'BodyCame')
        if is_moving:
            motion = decision.command.motion.trajectory
            assert not motion.velocities[-1].any()
    assert found == table()[name][state]


def test_a_stop_that_is_not_published_stays_pending_and_is_commanded_again():
    watch, motion = monitoring()
    found = decide(watch, events.Fail(on(motion, WITHIN), 'of the test', True, False))
    assert found.watch.pending is None
    kept = found.otherwise.watch
    assert kept.pending == PendingStop('of the test', WITHIN, True)
    assert kept.state is MonitorState.MONITORING
    again = decide(kept, events.Tick(on(motion, WITHIN + 0.02)))
    assert again.is_stop
    assert again.watch.state is MonitorState.STOPPING
    assert not again.command.motion.trajectory.velocities[-1].any()


def test_a_wearer_in_the_way_stops_the_arm_by_an_event_with_a_time_of_its_own():
    watch, motion = monitoring()
    at = on(motion, WITHIN)
    found = decide(watch, body(at, hand(MOTION, 1.1)))
    assert found.command is None
    stop = decide(found.watch, at_later(found.next, WITHIN + 0.004))
    assert stop.is_stop
    # It begins with what is commanded when it is published, not when the body came.
    assert stop.command.motion.start_time <= WITHIN + 0.004
    q = stop.command.motion.trajectory.positions[0]
    phase = stop.command.motion.start_time - motion.start_time
    assert np.abs(q - on(motion, BEGIN + phase).reading.positions).max() < 1e-6


@pytest.mark.parametrize('name', sorted(table()))
def test_the_same_watch_and_event_give_the_same_decision(name):
    for state in WATCHES:
        for watch, event in happening(name, state):
            one, other = decide(watch, event), decide(watch, event)
            assert one.watch.state is other.watch.state
            assert one.lines == other.lines
            if one.command is not None:
                for first, second in zip(
                    one.command.motion.trajectory.states,
                    other.command.motion.trajectory.states,
                    strict=True,
                ):
                    assert (first == second).all()
                assert one.command.begin == other.command.begin


def test_all_that_the_monitor_knows_and_hears_is_frozen():
    kinds = [Watch, events.Moment, *events.Event.__subclasses__(), events.Sight, events.Look]
    for kind in kinds:
        assert is_dataclass(kind)
        assert kind.__dataclass_params__.frozen


def test_a_stop_is_commanded_though_what_is_said_of_it_fails(monkeypatch):
    watch, motion = monitoring()
    monkeypatch.setattr(fail_safe_stop, 'recorded', lambda *_, **__: 1 / 0)
    at = on(motion, WITHIN)
    for event in (
        events.Fail(at, 'of the test', True, False),
        events.StopFor(at, 'of the test', hand(MOTION, 1.1), 0.5, WITHIN),
    ):
        found = decide(watch, event)
        assert found.is_stop
        assert not found.command.motion.trajectory.velocities[-1].any()
        assert found.watch.state is MonitorState.STOPPING
        assert 'ZeroDivisionError' in found.lines[-1].text


@pytest.mark.parametrize('is_separated', [False, True])
def test_for_where_the_wearer_may_be_soon_only_a_motion_without_a_stop_ahead_is_stopped(
    is_separated,
):
    rules = RULES
    if is_separated:
        rules = replace(RULES, execution=ExecutionRules(SEPARATION, DELAY, False))
    still = np.zeros((2, ARM.dof))
    swing = Trajectory(
        times=[0.0, 1.5],
        positions=[FOLDED, FOLDED + [0.9, 0.0, 0.0, 0.0]],
        velocities=still,
        accelerations=still,
    )
    at = moment(BEGIN, FOLDED, rules=rules)
    # Near enough for a commitment that is not the whole motion.
    tip = bars(ARM, swing.positions[:1], 0.0)[0, -2, 1]
    near = Scene((Box('hand', tip - [0.4, 0.4, 0.0], [0.05] * 3, np.eye(3)),))
    watch = decide(idle(rules), body(at, near)).watch
    watch, given = begun(watch, swing, at, rules)
    assert watch.commitments.is_active == is_separated
    assert not (is_separated and watch.commitments.is_whole)
    # For longer than it may go on for although he is in the way.
    watch = replace(watch, in_the_way_since=BEGIN - 2.0 * PATIENCE)
    now = BEGIN + 0.05
    found = decide(watch, body(on(given, now, rules), near, hand(swing, 0.15)))
    if is_separated:
        assert found.next is None
        return
    assert isinstance(found.next, events.StopFor)
    assert found.next.why == SOON_IN_THE_WAY


@pytest.mark.parametrize('is_fault', [True, False])
def test_an_error_at_rest_counts_for_what_is_planned_meanwhile(is_fault):
    event = events.Fail(moment(LATE, MOTION.positions[-1]), 'of the test', False, is_fault)
    found = decide(idle(), event).watch
    assert found.n_faults == is_fault
    assert found.stop_reason == ('of the test' if is_fault else '')
    assert found.state is MonitorState.IDLE


@pytest.mark.parametrize(
    ('counts', 'code', 'sentence'),
    [
        ((1, 0), ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE, 'was stopped while'),
        ((0, 1), ErrorCode.FAILURE, 'an error while the motion was planned'),
    ],
)
def test_what_was_planned_before_a_stop_or_a_fault_does_not_begin_after_it(counts, code, sentence):
    watch, motion = monitoring()
    stops, faults = watch.n_stops - counts[0], watch.n_faults - counts[1]
    planned = replace(motion, start_time=WITHIN)
    begin = events.Begin(on(motion, WITHIN), planned, GOAL, RULES, None, None, stops, faults)
    with pytest.raises(RequestError, match=sentence) as caught:
        decide(watch, begin)
    assert caught.value.code is code


def test_no_motion_begins_while_a_stop_is_to_be_published():
    watch, motion = monitoring()
    at = on(motion, WITHIN)
    kept = decide(watch, events.Fail(at, 'of the test', True, False)).otherwise.watch
    planned = replace(motion, start_time=WITHIN)
    begin = events.Begin(at, planned, GOAL, RULES, None, None, kept.n_stops, kept.n_faults)
    with pytest.raises(RequestError, match='could not be published: of the test'):
        decide(kept, begin)
