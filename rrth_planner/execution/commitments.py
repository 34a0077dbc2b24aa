# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The commitments of the running motion: what its controller is given of it, body by body."""

from collections.abc import Callable
from dataclasses import dataclass, replace
import functools

import numpy as np
from rrth_planner.collision.separation import Blocked, first_unproven
from rrth_planner.execution.body_motion import (
    body_at,
    BodyMotion,
    first_sight,
    places_of,
    seen_again,
)
from rrth_planner.execution.command import ahead, begin_of, continues, lead_in, led
from rrth_planner.execution.commitment import (
    Commitment,
    extended,
    first_commitment,
    has_sharp_stops,
    is_in_sharp_stop,
    JUMP_WAY,
    path_state,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.separation_status import SeparationState, SeparationStatus
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import part, state_at
from rrth_planner.model.frozen import changed
from rrth_planner.model.scene import Scene
from rrth_planner.model.separation import Separation
from rrth_planner.model.trajectory import Trajectory

# At a lower rate the arm is slowed down for the wearer.
FULL_RATE = 0.995
# At rest on its way the arm goes on once nothing has kept it from that for so long; where stops
# are sharper than motions, and it goes on from rest only, for the shorter time [s].
RESUME_AFTER, RESUME_AFTER_SHARP = 0.2, 0.05
# What comes less often is no stream of bodies [s]; how fast a long pause between two is forgotten.
LONGEST_PERIOD, FADING = 0.25, 0.98
# A commitment lasts until the next one begins: the period of the bodies times so much, and by how
# much later that may be found [s].
PERIODS, PROCESSING = 1.3, 0.006
# So many commitments that have begun are remembered. An arm that is further from the present one
# than this [rad] executes another one where the distance to that is less than this share.
REMEMBERED, ASIDE, NEARER = 16, 0.01, 0.3
# At rest an arm does not lag behind: these count there.
ASIDE_AT_REST, NEARER_AT_REST = 3e-4, 0.1
# An arm may lag behind what is commanded by so much beyond the stated delay, in steps of that [s].
LONGEST_LAG, LAG_STEP = 0.06, 0.004
# An arm that has rested for so long [s], while it was commanded further than this [rad], ignores
# its motion: its controller rejects what it is given. It has moved where it rests so far from the
# start [rad].
IGNORED_AFTER, IGNORED_WAY, MOVED = 0.3, 0.02, 2e-3
# The same of a motion that was given as a whole, without separation: some arms begin late [s].
IGNORED_WHOLE_AFTER = 1.0
# A commitment is found within so much times what it took lately, and at least so long; one that
# takes longer than that, or than LATEST, is not published: the arm has gone on meanwhile [s].
TAKES, FOUND_WITHIN, LATEST = 1.5, 0.002, 0.02
# Why a stop takes place that nothing made necessary.
LATE_BODY = 'the next body arrived too late: the motion resumes from rest'
# The end of a motion counts as reached so near to it [s].
ARRIVED = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class ExecutionRules:
    """
    How a planned motion is to be executed.

    Parameters
    ----------
    separation : Separation or None
        From the wearer; None: the controller is given all of the motion at once.
    controller_delay : float
        The greatest of the controller [s].
    is_manual : bool
        Whether a motion that came to rest on its way goes on after a reset only.

    """

    separation: Separation | None
    controller_delay: float
    is_manual: bool


@dataclass(frozen=True, slots=True, eq=False)
class Sent:
    """
    A commitment as the controller has it.

    Parameters
    ----------
    motion : ExecutingMotion
        The message: its lead-in, then the commitment.
    lead : float
        How long the lead-in is [s].
    seen : float
        When the body came that it was proven with [s].

    """

    commitment: Commitment
    motion: ExecutingMotion
    lead: float
    seen: float

    def shifted(self, step: float) -> 'Sent':
        """Return it by a clock that was set forward by a step [s]."""
        start = self.commitment.start_time + step
        return Sent(
            changed(self.commitment, start_time=start),
            self.motion.shifted(step),
            self.lead,
            self.seen + step,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Commitments:
    """
    What the controller was given of the running motion, and what that was proven with.

    It is given only what is proven separate from the wearer, up to its end at rest.

    Parameters
    ----------
    planned, replaced : ExecutingMotion or None
        The motion that is executed, and the one that it replaced.
    sent : Sent or None
        The newest commitment; it may begin a little later than now. None: the running motion is
        not executed by commitments.
    recent : tuple of Sent
        The last ones, in their order: a controller may have rejected one.
    rest : (float, ndarray) or None
        Since when the arm rests [s], and what was commanded then, (dof,) [rad].
    rules : ExecutionRules or None
        Of the last motion that was begun.
    body : BodyMotion or None
        The wearer; None: he was never seen.
    is_news : bool
        Whether a part that is new, or got further than assumed, has come since the newest
        commitment was proven, or the body that this was proven with is kept no more.
    fault : str
        Why no motion may begin until a reset; empty: it may.
    is_reset : bool
        Whether a motion that came to rest on its way may go on.
    blocked, blocked_by : float, Blocked
        When it was last not proven that the motion may go on [s], and what kept it from that.
    period, came : float
        How long after each other bodies come, at most lately, and when the last one came [s].
    took : float
        How long it takes from a body to its commitment, at most lately [s].
    held_until : float
        Until then the newest commitment is not replaced: a handover was planned from it [s].

    """

    planned: ExecutingMotion | None = None
    replaced: ExecutingMotion | None = None
    sent: Sent | None = None
    recent: tuple[Sent, ...] = ()
    rest: tuple[float, Array] | None = None
    rules: ExecutionRules | None = None
    body: BodyMotion | None = None
    is_news: bool = False
    fault: str = ''
    is_reset: bool = False
    blocked: float = -np.inf
    blocked_by: Blocked = Blocked(0.0, '', '')
    period: float = 0.0
    came: float = -np.inf
    took: float = 0.0
    held_until: float = -np.inf

    @property
    def present(self) -> Commitment | None:
        """The newest commitment."""
        return None if self.sent is None else self.sent.commitment

    @property
    def is_active(self) -> bool:
        """Whether the running motion is executed by commitments."""
        return self.sent is not None

    @property
    def is_whole(self) -> bool:
        """Whether the controller was given the whole rest of the motion."""
        return self.sent is not None and self.sent.commitment.is_whole

    @property
    def within(self) -> float:
        """How long it may take to find a commitment [s]."""
        return min(max(TAKES * self.took, FOUND_WITHIN), LATEST)

    @property
    def has_lost_proof(self) -> bool:
        """Whether the whole rest was given, and news of the wearer leave it unproven."""
        return self.is_news and self.is_whole


@dataclass(frozen=True, slots=True, eq=False)
class Extension:
    """
    What became of a commitment with a new body.

    Parameters
    ----------
    commitments : Commitments
        As long as nothing is published.
    next : Commitments or None
        Once its newest commitment is published; None: there is none to publish.
    status : SeparationStatus or None
        To be reported; with a commitment to publish: after that.
    has_changed : bool
        Whether the arm executes another commitment than was taken.

    """

    commitments: Commitments
    next: Commitments | None
    status: SeparationStatus | None
    has_changed: bool


def observe(
    known: Commitments, scene: Scene, measured: Array, separation: Separation, now: float
) -> Commitments:
    """
    Take note of a body that came now [s].

    measured, (m,): when each of its boxes was [s]. A running motion is proven with its own rules.
    """
    if known.is_active and known.rules is not None and known.rules.separation is not None:
        separation = known.rules.separation
    elapsed, period = now - known.came, known.period
    if 0.0 < elapsed < LONGEST_PERIOD:
        # Soon longer, slowly shorter again: a body that is late now and then needs time, too.
        period = max(elapsed, FADING * period)
    # A stamp of the future is no younger than its reception.
    measured = np.minimum(measured, now)
    if known.body is None:
        body, is_news = first_sight(scene, measured, now), known.is_news
    else:
        is_new = bool((places_of(known.body.scene, scene) < 0).any())
        since = _compared_since(known, measured, separation, now)
        body = seen_again(known.body, scene, measured, separation.rules, now, since)
        is_forgotten = known.sent is not None and body.kept.begin > known.sent.seen
        is_news = known.is_news or is_new or is_forgotten or bool(body.further)
    return changed(known, body=body, is_news=is_news, came=now, period=period)


def begin(
    known: Commitments, planned: ExecutingMotion, rules: ExecutionRules, lead: Trajectory
) -> Commitments | Blocked:
    """
    Return the first commitment of a motion, to be published, or what keeps it from beginning.

    lead: what is commanded before that. The rules have a separation, and a body is known.
    """
    assert rules.separation is not None and known.body is not None
    seen = body_at(known.body, planned.start_time, rules.separation.rules)
    # The next one takes some time to find; those after it take it from the one before.
    settings = _stretched(known, rules.separation, known.within)
    found = first_commitment(planned.trajectory, planned.start_time, seen, settings)
    if isinstance(found, Blocked):
        return found
    sent = _sent(found, planned, lead, known.came)
    return changed(
        known,
        planned=planned,
        replaced=known.planned,
        sent=sent,
        # The controller may reject what replaces a running motion.
        recent=(sent,) if known.sent is None else (known.sent, sent),
        rest=None,
        rules=rules,
        is_news=False,
        is_reset=False,
        blocked=-np.inf,
        held_until=-np.inf,
    )


def end(known: Commitments) -> Commitments:
    """Forget the running motion."""
    return changed(known, planned=None, sent=None, replaced=None, rest=None)


def hold(known: Commitments, until: float) -> Commitments:
    """Let the newest commitment be the last one until a time [s]."""
    return changed(known, held_until=until)


def fail(known: Commitments, why: str) -> Commitments:
    """Let no motion begin until a reset."""
    return changed(known, fault=why)


def reset(known: Commitments) -> Commitments:
    """Allow motions again after a fault, and one that came to rest on its way to go on."""
    return changed(known, fault='', is_reset=True)


def shift(known: Commitments, step: float) -> Commitments:
    """Take all times by a clock that was set forward by a step [s]."""
    recent = tuple(one.shifted(step) for one in known.recent)
    # The newest is one of them, as a rule.
    pairs = zip(known.recent, recent, strict=True)
    found = next((after for before, after in pairs if before is known.sent), None)
    return changed(
        known,
        planned=known.planned and known.planned.shifted(step),
        replaced=known.replaced and known.replaced.shifted(step),
        sent=found or (known.sent and known.sent.shifted(step)),
        recent=recent,
        body=known.body and known.body.shifted(step),
        rest=None,
        came=known.came + step,
        blocked=known.blocked + step,
        held_until=known.held_until + step,
    )


def phase_at(known: Commitments, now: float) -> float:
    """Return the time within the planned motion at a time [s]."""
    return float(_path_state(known, now)[0])


def rate_at(known: Commitments, now: float) -> float:
    """Return at which rate the planned motion is executed at a time [s], of 1."""
    return float(_path_state(known, now)[1])


def is_arrived(known: Commitments, now: float) -> bool:
    """Return whether the newest commitment leads to the end of the planned motion."""
    present = known.present
    if present is None or present.is_whole:
        return True
    return phase_at(known, max(now, present.end_time)) >= present.motion.duration - ARRIVED


def stops_sharply(known: Commitments) -> bool:
    """Return whether the stops of the running motion are sharper than motions may be."""
    separation = None if known.rules is None else known.rules.separation
    return separation is not None and has_sharp_stops(separation)


def waits_for_reset(known: Commitments, now: float) -> bool:
    """Return whether the motion is on its way, and a stop there lasts until a reset."""
    is_manual = known.rules is not None and known.rules.is_manual
    return is_manual and known.is_active and not is_arrived(known, now)


def note_rest(
    known: Commitments,
    reading: JointReading | None,
    running: ExecutingMotion,
    rules: ExecutionRules,
) -> tuple[Commitments, bool]:
    """Take note of where the arm is; return also whether it rests while it is to move on."""
    if reading is None:
        return known, False
    if reading.is_moving(reading.taken):
        return known if known.rest is None else changed(known, rest=None), False
    if known.is_active:
        place, after = _commanded(known, reading.taken), IGNORED_AFTER
    else:
        place, after = _place_on(running, reading.taken), IGNORED_WHOLE_AFTER
    since, then = known.rest or (reading.taken, place)
    is_ignored = (
        # A controller may be late by as much as is stated.
        reading.taken - since > after + rules.controller_delay
        and float(np.abs(place - then).max()) > IGNORED_WAY
        and float(np.abs(place - reading.positions).max()) > ASIDE
    )
    return known if known.rest else changed(known, rest=(since, then)), is_ignored


def has_moved(
    known: Commitments,
    reading: JointReading | None,
    running: ExecutingMotion,
    least: float = MOVED,
) -> bool:
    """Return whether the arm is further than that [rad] from where its motion begins."""
    if reading is None:
        return False
    way = reading.mean_positions()
    way = way - (known.planned or running).trajectory.positions[0]
    return float(np.abs(way).max()) > least


def check_news(known: Commitments, now: float) -> Commitments:
    """Forget news of the wearer that leave the whole rest of the motion proven."""
    if not known.has_lost_proof:
        return known
    assert known.sent is not None
    if not is_separate(known, known.sent.motion, now):
        return known
    # From now on it is proven with the present body.
    sent = changed(known.sent, seen=known.came)
    recent = tuple(sent if one is known.sent else one for one in known.recent)
    return changed(known, sent=sent, recent=recent, is_news=False)


def note_took(known: Commitments, took: float) -> Commitments:
    """Take note of how long it took from a body to its commitment [s]."""
    return changed(known, took=max(min(took, LATEST), FADING * known.took))


def extend(
    known: Commitments,
    now: float,
    reading: JointReading | None,
    is_clear: Callable[[Trajectory], bool] = lambda curve: True,
) -> Extension:
    """
    Return the commitment that replaces the newest one now [s].

    reading: where the arm was last, to see which commitment it executes; is_clear: whether a
    stretch of the motion and its stop may be given for other reasons.
    """
    found = _find_present(known, reading)
    has_changed = found is not known
    if found.fault:
        return Extension(found, None, None, has_changed)
    extension = _extended(found, now, is_clear)
    return changed(extension, has_changed=True) if has_changed else extension


def _extended(known: Commitments, now: float, is_clear: Callable[[Trajectory], bool]) -> Extension:
    sent, planned, rules, body = known.sent, known.planned, known.rules, known.body
    assert sent is not None and planned is not None and rules is not None
    separation, present = rules.separation, sent.commitment
    assert separation is not None
    # By then the controller has it, however late it is.
    start = now + known.within + ahead(rules.controller_delay)
    as_before = Extension(known, None, None, False)
    if now < known.held_until or start < present.start_time or body is None:
        return as_before
    is_at_rest = start > present.end_time
    if is_at_rest and not present.is_whole and not _may_resume(known, now, rules):
        if rules.is_manual:
            waits = SeparationStatus(SeparationState.PROTECTIVE_STOP, 'waits for ~/reset', 0.0)
            return changed(as_before, status=waits)
        return as_before
    if is_in_sharp_stop(present, start, separation):
        blocked = known.blocked_by if known.blocked >= present.start_time else None
        return changed(as_before, status=status_of(blocked, rate_at(known, now), True))
    elapsed = start - present.start_time
    if present.is_whole:
        known = check_news(known, now)
        if known.has_lost_proof or not is_clear(
            part(present.trajectory, elapsed, present.trajectory.duration)
        ):
            # From here on the motion is given in stretches.
            present = changed(present, stretch=elapsed)
        as_before = changed(as_before, commitments=known)
    seen = body_at(body, start, separation.rules)
    found = extended(present, start, seen, _stretched(known, separation), is_clear)
    if found is None:
        return as_before
    if isinstance(found, Blocked):
        is_stopping = now - present.start_time > present.stretch
        status = status_of(found, rate_at(known, now), is_stopping)
        known = changed(known, blocked=now, blocked_by=found)
        return changed(as_before, commitments=known, status=status)
    joins = sent.lead + elapsed
    begins = begin_of(now, rules.controller_delay)
    lead = lead_in(sent.motion.trajectory, joins - (start - begins), joins)
    if not continues(lead, found.trajectory):
        # The arm is on its way to rest by then: from there the next one goes on.
        return as_before
    sent = _sent(found, planned, lead, known.came)
    recent = known.recent
    if sum(one.commitment.start_time <= now for one in recent) > REMEMBERED:
        # A controller that has rejected all since would execute a whole rest to the end.
        dropped = 1 if recent[0].commitment.is_whole else 0
        recent = (*recent[:dropped], *recent[dropped + 1 :])
    # A reset counts for the stop that it follows, and no later one.
    following = changed(known, sent=sent, recent=(*recent, sent), is_news=False, is_reset=False)
    rate = 1.0 if found.is_whole else float(path_state(found, start)[1])
    return Extension(known, following, status_of(None, rate, False), False)


def is_separate(known: Commitments, motion: ExecutingMotion, now: float) -> bool:
    """Return whether what is left of a motion now [s] is proven separate from the wearer."""
    if known.rules is None or known.rules.separation is None or known.body is None:
        return False
    separation = known.rules.separation
    # Before its start the arm does something that was proven before.
    since = max(now - motion.start_time, 0.0)
    curve = motion.trajectory
    if since >= curve.duration:
        return True
    rest = part(curve, since, curve.duration) if since > 0.0 else curve
    seen = body_at(known.body, max(now, motion.start_time), separation.rules)
    margin = separation.margin + JUMP_WAY
    rules, arm = separation.rules, separation.arm
    return first_unproven(rest, 0.0, arm, seen, rules, margin) is None


def status_of(blocked: Blocked | None, rate: float, is_stopping: bool) -> SeparationStatus:
    """Return how a motion is executed: at which rate, and what keeps it from going on."""
    if is_stopping:
        state = SeparationState.PROTECTIVE_STOP
    elif rate < FULL_RATE:
        state = SeparationState.SLOWED
    else:
        state = SeparationState.NORMAL
    if blocked is None:
        return SeparationStatus(state, LATE_BODY if is_stopping else '', rate)
    cause = f'{blocked.bar} is too near to {blocked.box}'
    return SeparationStatus(state, cause, rate, blocked.bar, blocked.box)


def _path_state(known: Commitments, now: float) -> Array:
    """Return where within the planned motion the arm is commanded to be, and how fast."""
    assert known.planned is not None and known.sent is not None
    motion = known.planned.trajectory
    own = [s.commitment for s in known.recent if s.commitment.motion is motion]
    begun = (c for c in reversed(own) if c.start_time <= now)
    return path_state(next(begun, own[0]), now)


def _stretched(known: Commitments, separation: Separation, longer: float = 0.0) -> Separation:
    """Return the settings for commitments that last until the next one begins."""
    stretch = max(separation.stretch, PERIODS * known.period + PROCESSING)
    return replace(separation, stretch=stretch + longer)


def _may_resume(known: Commitments, now: float, rules: ExecutionRules) -> bool:
    """Return whether a motion that came to rest on its way may go on, if that is proven."""
    if rules.is_manual and not known.is_reset:
        return False
    after = RESUME_AFTER_SHARP if stops_sharply(known) else RESUME_AFTER
    return not 0.0 < now - known.blocked < after


def _find_present(known: Commitments, reading: JointReading | None) -> Commitments:
    """
    Continue an earlier commitment where the arm executes that: later ones were rejected.

    The same where it does not. An arm that lags behind what is commanded executes it.
    """
    if reading is None or known.rules is None:
        return known
    begun = [s for s in known.recent if s.commitment.start_time <= reading.taken]
    if len(begun) < 2:
        return known
    end = begun[-1].commitment.end_time
    is_at_rest = end < reading.taken and not reading.is_moving(reading.taken)
    if is_at_rest:
        reading = changed(reading, positions=reading.mean_positions())
    aside, nearer = (ASIDE_AT_REST, NEARER_AT_REST) if is_at_rest else (ASIDE, NEARER)
    gap = np.inf
    # What was commanded until then, by all of them in turn.
    for time_ago in np.arange(0.0, LONGEST_LAG + known.rules.controller_delay, LAG_STEP):
        then = reading.taken - time_ago
        then_last = (s for s in reversed(begun) if s.commitment.start_time <= then)
        gap = min(gap, _gap(next(then_last, begun[0]).commitment, reading, time_ago))
        if gap <= aside:
            return known
    gaps = [_gap(s.commitment, reading, 0.0) for s in begun[:-1]]
    k = int(np.argmin(gaps))
    if gaps[k] >= nearer * gap:
        return known
    # What has come since it was proven, and since later ones were, counts again.
    found = changed(known, sent=begun[k], recent=(begun[k],), is_news=True)
    if known.planned is None or begun[k].commitment.motion is known.planned.trajectory:
        return found
    # It is of the motion before that.
    return changed(found, planned=known.replaced, replaced=None)


def _commanded(known: Commitments, time: float) -> Array:
    """Return the positions that were commanded for a time [s], (dof,) [rad]."""
    recent = [sent.commitment for sent in known.recent]
    commitment = next((c for c in reversed(recent) if c.start_time <= time), recent[0])
    elapsed = min(max(time - commitment.start_time, 0.0), commitment.trajectory.duration)
    place: Array = state_at(commitment.trajectory, elapsed)[0]
    return place


def _place_on(motion: ExecutingMotion, time: float) -> Array:
    """Return where a motion is at a time [s], (dof,) [rad]."""
    elapsed = min(max(time - motion.start_time, 0.0), motion.trajectory.duration)
    place: Array = state_at(motion.trajectory, elapsed)[0]
    return place


def _gap(commitment: Commitment, reading: JointReading, time_ago: float) -> float:
    """Return how far a reading is from where a commitment was some time before it [s] [rad]."""
    curve = commitment.trajectory
    time = reading.taken - time_ago - commitment.start_time
    time = min(max(time, 0.0), curve.duration)
    return float(np.abs(state_at(curve, time)[0] - reading.positions).max())


def _compared_since(
    known: Commitments, measured: Array, separation: Separation, now: float
) -> float:
    """
    Return since when sights count for a body that came now [s].

    measured, (m,): when each of its boxes was [s]. Since the one that any commitment was proven
    with that is not over yet, and for as long at least as the next one is going to run after its
    body was measured.
    """
    age = now - float(measured.max(initial=now - LONGEST_PERIOD))
    horizon = age + known.within + separation.rules.controller_delay
    horizon += _stretched(known, separation).stretch + _longest_stop(separation)
    proven = (one.seen for one in known.recent if one.commitment.end_time > now)
    return min([now - horizon, *proven])


# One hardly ever changes.
@functools.lru_cache(maxsize=4)
def _longest_stop(separation: Separation) -> float:
    """Return how long a stop takes at most, from an acceleration at its limit [s]."""
    limits = separation.stop_limits
    v, a, j = limits.rows
    peak = np.minimum(a, np.sqrt(v * j))
    fades = separation.limits.acceleration / j
    return float((v / peak + peak / j + fades).max())


def _sent(commitment: Commitment, planned: ExecutingMotion, lead: Trajectory, seen: float) -> Sent:
    """Return a commitment as it is sent, with what is commanded before it."""
    motion = changed(
        planned,
        trajectory=commitment.trajectory,
        start_time=commitment.start_time,
        escape_time=0.0,
    )
    return Sent(commitment, led(lead, motion), lead.duration, seen)
