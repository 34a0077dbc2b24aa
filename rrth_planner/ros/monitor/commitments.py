# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The commitments of the running motion: what its controller is given of it, body by body."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
import time

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
    is_in_sharp_stop,
    JUMP_WAY,
    path_state,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.model.arrays import Array
from rrth_planner.model.separation import Separation
from rrth_planner.model.trajectory import part_of, positions_at, Trajectory
from rrth_planner.ros.interface.inputs import RequestError
from rrth_planner.ros.interface.parameters import MANUAL, PlannerParameters
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.interface.separation_status import SeparationState, SeparationStatus
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.error_codes import ErrorCode

# At a lower rate the arm is slowed down for the wearer.
FULL_RATE = 0.995
# At rest on its way the arm goes on once nothing has kept it from that for so long [s].
RESUME_AFTER = 0.2
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
class Sent:
    """
    A commitment as the controller has it.

    Parameters
    ----------
    motion : ExecutingMotion
        The message: its lead-in, then the commitment.
    lead : float
        How long the lead-in is [s].

    """

    commitment: Commitment
    motion: ExecutingMotion
    lead: float

    def shifted(self, step: float) -> 'Sent':
        """Return it by a clock that was set forward by a step [s]."""
        start = self.commitment.start_time + step
        return Sent(
            replace(self.commitment, start_time=start), self.motion.shifted(step), self.lead
        )


class Commitments:
    """
    Gives the controller only what is proven separate from the wearer, up to its end at rest.

    Without separation it does nothing. All calls come from the thread that has the monitor's lock.
    """

    def __init__(self, reporter: Reporter, publishers: PlanPublishers) -> None:
        """Begin with no motion, and a wearer who was never seen."""
        self._reporter, self._publishers = reporter, publishers
        self.planned: ExecutingMotion | None = None
        # The motion that it replaced.
        self._replaced: ExecutingMotion | None = None
        self._sent: Sent | None = None
        # The last ones, in their order: a controller may have rejected one.
        self._recent: deque[Sent] = deque()
        # Since when the arm rests [s], and what was commanded then.
        self._rest: tuple[float, Array] | None = None
        self._parameters: PlannerParameters | None = None
        self._body: BodyMotion | None = None
        self._last: WearerBody | None = None
        # Whether a part that is new, or was faster than assumed, has come since the present
        # commitment was proven.
        self._is_news = False
        # Why no motion may begin until `reset`; and whether the one that stopped may go on.
        self.fault, self._is_reset = '', False
        # When it was last not proven that the motion may go on [s], and what kept it from that.
        self._blocked, self._blocked_by = -np.inf, Blocked(0.0, '', '')
        # How long after each other bodies come, at most lately [s], and when the last one came.
        self._period, self._came = 0.0, -np.inf
        # How long it takes from a body to its commitment, at most lately [s].
        self._took = 0.0
        # Until then the present commitment is not extended: a handover was planned from it [s].
        self._held_until = -np.inf

    @property
    def present(self) -> Commitment | None:
        """The newest commitment; it may begin a little later than now."""
        return None if self._sent is None else self._sent.commitment

    @property
    def is_active(self) -> bool:
        """Whether the running motion is executed by commitments."""
        return self.present is not None

    def observe(self, body: WearerBody, separation: Separation | None, now: float) -> None:
        """Take note of a body that came now [s]."""
        if separation is None:
            self._body = self._last = None
            return
        if self.is_active and self._parameters is not None and self._parameters.separation:
            # The running motion is proven with these.
            separation = self._parameters.separation
        if body is self._last:
            return
        elapsed = now - self._came
        if 0.0 < elapsed < LONGEST_PERIOD:
            # Soon longer, slowly shorter again: a body that is late now and then needs time, too.
            self._period = max(elapsed, FADING * self._period)
        self._came = now
        parts = (*body.parts, *body.lost)
        scene = scene_of(body)
        # A stamp of the future is no younger than its reception.
        measured = np.array([min(part.measured, now) for _, part in parts for _ in part.boxes])
        if self._body is None:
            self._body = first_sight(scene, measured)
        else:
            is_new = (places_of(self._body.scene, scene) < 0).any()
            self._body = seen_again(self._body, scene, measured, separation.rules)
            self._is_news = self._is_news or bool(is_new or self._body.faster)
        self._last = body
        with suppress(Exception):
            self._reporter.body_observed(self._body)

    def begin(
        self, planned: ExecutingMotion, parameters: PlannerParameters, lead: Trajectory
    ) -> ExecutingMotion:
        """
        Return the first commitment of a motion, to be published; without separation all of it.

        lead: what is commanded before that. Raise RequestError where it cannot begin.
        """
        separation = parameters.separation
        if separation is None:
            commanded = led(lead, planned)
            self.end()
            return commanded
        if self.fault:
            raise RequestError(
                ErrorCode.FAILURE,
                f'after an error the planner does not move the arm until ~/reset: {self.fault}',
            )
        if self._body is None:
            raise RequestError(
                ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no body yet, expected one for separation'
            )
        seen = body_at(self._body, planned.start_time, separation.rules)
        # The next one takes some time to find; those after it take it from the one before.
        settings = self._stretched(separation, self._within)
        found = first_commitment(planned.trajectory, planned.start_time, seen, settings)
        if isinstance(found, Blocked):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the motion cannot begin: if {found.box} moves, {found.bar} is not proven '
                f'separate from it {found.time:.2f} s after the start',
            )
        sent = _sent(found, planned, lead)
        self._held_until = self._blocked = -np.inf
        self._is_reset = self._is_news = False
        # The controller may reject what replaces a running motion.
        replaced = [] if self._sent is None else [self._sent]
        self._recent = deque([*replaced, sent])
        self._rest = None
        self._replaced = self.planned
        self.planned, self._sent, self._parameters = planned, sent, parameters
        with suppress(Exception):
            self._report(None, float(path_state(found, found.start_time)[1]), False)
        return sent.motion

    def end(self) -> None:
        """Forget the running motion."""
        self.planned = self._sent = self._replaced = self._rest = None

    def shift(self, step: float) -> None:
        """Take all times by a clock that was set forward by a step [s]."""
        self.planned = self.planned and self.planned.shifted(step)
        self._replaced = self._replaced and self._replaced.shifted(step)
        recent = [*self._recent]
        shifted = [one.shifted(step) for one in recent]
        self._recent = deque(shifted)
        if self._sent is not None:
            # It is one of them, as a rule.
            pairs = zip(recent, shifted, strict=True)
            found = next((after for before, after in pairs if before is self._sent), None)
            self._sent = found or self._sent.shifted(step)
        self._body, self._rest = self._body and self._body.shifted(step), None
        self._came, self._blocked = self._came + step, self._blocked + step
        self._held_until += step

    def hold(self, until: float) -> None:
        """Let the present commitment be the last one until a time [s]."""
        self._held_until = until

    def phase(self, now: float) -> float:
        """Return the time within the planned motion at a time [s]."""
        return float(self._path_state(now)[0])

    def _path_state(self, now: float) -> Array:
        """Return where within the planned motion the arm is commanded to be, and how fast."""
        assert self.planned is not None and self._sent is not None
        motion = self.planned.trajectory
        own = [s.commitment for s in self._recent if s.commitment.motion is motion]
        begun = (c for c in reversed(own) if c.start_time <= now)
        return path_state(next(begun, own[0]), now)

    def is_arrived(self, now: float) -> bool:
        """Return whether the present commitment leads to the end of the planned motion."""
        present = self.present
        if present is None or present.is_whole:
            return True
        return self.phase(max(now, present.end_time)) >= present.motion.duration - ARRIVED

    def is_ignored(
        self,
        reading: JointReading | None,
        running: ExecutingMotion,
        parameters: PlannerParameters,
    ) -> bool:
        """Take note of where the arm is; return whether it rests while it is to move on."""
        if reading is None:
            return False
        if reading.is_moving(reading.taken, parameters.rest_speed):
            self._rest = None
            return False
        if self.is_active:
            place, after = self._commanded(reading.taken), IGNORED_AFTER
        else:
            place, after = _place_on(running, reading.taken), IGNORED_WHOLE_AFTER
        self._rest = since, then = self._rest or (reading.taken, place)
        return (
            # A controller may be late by as much as is stated.
            reading.taken - since > after + parameters.controller_delay
            and float(np.abs(place - then).max()) > IGNORED_WAY
            and float(np.abs(place - reading.positions).max()) > ASIDE
        )

    def has_moved(
        self,
        reading: JointReading | None,
        running: ExecutingMotion,
        rest_speed: float,
        least: float = MOVED,
    ) -> bool:
        """Return whether the arm is further than that [rad] from where its motion begins."""
        if reading is None:
            return False
        way = reading.mean_positions(rest_speed)
        way = way - (self.planned or running).trajectory.positions[0]
        return float(np.abs(way).max()) > least

    @property
    def is_whole(self) -> bool:
        """Whether the controller was given the whole rest of the motion."""
        return self.present is not None and self.present.is_whole

    def has_lost_proof(self, now: float) -> bool:
        """Return whether the whole rest was given and is not proven any more, by a part's news."""
        if not self._is_news or self.present is None or not self.present.is_whole:
            return False
        assert self._sent is not None
        self._is_news = not self.is_separate(self._sent.motion, now)
        return self._is_news

    def waits_for_reset(self, now: float) -> bool:
        """Return whether the motion is on its way, and a stop there lasts until `reset`."""
        parameters = self._parameters
        is_manual = parameters is not None and parameters.resume == MANUAL
        return is_manual and self.is_active and not self.is_arrived(now)

    def extend(
        self,
        now: float,
        begin: float,
        reading: JointReading | None,
        is_clear: Callable[[Trajectory], bool] = lambda curve: True,
    ) -> ExecutingMotion | None:
        """
        Publish the commitment that replaces the present one now [s]; return it if it changed.

        begin: now by `time.perf_counter`; reading: where the arm was last, to see which commitment
        it executes.
        """
        is_other = self._find_present(reading)
        sent, planned, parameters = self._sent, self.planned, self._parameters
        assert sent is not None and planned is not None and parameters is not None
        found = None if self.fault else self._extended(now, begin, sent, parameters, is_clear)
        if found is None:
            return sent.motion if is_other else None
        return found.motion

    def _extended(
        self,
        now: float,
        begin: float,
        sent: Sent,
        parameters: PlannerParameters,
        is_clear: Callable[[Trajectory], bool],
    ) -> Sent | None:
        """Return the commitment that was published in place of the present one; None: none was."""
        separation, planned, present = parameters.separation, self.planned, sent.commitment
        assert separation is not None and planned is not None
        # By then the controller has it, however late it is.
        delay = parameters.controller_delay
        within = self._within
        start = now + within + ahead(delay)
        if now < self._held_until or start < present.start_time or self._body is None:
            return None
        is_at_rest = start > present.end_time
        if is_at_rest and not present.is_whole and not self._may_resume(now, parameters):
            if parameters.resume == MANUAL:
                waits = SeparationStatus(SeparationState.PROTECTIVE_STOP, 'waits for ~/reset', 0.0)
                self._reporter.separation_status(waits)
            return None
        if is_in_sharp_stop(present, start, separation):
            blocked = self._blocked_by if self._blocked >= present.start_time else None
            self._report(blocked, float(self._path_state(now)[1]), True)
            return None
        elapsed = start - present.start_time
        if present.is_whole and (
            self.has_lost_proof(now)
            or not is_clear(part_of(present.trajectory, elapsed, present.trajectory.duration))
        ):
            # From here on the motion is given in stretches.
            present = replace(present, stretch=elapsed)
        seen = body_at(self._body, start, separation.rules)
        found = extended(present, start, seen, self._stretched(separation), is_clear)
        if found is None:
            return None
        if isinstance(found, Blocked):
            self._blocked, self._blocked_by = now, found
            is_stopping = now - present.start_time > present.stretch
            self._report(found, float(self._path_state(now)[1]), is_stopping)
            return None
        joins = sent.lead + elapsed
        lead = lead_in(sent.motion.trajectory, joins - (start - begin_of(now, delay)), joins)
        took = time.perf_counter() - begin
        self._took = max(min(took, LATEST), FADING * self._took)
        if took > within or not continues(lead, found.trajectory):
            # The arm is on its way to rest by then: from there the next one goes on.
            return None
        sent = _sent(found, planned, lead)
        message = sent.motion
        self._publishers.publish_motion(message.trajectory, parameters, message.start_time)
        # A reset counts for the stop that it follows, and no later one.
        self._sent, self._is_news, self._is_reset = sent, False, False
        if sum(one.commitment.start_time <= now for one in self._recent) > REMEMBERED:
            # A controller that has rejected all since would execute a whole rest to the end.
            del self._recent[1 if self._recent[0].commitment.is_whole else 0]
        self._recent.append(sent)
        # An error in the report must not hide what was published.
        with suppress(Exception):
            self._reporter.commitment_published(time.perf_counter() - begin)
            rate = 1.0 if found.is_whole else float(path_state(found, start)[1])
            self._report(None, rate, False)
        return sent

    @property
    def _within(self) -> float:
        """How long it may take to find a commitment [s]."""
        return min(max(TAKES * self._took, FOUND_WITHIN), LATEST)

    def _stretched(self, separation: Separation, longer: float = 0.0) -> Separation:
        """Return the settings for commitments that last until the next one begins."""
        stretch = max(separation.stretch, PERIODS * self._period + PROCESSING)
        return replace(separation, stretch=stretch + longer)

    def _may_resume(self, now: float, parameters: PlannerParameters) -> bool:
        """Return whether a motion that came to rest on its way may go on, if that is proven."""
        if parameters.resume == MANUAL and not self._is_reset:
            return False
        return not 0.0 < now - self._blocked < RESUME_AFTER

    def fail(self, why: str, is_fault: bool) -> None:
        """Report that the arm stops because of a failure; a fault lasts until `reset`."""
        if self._parameters is None or self._parameters.separation is None:
            return
        if is_fault:
            self.fault = why
        state = SeparationState.FAULT if is_fault else SeparationState.PROTECTIVE_STOP
        # An error in the report must not keep the arm from being stopped.
        with suppress(Exception):
            self._reporter.separation_status(SeparationStatus(state, why, 0.0))

    def reset(self) -> str:
        """Allow motions again after a fault, and a stopped one to go on; return what was reset."""
        fault, self.fault, self._is_reset = self.fault, '', True
        if fault:
            self._reporter.separation_status(SeparationStatus())
        return fault

    def _find_present(self, reading: JointReading | None) -> bool:
        """
        Continue an earlier commitment where the arm executes that: later ones were rejected.

        Return whether it does. An arm that lags behind what is commanded executes it.
        """
        if reading is None or self._parameters is None:
            return False
        begun = [s for s in self._recent if s.commitment.start_time <= reading.taken]
        if len(begun) < 2:
            return False
        rest_speed = self._parameters.rest_speed
        is_at_rest = begun[-1].commitment.end_time < reading.taken and not reading.is_moving(
            reading.taken, rest_speed
        )
        if is_at_rest:
            reading = replace(reading, positions=reading.mean_positions(rest_speed))
        aside, nearer = (ASIDE_AT_REST, NEARER_AT_REST) if is_at_rest else (ASIDE, NEARER)
        gap = np.inf
        # What was commanded until then, by all of them in turn.
        for time_ago in np.arange(0.0, LONGEST_LAG + self._parameters.controller_delay, LAG_STEP):
            then = reading.taken - time_ago
            then_last = (s for s in reversed(begun) if s.commitment.start_time <= then)
            gap = min(gap, _gap(next(then_last, begun[0]).commitment, reading, time_ago))
            if gap <= aside:
                return False
        gaps = [_gap(s.commitment, reading, 0.0) for s in begun[:-1]]
        k = int(np.argmin(gaps))
        if gaps[k] >= nearer * gap:
            return False
        # What has come since it was proven, and since later ones were, counts again.
        self._sent, self._is_news = begun[k], True
        self._recent = deque([begun[k]])
        if self.planned is not None and begun[k].commitment.motion is not self.planned.trajectory:
            # It is of the motion before that.
            self.planned, self._replaced = self._replaced, None
        return True

    def _commanded(self, time: float) -> Array:
        """Return the positions that were commanded for a time [s], (dof,) [rad]."""
        recent = [sent.commitment for sent in self._recent]
        commitment = next((c for c in reversed(recent) if c.start_time <= time), recent[0])
        elapsed = min(max(time - commitment.start_time, 0.0), commitment.trajectory.duration)
        place: Array = positions_at(commitment.trajectory, [elapsed])[0]
        return place

    def is_separate(self, motion: ExecutingMotion, now: float) -> bool:
        """Return whether what is left of a motion now [s] is proven separate from the wearer."""
        parameters = self._parameters
        if parameters is None or parameters.separation is None or self._body is None:
            return False
        separation = parameters.separation
        # Before its start the arm does something that was proven before.
        begin = max(now - motion.start_time, 0.0)
        curve = motion.trajectory
        if begin >= curve.duration:
            return True
        rest = part_of(curve, begin, curve.duration) if begin > 0.0 else curve
        seen = body_at(self._body, max(now, motion.start_time), separation.rules)
        margin = separation.margin + JUMP_WAY
        rules, arm = separation.rules, separation.arm
        return first_unproven(rest, 0.0, arm, seen, rules, margin) is None

    def _report(self, blocked: Blocked | None, rate: float, is_stopping: bool) -> None:
        if is_stopping:
            state = SeparationState.PROTECTIVE_STOP
        elif rate < FULL_RATE:
            state = SeparationState.SLOWED
        else:
            state = SeparationState.NORMAL
        cause = LATE_BODY if is_stopping else ''
        if blocked is not None:
            cause = f'{blocked.bar} is too near to {blocked.box}'
        self._reporter.separation_status(
            SeparationStatus(
                state,
                cause,
                rate,
                '' if blocked is None else blocked.bar,
                '' if blocked is None else blocked.box,
            )
        )


def _place_on(motion: ExecutingMotion, time: float) -> Array:
    """Return where a motion is at a time [s], (dof,) [rad]."""
    elapsed = min(max(time - motion.start_time, 0.0), motion.trajectory.duration)
    place: Array = positions_at(motion.trajectory, [elapsed])[0]
    return place


def _gap(commitment: Commitment, reading: JointReading, time_ago: float) -> float:
    """Return how far a reading is from where a commitment was some time before it [s] [rad]."""
    curve = commitment.trajectory
    time = reading.taken - time_ago - commitment.start_time
    time = min(max(time, 0.0), curve.duration)
    return float(np.abs(positions_at(curve, [time])[0] - reading.positions).max())


def _sent(commitment: Commitment, planned: ExecutingMotion, lead: Trajectory) -> Sent:
    """Return a commitment as it is sent, with what is commanded before it."""
    motion = replace(
        planned,
        trajectory=commitment.trajectory,
        start_time=commitment.start_time,
        escape_time=0.0,
    )
    return Sent(commitment, led(lead, motion), lead.duration)
