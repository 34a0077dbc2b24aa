# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What the monitor of a moving arm does: from what it knows and what happens to what follows.

Each new body is checked against the remaining motion, since the wearer moves too; each tick checks
the inputs, and whether the arm does what it is commanded. Time is a field of events. A command is
published before the next watch counts; after any error the arm stops by the last one that does.

What the monitor may be doing after each event, by what it was doing before:

================  =====================  ==================  =================  ================
event             no motion              monitoring          stopping           holding
================  =====================  ==================  =================  ================
Begin             monitoring             monitoring          monitoring         monitoring
BodyCame          no motion              monitoring,         stopping,          holding
                                         stopping,           no motion,
                                         no motion, holding  holding
BodyWaited        no motion              monitoring,         stopping           holding
                                         stopping
StopFor           no motion              monitoring,         stopping           holding
                                         stopping
StopUnproven      no motion              monitoring          stopping           holding
CommitmentTook    no motion              monitoring          stopping           holding
Tick              no motion              monitoring,         stopping,          holding
                                         stopping,           no motion,
                                         no motion, holding  holding, monitoring
NobodyListens     no motion              monitoring          stopping           holding
Fail              no motion              monitoring,         stopping           holding
                                         stopping
ClockStepped      no motion              monitoring,         stopping           holding
                                         stopping
Hold              no motion              monitoring          stopping           holding
Reset             no motion              monitoring          stopping           holding
Rest              holding                monitoring          holding            holding
StopsTaken        no motion              monitoring          stopping           holding
================  =====================  ==================  =================  ================

A motion that is over needs no stop. One that cannot be published leaves the monitor monitoring,
with that stop pending.
"""

from collections.abc import Callable
from functools import partial
import math
from typing import Any

import numpy as np
from rrth_planner.collision.separation import Blocked
from rrth_planner.execution import commitments as given, event as events, fail_safe_stop as stops
from rrth_planner.execution.command import begin_of, continues, lead_in, led, rest_at
from rrth_planner.execution.decision import Command, Decision, followed_by, Line
from rrth_planner.execution.event import Event, Look, Moment
from rrth_planner.execution.executing_motion import ExecutingMotion, is_same, MAX_DEVIATION
from rrth_planner.execution.expected_wearer import is_expected_free
from rrth_planner.execution.fail_safe_stop import holds, stop_of
from rrth_planner.execution.remaining_motion import (
    escapes_by_continuing,
    is_place_free,
    is_remaining_free,
)
from rrth_planner.execution.separation_status import SeparationStatus
from rrth_planner.execution.tracked_motion import (
    check_command,
    find,
    forget_command,
    is_lost,
    is_over,
    shifted,
    track,
    track_next,
    track_nothing,
    track_previous,
    track_stop,
    track_stop_again,
    tracked_phase,
)
from rrth_planner.execution.watch import (
    doubted,
    entered,
    followed,
    ignored,
    Level,
    MonitorState,
    MOST_IGNORED,
    recorded,
    Watch,
    with_commitments,
    with_tracked,
)
from rrth_planner.model.errors import RequestError
from rrth_planner.model.frozen import changed
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory

# A body that is checked later than this after its arrival causes a stop [s].
LONGEST_WAIT = 0.05
OFF_TRAJECTORY = (
    f'arm is > {MAX_DEVIATION:g} rad from the commanded trajectory: monitoring suspended'
)
# Why the arm is stopped for a body.
IN_THE_WAY = 'the remaining motion is not proven free of the wearer'
SOON_IN_THE_WAY = 'the wearer is about to move into the path of the arm'
NOT_SEPARATE = 'the remaining motion is no longer proven separate from the wearer'
# An arm off its motion may come nearer to the wearer than the margin, but not than this share.
MARGIN_LEFT = 0.5
# With separation it goes on for so long while the wearer is in the way further on [s].
PATIENCE = 0.3
# An arm with sharp stops rests for so long on its way before its motion is planned again [s].
SHARP_GRACE = 0.1
# Why a whole motion is stopped that began beside a body that stands still.
STREAM_BEGAN = 'bodies come as a stream now: from here on motions are proven separate from it'
# So long after the clock was set no motion begins: what was measured before, and came after, is
# too young or too old [s].
SETTLING = 0.5
# Why a motion is given up.
TOO_NEAR = 'the wearer is too near for the motion to continue'
NOT_FOLLOWED = 'the arm is at rest off its motion, and does not follow it'
# An arm that was reported to ignore a motion follows one where that has led it further [rad].
FOLLOWED = 0.02
# By whether the arm follows the last commanded motion.
SWITCHED = {
    False: 'arm ignored the last commanded motion: monitoring the previous one, which it follows',
    True: 'arm follows the last commanded motion again: monitoring it',
}
# Why a planned motion does not begin.
INVALIDATED = ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
IsClear = Callable[[Trajectory], bool]


def decide(watch: Watch, event: Event) -> Decision:
    """
    Return what follows from an event.

    Raises
    ------
    RequestError
        A motion cannot begin.

    """
    return _DECIDED[type(event)](watch, event)


def _begun(watch: Watch, event: events.Begin) -> Decision:
    at, rules = event.at, event.rules
    if event.n_faults != watch.n_faults:
        raise RequestError(
            ErrorCode.FAILURE, f'an error while the motion was planned: {watch.stop_reason}'
        )
    if event.n_stops != watch.n_stops:
        raise RequestError(
            INVALIDATED, f'the arm was stopped while its motion was planned: {watch.stop_reason}'
        )
    if at.steady < watch.settles:
        raise RequestError(
            INVALIDATED,
            f'{watch.unsettled_by} less than {SETTLING:g} s ago: the ages of body and joints are '
            'not known yet',
        )
    if watch.pending is not None:
        raise RequestError(
            ErrorCode.FAILURE, f'a stop of the arm could not be published: {watch.pending.why}'
        )
    before, command = event.planned_from, watch.tracked.command
    if before is not None and (command is None or not is_same(before, command)):
        raise RequestError(
            INVALIDATED, 'the arm was commanded something else while its motion was planned'
        )
    lead = _lead_in(watch, event)
    watch, commanded = _first_commanded(watch, event, lead)
    delay = rules.execution.controller_delay
    watch = changed(
        watch,
        rules=rules,
        goal=event.goal,
        tracked=track(watch.tracked, commanded, at.reading, at.now, delay),
        in_the_way_since=None,
        withheld=None,
        waiting=None,
        is_unstamped=False,
        is_ignored=False,
        is_held=False,
        has_arrived=False,
        n_motions=watch.n_motions + 1,
    )
    watch = entered(watch, MonitorState.MONITORING, '')
    return Decision(watch=watch, command=stops.command_of(watch, commanded))


def _lead_in(watch: Watch, event: events.Begin) -> Trajectory:
    """Return what is commanded from a little before now until a motion begins."""
    planned, joins, command = event.planned, event.joins, watch.tracked.command
    left = planned.start_time - begin_of(event.at.now, event.rules.execution.controller_delay)
    if joins is None or planned.start_time <= event.at.now:
        return rest_at(planned.trajectory, 0.0)
    if command is None and math.isinf(joins):
        return rest_at(planned.trajectory, left)
    if command is None:
        raise RequestError(
            INVALIDATED,
            'what the arm is commanded is not known any more, expected the motion that it was '
            'planned from',
        )
    # The last instants before a rest may still be commanded.
    end = planned.start_time - command.start_time if math.isinf(joins) else joins
    lead = lead_in(command.trajectory, end - left, end)
    if math.isinf(joins) and not continues(lead, planned.trajectory):
        raise RequestError(INVALIDATED, 'the arm is not commanded to rest where its motion begins')
    return lead


def _first_commanded(
    watch: Watch, event: events.Begin, lead: Trajectory
) -> tuple[Watch, ExecutingMotion]:
    """
    Return the first commitment of a motion, to be published; without separation all of it.

    lead: what is commanded before that.
    """
    known = watch.commitments
    if event.rules.execution.separation is None:
        return changed(watch, commitments=given.end(known)), led(lead, event.planned)
    if known.fault:
        raise RequestError(
            ErrorCode.FAILURE,
            f'after an error the planner does not move the arm until ~/reset: {known.fault}',
        )
    if known.body is None:
        raise RequestError(
            ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no body yet, expected one for separation'
        )
    found = given.begin(known, event.planned, event.rules.execution, lead)
    if isinstance(found, Blocked):
        raise RequestError(
            INVALIDATED,
            f'the motion cannot begin: if {found.box} moves, {found.bar} is not proven separate '
            f'from it {found.time:.2f} s after the start',
        )
    assert found.sent is not None
    rate = given.rate_at(found, found.sent.commitment.start_time)
    status = given.status_of(None, rate, False)
    return changed(watch, commitments=found, separation=status), found.sent.motion


def _body_came(watch: Watch, event: events.BodyCame) -> Decision:
    at, separation = event.at, event.at.rules.execution.separation
    known = watch.commitments
    if separation is None and known.body is not None:
        known = changed(known, body=None)
    elif separation is not None and event.sight is not None:
        known = given.observe(known, event.sight.scene, event.sight.measured, separation, at.now)
    watch = with_commitments(watch, known)
    if event.look is None or watch.running is None:
        return Decision(watch=watch)
    return _looked(watch, at, event.look)


def _looked(watch: Watch, at: Moment, look: Look) -> Decision:
    """Stop the arm unless its remaining motion is proven free."""
    found = stops.check_withheld(watch, at)
    checked, phase = _monitored_phase(found.watch, at)
    found = followed_by(found, lambda _: checked)
    if phase is None:
        return found
    return followed_by(found, lambda watch: _checked(watch, at, look, phase))


def _checked(watch: Watch, at: Moment, look: Look, phase: float) -> Decision:
    """Go on, or stop, by whether the motion from a phase on [s] is proven free of the wearer."""
    scene, expected = look.scene, look.expected
    assert watch.running is not None
    planned, planned_phase = _remaining(watch, phase, at.now)
    is_escaping = planned_phase < planned.escape_time
    is_free = holds(watch, is_remaining_free, planned, planned_phase, scene) and (
        is_escaping or _is_arm_free(watch, at, scene)
    )
    # An escape leaves where he is. A commitment ends in a stop, and is not prolonged into him.
    has_stop_ahead = watch.commitments.is_active and not watch.commitments.is_whole
    is_soon_free = (
        is_escaping
        or has_stop_ahead
        or holds(watch, is_expected_free, watch.running, phase, expected)
    )
    why = IN_THE_WAY if is_soon_free else SOON_IN_THE_WAY
    if is_free and is_soon_free:
        # So far the arm keeps clear of where he will be; so must what it is given next.
        is_clear = _always if is_escaping else partial(_is_soon_clear, watch, expected)
        if watch.in_the_way_since is not None:
            watch = changed(watch, in_the_way_since=None)
        found = _extended(watch, at, is_clear)
        found = _without_news(found, events.StopFor(at, NOT_SEPARATE, scene, phase, at.now))
        return changed(found, age=look.age, is_free=True)
    if watch.in_the_way_since is None:
        watch = changed(watch, in_the_way_since=at.now)
    stop = events.StopFor(at, why, scene, phase, at.now)
    if not _may_go_on(watch, at, phase, scene):
        return Decision(watch=watch, age=look.age, next=stop)
    found = _extended(watch, at, partial(_is_clear, watch, scene, expected))
    # The whole rest of the motion has no stop ahead of him.
    if found.watch.commitments.is_whole:
        found = changed(found, next=stop)
    if found.otherwise is not None and found.otherwise.watch.commitments.is_whole:
        found = changed(found, otherwise=changed(found.otherwise, next=stop))
    return changed(found, age=look.age)


def _without_news(found: Decision, stop: events.StopFor) -> Decision:
    """Stop the arm where news of the wearer leave the whole rest of its motion unproven."""
    if found.otherwise is not None:
        # What is published is proven.
        otherwise = _without_news(found.otherwise, stop)
        return found if otherwise is found.otherwise else changed(found, otherwise=otherwise)
    known = given.check_news(found.watch.commitments, stop.at.now)
    if known is found.watch.commitments and not known.has_lost_proof:
        return found
    watch = with_commitments(found.watch, known)
    return changed(found, watch=watch, next=stop if known.has_lost_proof else None)


def _remaining(watch: Watch, phase: float, now: float) -> tuple[ExecutingMotion, float]:
    """Return the motion that the arm is to execute, and the time within it [s]."""
    running, planned = watch.running, watch.commitments.planned
    assert running is not None
    return (
        (running, phase) if planned is None else (planned, given.phase_at(watch.commitments, now))
    )


def _may_go_on(watch: Watch, at: Moment, phase: float, scene: Scene) -> bool:
    """
    Return whether the arm may go on although the wearer is in the way further on.

    With separation it has been given nothing but a stretch that ends in a stop. Where that is free
    of him, a further stretch that is free as well may follow, while he moves on. So it may after
    the whole rest of the motion, which is replaced.
    """
    running, since = watch.running, watch.in_the_way_since
    assert running is not None and since is not None
    planned, planned_phase = _remaining(watch, phase, at.now)
    return (
        watch.commitments.is_active
        and at.now - since < PATIENCE
        and planned_phase >= planned.escape_time
        and holds(watch, is_remaining_free, running, phase, scene)
    )


def _is_arm_free(watch: Watch, at: Moment, scene: Scene) -> bool:
    """Return whether the arm is clear of the wearer where it is, maybe off its motion."""
    left = changed(watch.rules.required, margin=MARGIN_LEFT * watch.rules.required.margin)
    return at.reading is None or is_place_free(at.reading.positions, left, scene)


def _always(_: Trajectory) -> bool:
    return True


def _is_clear(watch: Watch, scene: Scene, expected: Scene, curve: Trajectory) -> bool:
    """Return whether a stretch and its stop are free of the wearer, now and soon."""
    assert watch.running is not None
    motion = changed(watch.running, trajectory=curve, escape_time=0.0)
    is_free = holds(watch, is_remaining_free, motion, 0.0, scene)
    return is_free and _is_soon_clear(watch, expected, curve)


def _is_soon_clear(watch: Watch, expected: Scene, curve: Trajectory) -> bool:
    """Return whether a stretch and all its stop are free of where the wearer will be soon."""
    if not expected.boxes:
        return True
    assert watch.running is not None
    motion = changed(watch.running, trajectory=curve, target_distance=0.0, escape_time=0.0)
    return holds(watch, is_remaining_free, motion, 0.0, expected)


def _extended(watch: Watch, at: Moment, is_clear: IsClear = _always) -> Decision:
    """Command the commitment that leads further than that of the running motion."""
    if not watch.commitments.is_active or watch.pending is not None:
        return Decision(watch=watch)
    planned = watch.commitments.planned
    found = given.extend(watch.commitments, at.now, at.reading, is_clear)
    # As long as nothing is published.
    same = with_commitments(watch, found.commitments)
    if found.has_changed and found.commitments.sent is not None:
        same = changed(same, tracked=track_next(same.tracked, found.commitments.sent.motion))
    if found.next is None:
        if found.status is not None:
            same = changed(same, separation=found.status)
        decision = Decision(watch=same)
    else:
        assert found.next.sent is not None and found.status is not None
        motion = found.next.sent.motion
        longer = changed(
            same,
            commitments=found.next,
            tracked=track_next(watch.tracked, motion),
            separation=found.status,
        )
        command = Command(motion, motion.start_time, watch.rules, found.commitments.within)
        # A late one is not published: the arm is on its way to rest by then, and goes on from
        # there.
        decision = Decision(watch=longer, command=command, otherwise=Decision(watch=same))
    return decision if found.commitments.planned is planned else _switched(decision, False)


def _switched(decision: Decision, is_latest: bool) -> Decision:
    """Say that the arm follows the motion before the last one, or the last one again."""
    watch = decision.watch
    level = Level.OK if is_latest else Level.WARN
    watch = entered(watch, MonitorState.MONITORING, SWITCHED[is_latest], level)
    if not is_latest:
        watch = ignored(watch, 'arm ignored the last commanded motion')
    return changed(
        decision,
        watch=changed(watch, is_ignored=not is_latest),
        otherwise=decision.otherwise and _switched(decision.otherwise, is_latest),
        lines=(*decision.lines, Line(Level.ERROR, SWITCHED[is_latest])),
    )


def _body_waited(watch: Watch, event: events.BodyWaited) -> Decision:
    # The ages of parts count where motions are proven separate.
    if not watch.is_monitoring or watch.commitments.is_active:
        return Decision(watch=watch)
    why = (
        f'a body was checked {event.waited:.3f} s after its arrival, expected at most '
        f'{LONGEST_WAIT:g} s'
    )
    return _failed(watch, events.Fail(event.at, why, is_replanned=True, is_fault=False))


def _stopped(watch: Watch, event: events.StopFor) -> Decision:
    at, running = event.at, watch.running
    # The check took time.
    phase = event.phase + at.now - event.then
    if running is None or not watch.is_monitoring or phase >= running.trajectory.duration:
        return Decision(watch=watch)
    stop = stop_of(watch, at, running, phase)
    is_safe = holds(watch, is_remaining_free, stop, 0.0, event.scene)
    if is_safe or not holds(
        watch, escapes_by_continuing, *_remaining(watch, phase, at.now), event.scene
    ):
        return stops.stopped_for_body(watch, at, stop, is_safe, event.scene, event.why)
    sentence = f'{event.why}, but the arm escapes, which a stop would prevent: motion continues'
    is_said = watch.sentence == sentence
    lines = () if is_said else (Line(Level.ERROR, sentence),)
    return followed_by(
        _extended(watch, at),
        lambda watch: Decision(
            watch=entered(watch, MonitorState.MONITORING, sentence), lines=lines
        ),
    )


def _ticked(watch: Watch, event: events.Tick) -> Decision:
    at = event.at
    tracked = check_command(watch.tracked, at.reading, at.now, at.steady)
    found = Decision(watch=with_tracked(watch, tracked))
    if watch.state is not MonitorState.IDLE:
        for step in (stops.repeated_stop, _checked_previous, _checked_ignored):
            found = followed_by(found, partial(_at, step, at))
        found = followed_by(found, lambda watch: _monitored_phase(watch, at)[0])
    if found.watch.pending is not None and found.command is None:
        found = followed_by(found, lambda watch: stops.stop_pending(watch, at))
    return found


def _at(step: Callable[[Watch, Moment], Decision], at: Moment, watch: Watch) -> Decision:
    return step(watch, at)


def _checked_previous(watch: Watch, at: Moment) -> Decision:
    """Monitor the previous motion where the arm follows that: its controller rejected one."""
    if (
        watch.state not in (MonitorState.MONITORING, MonitorState.STOPPING)
        or watch.commitments.is_active
    ):
        return Decision(watch=watch)
    tracked = track_previous(watch.tracked, at.reading)
    if tracked is watch.tracked:
        return Decision(watch=watch)
    found = Decision(watch=changed(watch, tracked=tracked), is_look_due=True)
    return _switched(found, tracked.is_latest)


def _checked_ignored(watch: Watch, at: Moment) -> Decision:
    """Give up a motion that the arm ignores, wherever it rests, also far from it."""
    reading, running = at.reading, watch.running
    if not watch.is_monitoring or running is None:
        return Decision(watch=watch)
    rules = watch.rules.execution
    known, is_ignored = given.note_rest(watch.commitments, reading, running, rules)
    watch = with_commitments(watch, known)
    if not is_ignored:
        return Decision(watch=_followed(watch, at))
    has_moved = given.has_moved(known, reading, running)
    if not known.is_active:
        # It was given all of it, and may be late: it is monitored as long as that takes.
        return Decision(
            watch=watch if watch.is_ignored else ignored(watch, NOT_FOLLOWED, has_moved)
        )
    command = None
    if known.is_whole:
        # One that is only late would execute all of it.
        stop = stop_of(watch, at, running, 0.0)
        command = stops.command_of(watch, stop)
        watch = changed(watch, tracked=track_stop(watch.tracked, stop))
    watch = ignored(watch, NOT_FOLLOWED, has_moved)
    found = _given_up(watch, at, NOT_FOLLOWED, watch.n_ignored < MOST_IGNORED)
    watch = _ended(found.watch)
    watch = with_tracked(watch, forget_command(watch.tracked))
    return changed(found, watch=watch, command=command)


def _followed(watch: Watch, at: Moment) -> Watch:
    """Withdraw what was said of an arm that follows its motion now."""
    running = watch.running
    # With separation one that it has ignored is not followed any more.
    is_other = not watch.tracked.is_latest or (watch.commitments.is_active and watch.is_ignored)
    if (
        not watch.is_doubted
        or running is None
        or is_other
        or not given.has_moved(watch.commitments, at.reading, running, FOLLOWED)
        or tracked_phase(watch.tracked, at.reading, at.now) is None
    ):
        return watch
    return followed(watch)


def _monitored_phase(watch: Watch, at: Moment) -> tuple[Decision, float | None]:
    """Return the time within a monitored motion [s]; stop the arm where an input is stale."""
    found, phase = _phase(watch, at)
    watch = found.watch
    if not watch.is_monitoring:
        return found, None
    # Also of an arm that is off its motion.
    has_stream = watch.rules.stands_still and not at.rules.stands_still
    why = STREAM_BEGAN if has_stream else at.overdue
    if not why:
        return found, phase
    fail = events.Fail(at, why, is_replanned=True, is_fault=False)
    return followed_by(found, lambda watch: _failed(watch, fail)), None


def _phase(watch: Watch, at: Moment) -> tuple[Decision, float | None]:
    """Return the time within the running motion; None where it is over or unknown [s]."""
    known, is_monitoring = watch.commitments, watch.is_monitoring
    is_waiting = is_monitoring and given.waits_for_reset(known, at.now)
    # An arm that stops sharply goes on from rest only: another way is looked for sooner.
    is_stuck = (
        is_monitoring
        and watch.rules.replan
        and given.stops_sharply(known)
        and is_over(watch.tracked, at.reading, at.now, SHARP_GRACE)
        and not given.is_arrived(known, at.now)
    )
    if (is_stuck or is_over(watch.tracked, at.reading, at.now)) and not is_waiting:
        found = Decision(watch=watch)
        if is_monitoring and not given.is_arrived(known, at.now):
            found = _given_up(watch, at, TOO_NEAR)
        elif is_monitoring:
            watch = _ignored_to_its_end(watch, at)
            found = Decision(watch=watch)
            if watch.is_ignored:
                is_replanned = known.is_active and watch.n_ignored < MOST_IGNORED
                found = _given_up(watch, at, NOT_FOLLOWED, is_replanned)
        return changed(found, watch=_ended(found.watch)), None
    phase = tracked_phase(watch.tracked, at.reading, at.now)
    if phase is not None:
        watch = with_tracked(watch, find(watch.tracked, at.now))
        if watch.sentence == OFF_TRAJECTORY:
            is_stopping = watch.state is MonitorState.STOPPING
            watch = entered(watch, watch.state, watch.stop_reason if is_stopping else '')
    elif is_lost(watch.tracked, at.now) and watch.sentence != OFF_TRAJECTORY:
        watch = entered(watch, watch.state, OFF_TRAJECTORY)
        return Decision(watch=watch, lines=(Line(Level.ERROR, OFF_TRAJECTORY),)), None
    return Decision(watch=watch), phase


def _ignored_to_its_end(watch: Watch, at: Moment) -> Watch:
    """Take note of whether the arm has not followed the last motion, which is over."""
    reading, running = at.reading, watch.running
    if reading is None or running is None or watch.is_ignored or watch.commitments.is_active:
        return watch
    gap = np.abs(reading.positions - running.trajectory.positions[-1]).max()
    # An older reading says nothing of that.
    is_new = reading.taken > running.start_time + running.trajectory.duration
    if is_new and gap > MAX_DEVIATION:
        return ignored(watch, NOT_FOLLOWED, has_moved=True)
    return watch


def _given_up(watch: Watch, at: Moment, why: str, is_replanned: bool = True) -> Decision:
    """Have a motion planned again that came to rest on its way, and could not go on."""
    running = watch.running
    assert running is not None
    sentence = f'{why}: motion given up'
    state = MonitorState.STOPPING if is_replanned else MonitorState.HOLDING
    watch = entered(changed(watch, stop_reason=why, n_stops=watch.n_stops + 1), state, sentence)
    watch = stops.failed(watch, why, is_fault=False)
    watch = recorded(watch, running.trajectory, None, at.rules, is_replanned)
    return Decision(watch=watch, lines=(Line(Level.WARN, sentence),))


def _ended(watch: Watch) -> Watch:
    """Return it without a motion that has ended, or was given up."""
    watch = changed(
        watch,
        tracked=track_nothing(watch.tracked),
        commitments=given.end(watch.commitments),
        pending=None,
    )
    if watch.is_monitoring:
        watch = changed(followed(watch), has_arrived=True, is_ignored=watch.is_ignored)
    if watch.state is MonitorState.STOPPING and watch.is_held:
        return entered(watch, MonitorState.HOLDING, watch.sentence, watch.stop_level)
    if watch.state is MonitorState.HOLDING:
        return watch
    return entered(watch, MonitorState.IDLE, '')


def _failed(watch: Watch, event: events.Fail) -> Decision:
    watch = stops.pending(watch, event)
    if not watch.is_monitoring or watch.pending is None:
        return Decision(watch=watch)
    return stops.stop_pending(watch, event.at)


def _clock_stepped(watch: Watch, event: events.ClockStepped) -> Decision:
    """
    Stop the arm, with all times by the new clock.

    Where the arm is, and how old things are, does not change by a step.
    """
    at, step = event.at, event.step
    since = watch.in_the_way_since
    watch = changed(
        watch,
        tracked=shifted(watch.tracked, step),
        commitments=given.shift(watch.commitments, step),
        in_the_way_since=None if since is None else since + step,
        withheld=watch.withheld and watch.withheld.shifted(step),
        settles=at.steady + SETTLING,
        unsettled_by=event.sentence,
        # Nor is what is planned meanwhile published.
        stop_reason=event.sentence,
        n_stops=watch.n_stops + 1,
        is_unstamped=True,
    )
    found = Decision(watch=watch, lines=(Line(Level.ERROR, event.sentence),))
    running = watch.running
    if running is not None and watch.state is MonitorState.STOPPING and watch.is_active(at.now):
        # A controller by the same clock has jumped along its stop.
        phase = stops.phase_or_elapsed(watch, at, running)
        if phase is not None and phase < running.trajectory.duration:
            stop = stop_of(watch, at, running, phase)
            watch = changed(watch, tracked=track_stop_again(watch.tracked, stop))
            command = Command(stop, 0.0, watch.rules)
            return changed(found, watch=watch, command=command, otherwise=found)
    fail = events.Fail(at, event.sentence, is_replanned=True, is_fault=False)
    return followed_by(found, lambda watch: _failed(watch, fail))


def _reset(watch: Watch, _: events.Reset) -> Decision:
    fault, waiting = watch.commitments.fault, watch.waiting
    watch = changed(watch, commitments=given.reset(watch.commitments), waiting=None)
    if waiting is not None and waiting.n_motions == watch.n_motions:
        # A motion that was stopped, and waits, goes on.
        watch = changed(watch, stops=(*watch.stops, waiting), is_held=False)
    return Decision(watch=changed(watch, separation=SeparationStatus()) if fault else watch)


def _rested(watch: Watch, event: events.Rest) -> Decision:
    if watch.is_monitoring:
        # Another motion was commanded meanwhile.
        return Decision(watch=watch)
    sentence = f'arm holds its position: {event.why}'
    watch = entered(watch, MonitorState.HOLDING, sentence)
    return Decision(watch=watch, lines=(Line(Level.WARN, sentence),))


def _held(watch: Watch, event: events.Hold) -> Decision:
    known = given.hold(watch.commitments, event.until)
    return Decision(watch=with_commitments(watch, known))


def _unheard(watch: Watch, _: events.NobodyListens) -> Decision:
    if watch.is_doubted:
        return Decision(watch=watch)
    why = f'nobody is subscribed to {watch.motion_topic}'
    return Decision(watch=doubted(watch, Level.WARN, why))


def _took(watch: Watch, event: events.CommitmentTook) -> Decision:
    known = given.note_took(watch.commitments, event.took)
    return Decision(watch=with_commitments(watch, known))


def _taken(watch: Watch, _: events.StopsTaken) -> Decision:
    return Decision(watch=changed(watch, stops=()))


_DECIDED: dict[type[Event], Callable[[Watch, Any], Decision]] = {
    events.Begin: _begun,
    events.BodyCame: _body_came,
    events.BodyWaited: _body_waited,
    events.StopFor: _stopped,
    events.StopUnproven: stops.said_unproven,
    events.CommitmentTook: _took,
    events.Tick: _ticked,
    events.NobodyListens: _unheard,
    events.Fail: _failed,
    events.ClockStepped: _clock_stepped,
    events.Hold: _held,
    events.Reset: _reset,
    events.Rest: _rested,
    events.StopsTaken: _taken,
}
