# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The stop of what the arm executes: which one, whether it is better withheld, what is said."""

from collections.abc import Callable
from contextlib import suppress
import traceback

from rrth_planner.collision.certificate import least_clearance
from rrth_planner.collision.world import world_of
from rrth_planner.execution import commitments as given
from rrth_planner.execution.command import stop_along
from rrth_planner.execution.decision import Command, Decision, Line
from rrth_planner.execution.event import Fail, Moment, StopUnproven
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.separation_status import SeparationState, SeparationStatus
from rrth_planner.execution.tracked_motion import (
    commands,
    missed_stop,
    track_stop,
    track_stop_again,
    tracked_phase,
)
from rrth_planner.execution.watch import (
    doubted,
    entered,
    Level,
    MonitorState,
    PendingStop,
    recorded,
    Watch,
    with_tracked,
)
from rrth_planner.model.frozen import changed
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import part_of

NOT_STOPPED = 'arm did not follow the commanded stop'
STOPPED_AGAIN = 'arm did not follow the commanded stop: stop published again'


def stop_of(watch: Watch, at: Moment, running: ExecutingMotion, phase: float) -> ExecutingMotion:
    """
    Return the fail-safe stop of a motion.

    What is commanded counts, not where an arm that lags behind is; unless it executes the motion
    more slowly than commanded: then it stops from its phase [s].
    """
    if watch.commitments.is_active or commands(watch.tracked, running, at.reading):
        phase = at.now - running.start_time
    rules = watch.rules
    delay, is_on_reception = rules.execution.controller_delay, watch.is_unstamped
    return stop_along(running, phase, at.now, rules.stop_limits, delay, is_on_reception)


def command_of(watch: Watch, motion: ExecutingMotion) -> Command:
    """Return what has a motion published."""
    return Command(motion, motion.start_time, watch.rules)


def stopped(
    watch: Watch, at: Moment, stop: ExecutingMotion, why: str
) -> tuple[Decision, ExecutingMotion]:
    """
    Command a stop; return also what leads the arm to rest.

    With separation a stop that is not proven separate is not published, as long as the
    commitment that the arm executes is, and comes to rest.
    """
    running = watch.running
    is_withheld, lines = (
        (False, ()) if running is None else _is_withheld(watch, stop, running, at.now)
    )
    if is_withheld and running is not None:
        watch, command = changed(watch, withheld=running), None
        since = max(0.0, at.now - running.start_time)
        if since < running.trajectory.duration:
            left = part_of(running.trajectory, since, running.trajectory.duration)
            stop = changed(running, trajectory=left, start_time=at.now)
    else:
        command = command_of(watch, stop)
        if watch.is_unstamped:
            command = changed(command, begin=0.0)
        watch = changed(watch, tracked=track_stop(watch.tracked, stop), is_unstamped=False)
    n_stops = watch.n_stops + 1
    watch = changed(
        watch, state=MonitorState.STOPPING, stop_reason=why, pending=None, n_stops=n_stops
    )
    return Decision(watch=watch, command=command, lines=lines, is_stop=True), stop


def stopped_for_body(
    watch: Watch, at: Moment, stop: ExecutingMotion, is_safe: bool, scene: Scene, why: str
) -> Decision:
    """Command a stop before the wearer; is_safe: whether it is proven free of him."""
    found, stop = stopped(watch, at, stop, why)
    return _said(found, lambda: _said_for_body(found, at, stop, is_safe, scene, why))


def _said(found: Decision, say: Callable[[], Decision]) -> Decision:
    """Return a stop with what is said of it; an error in that does not keep it back."""
    try:
        return say()
    except Exception:
        return changed(found, lines=(*found.lines, Line(Level.ERROR, traceback.format_exc())))


def _said_for_body(
    found: Decision, at: Moment, stop: ExecutingMotion, is_safe: bool, scene: Scene, why: str
) -> Decision:
    watch = changed(found.watch, stop_level=Level.WARN)
    sentence = _sentence(watch, at, stop)
    watch = entered(watch, MonitorState.STOPPING, sentence, Level.WARN)
    proven_free_of = scene if is_safe else None
    watch = recorded(watch, stop.trajectory, proven_free_of, at.rules, is_replanned=True)
    watch = failed(watch, why, is_fault=False)
    if not is_safe:
        # How near it comes takes long to find.
        return changed(found, watch=watch, next=StopUnproven(at, stop, scene))
    line = Line(Level.WARN, sentence, is_timed=True)
    return changed(found, watch=watch, lines=(*found.lines, line))


def said_unproven(watch: Watch, event: StopUnproven) -> Decision:
    """Say how near a commanded stop comes that is not proven free."""
    world = world_of(changed(watch.rules.required, margin=0.0), event.scene)
    clearance = least_clearance(event.stop.trajectory, world)
    sentence = (
        f'{watch.sentence}; the stop is not proven free either, least clearance {clearance:.4f} m'
    )
    watch = entered(watch, watch.state, sentence, watch.level)
    return Decision(watch=watch, lines=(Line(Level.ERROR, sentence, is_timed=True),))


def pending(watch: Watch, event: Fail) -> Watch:
    """Return it with a stop to be published, if a motion is monitored; this never fails."""
    why, is_replanned = event.why, event.is_replanned
    # Also at rest: what is planned meanwhile was planned with what failed.
    watch = changed(watch, n_faults=watch.n_faults + event.is_fault)
    if watch.running is None:
        return changed(watch, stop_reason=why) if event.is_fault else watch
    if watch.is_monitoring:
        # What is not to be planned again does not become so by what fails later.
        is_replanned = is_replanned and (watch.pending is None or watch.pending.is_replanned)
        # To brake is no failure.
        level = Level.WARN if event.is_replanned else Level.OK
        level = Level.ERROR if event.is_fault else level
        stop = PendingStop(why, event.at.steady, is_replanned)
        watch = changed(watch, pending=stop, stop_level=level)
        # An error in what is said must not keep the arm from being stopped.
        with suppress(Exception):
            watch = failed(watch, why, event.is_fault)
    elif event.is_fault:
        # The arm stops already; what is planned for after that does not begin.
        watch = changed(watch, stop_reason=why, n_stops=watch.n_stops + 1)
        watch = entered(watch, watch.state, why, Level.ERROR)
        if watch.running is not None and (not watch.stops or watch.stops[-1].is_replanned):
            rest = watch.running.trajectory
            watch = recorded(watch, rest, None, event.at.rules, is_replanned=False)
        with suppress(Exception):
            watch = failed(watch, why, is_fault=True)
    return watch


def stop_pending(watch: Watch, at: Moment) -> Decision:
    """Command the pending stop; after any error in that it stays pending."""
    try:
        found = _pending_stopped(watch, at)
    except Exception:
        return Decision(watch=watch, lines=(Line(Level.ERROR, traceback.format_exc()),))
    return changed(found, otherwise=Decision(watch=watch))


def _pending_stopped(watch: Watch, at: Moment) -> Decision:
    running, stop = watch.running, watch.pending
    if running is None or stop is None:
        return Decision(watch=changed(watch, pending=None))
    phase = phase_or_elapsed(watch, at, running)
    if phase is None:
        if not watch.commitments.is_active:
            return Decision(watch=watch)
        phase = at.now - running.start_time
    if phase >= running.trajectory.duration:
        # The motion has ended.
        return Decision(watch=changed(watch, pending=None))
    found, motion = stopped(watch, at, stop_of(watch, at, running, phase), stop.why)
    return _said(found, lambda: _said_of_pending(found, at, motion, stop.is_replanned))


def _said_of_pending(
    found: Decision, at: Moment, motion: ExecutingMotion, is_replanned: bool
) -> Decision:
    sentence = _sentence(found.watch, at, motion)
    watch = entered(found.watch, MonitorState.STOPPING, sentence, found.watch.stop_level)
    watch = recorded(watch, motion.trajectory, None, at.rules, is_replanned)
    return changed(found, watch=watch, lines=(*found.lines, Line(Level.WARN, sentence)))


def phase_or_elapsed(watch: Watch, at: Moment, running: ExecutingMotion) -> float | None:
    """Return the time within a motion, even after an error; None where the arm is off it."""
    with suppress(Exception):
        return tracked_phase(watch.tracked, at.reading, at.now)
    # The joint states may be what is wrong: then the commanded state counts.
    return at.now - running.start_time


def repeated_stop(watch: Watch, at: Moment) -> Decision:
    """Command the stop again where the arm does not execute it."""
    before = watch.tracked.stopped
    tracked, phase = missed_stop(watch.tracked, at.reading, at.now)
    watch = with_tracked(watch, tracked)
    if before is None or phase is None:
        return Decision(watch=watch)
    stop = stop_of(watch, at, before, phase)
    is_withheld, lines = _is_withheld(watch, stop, before, at.now)
    if is_withheld:
        return Decision(watch=watch, lines=lines)
    line = Line(Level.ERROR, STOPPED_AGAIN)
    watch = changed(watch, tracked=track_stop_again(watch.tracked, stop))
    return Decision(
        watch=doubted(watch, Level.ERROR, NOT_STOPPED),
        command=command_of(watch, stop),
        lines=(*lines, line),
    )


def check_withheld(watch: Watch, at: Moment) -> Decision:
    """Command a stop after all where that is proven now, or the commitment not any more."""
    motion = watch.withheld
    if motion is None or watch.state is not MonitorState.STOPPING:
        return Decision(watch=watch)
    if at.now >= motion.start_time + motion.trajectory.duration:
        return Decision(watch=changed(watch, withheld=None))
    stop = stop_of(watch, at, motion, 0.0)
    is_proven = False
    lines: tuple[Line, ...] = ()
    # Other commitments end in a stop of their own.
    if watch.commitments.is_whole:
        is_proven, lines = _is_separate(watch, stop, at.now)
    if not is_proven:
        is_kept, more = _is_separate(watch, motion, at.now)
        lines = (*lines, *more)
        if is_kept:
            return Decision(watch=watch, lines=lines)
    command = command_of(watch, stop)
    watch = changed(watch, tracked=track_stop(watch.tracked, stop), withheld=None)
    return Decision(watch=watch, command=command, lines=lines)


def failed(watch: Watch, why: str, is_fault: bool) -> Watch:
    """Say that the arm stops because of a failure; a fault lasts until a reset."""
    rules = watch.commitments.rules
    if rules is None or rules.separation is None:
        return watch
    known = given.fail(watch.commitments, why) if is_fault else watch.commitments
    state = SeparationState.FAULT if is_fault else SeparationState.PROTECTIVE_STOP
    return changed(watch, commitments=known, separation=SeparationStatus(state, why, 0.0))


def _is_withheld(
    watch: Watch, stop: ExecutingMotion, running: ExecutingMotion, now: float
) -> tuple[bool, tuple[Line, ...]]:
    """Return whether to leave the arm on its commitment, which is proven and a stop is not."""
    if not watch.commitments.is_active:
        return False, ()
    is_safe, lines = _is_separate(watch, stop, now)
    if is_safe:
        return False, lines
    is_kept, more = _is_separate(watch, running, now)
    return is_kept, (*lines, *more)


def _is_separate(
    watch: Watch, motion: ExecutingMotion, now: float
) -> tuple[bool, tuple[Line, ...]]:
    """Return whether the rest of a motion is proven separate; after an error that it is not."""
    try:
        return given.is_separate(watch.commitments, motion, now), ()
    except Exception:
        return False, (Line(Level.ERROR, traceback.format_exc()),)


def _sentence(watch: Watch, at: Moment, stop: ExecutingMotion) -> str:
    """Return why the arm stops, and until when."""
    left = max(0.0, stop.start_time + stop.trajectory.duration - at.now)
    return f'{watch.stop_reason}: fail-safe stop, at rest in {left:.2f} s'


# What checks a motion from a phase on [s] against the wearer.
Check = Callable[..., bool]


def holds(
    watch: Watch, check: Check, running: ExecutingMotion, phase: float, scene: Scene
) -> bool:
    """Return the verdict of a check of a motion from a phase on [s]."""
    return check(running, phase, watch.rules.required, scene)
