# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The commitments of the running motion: what its controller is given of it, body by body."""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
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
from rrth_planner.execution.commitment import (
    Commitment,
    extended,
    first_commitment,
    is_in_sharp_stop,
    JUMP_WAY,
    path_state,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
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
from rrth_planner.ros.messages.joint_state import JointReading

# At a lower rate the arm is slowed down for the wearer.
FULL_RATE = 0.995
# At rest on its way the arm goes on once nothing has kept it from that for so long [s].
RESUME_AFTER = 0.2
# What comes less often is no stream of bodies [s]; how fast a long pause between two is forgotten.
LONGEST_PERIOD, FADING = 0.25, 0.98
# A commitment lasts until the next one is there: the period of the bodies times so much, what that
# takes to find, and so long until the controller has it [s].
PERIODS, PROCESSING = 1.3, 0.012
# So many commitments are remembered. An arm that is further from the present one than this [rad]
# executes another one where the distance to that is less than this share.
REMEMBERED, ASIDE, NEARER = 16, 0.01, 0.3
# At rest an arm does not lag behind: these count there.
ASIDE_AT_REST, NEARER_AT_REST = 3e-4, 0.1
# An arm may lag behind what is commanded by so much, in steps of that [s].
LONGEST_LAG, LAG_STEP = 0.06, 0.004
# An arm that has rested for so long [s], while it was commanded further than this [rad], ignores
# its motion: its controller rejects what it is given. It has moved where it went so far [rad].
IGNORED_AFTER, IGNORED_WAY, MOVED = 0.3, 0.02, 1e-3
# The same of a motion that was given as a whole, without separation: some arms begin late [s].
IGNORED_WHOLE_AFTER = 1.0
# A commitment that takes longer to find is not published: the arm has gone on meanwhile. After so
# long the controller has one that is published [s].
LATEST, ARRIVAL = 0.02, 0.005
# Why a stop takes place that nothing made necessary.
LATE_BODY = 'the next body arrived too late: the motion resumes from rest'
# The end of a motion counts as reached so near to it [s].
ARRIVED = 1e-4


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
        self.present: Commitment | None = None
        # The last ones, in their order: a controller may have rejected one.
        self._recent: deque[Commitment] = deque(maxlen=REMEMBERED)
        # Since when the arm rests [s], what was commanded then, and where it was.
        self._rest: tuple[float, Array, Array] | None = None
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

    def begin(self, planned: ExecutingMotion, parameters: PlannerParameters) -> ExecutingMotion:
        """
        Return the first commitment of a motion, to be published; the motion itself without any.

        Raise RequestError where it cannot begin.
        """
        separation = parameters.separation
        if separation is None:
            self.end()
            return planned
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
        settings = self._stretched(separation)
        found = first_commitment(planned.trajectory, planned.start_time, seen, settings)
        if isinstance(found, Blocked):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                f'the motion cannot begin: if {found.box} moves, {found.bar} is not proven '
                f'separate from it {found.time:.2f} s after the start',
            )
        self._held_until = self._blocked = -np.inf
        self._is_reset = self._is_news = False
        # The controller may reject what replaces a running motion.
        replaced = [] if self.present is None else [self.present]
        self._recent = deque([*replaced, found], maxlen=REMEMBERED)
        self._rest = None
        self._replaced = self.planned
        self.planned, self.present, self._parameters = planned, found, parameters
        with suppress(Exception):
            self._report(None, float(path_state(found, found.start_time)[1]), False)
        return _executing(found, planned)

    def end(self) -> None:
        """Forget the running motion."""
        self.planned = self.present = self._replaced = self._rest = None

    def hold(self, until: float) -> None:
        """Let the present commitment be the last one until a time [s]."""
        self._held_until = until

    def phase(self, now: float) -> float:
        """Return the time within the planned motion at a time [s]."""
        assert self.present is not None
        return float(path_state(self.present, now)[0])

    def is_arrived(self, now: float) -> bool:
        """Return whether the present commitment leads to the end of the planned motion."""
        present = self.present
        if present is None or present.is_whole:
            return True
        return self.phase(max(now, present.end_time)) >= present.motion.duration - ARRIVED

    def is_ignored(self, reading: JointReading | None, running: ExecutingMotion) -> bool:
        """Take note of where the arm is; return whether it rests while it is to move on."""
        if reading is None:
            return False
        if self.is_active:
            place, after = self._commanded(reading.taken), IGNORED_AFTER
        else:
            place, after = _place_on(running, reading.taken), IGNORED_WHOLE_AFTER
        since, then, here = self._rest or (reading.taken, place, reading.positions)
        # Not every driver has velocities.
        way = float(np.abs(reading.positions - here).max())
        if reading.is_moving(reading.taken) or way > MOVED:
            self._rest = None
            return False
        self._rest = since, then, here
        return (
            reading.taken - since > after
            and float(np.abs(place - then).max()) > IGNORED_WAY
            and float(np.abs(place - reading.positions).max()) > ASIDE
        )

    def has_moved(
        self, reading: JointReading | None, running: ExecutingMotion, least: float = MOVED
    ) -> bool:
        """Return whether the arm is further than that [rad] from where its motion begins."""
        if reading is None:
            return False
        way = reading.positions - (self.planned or running).trajectory.positions[0]
        return float(np.abs(way).max()) > least

    @property
    def is_whole(self) -> bool:
        """Whether the controller was given the whole rest of the motion."""
        return self.present is not None and self.present.is_whole

    def has_lost_proof(self, now: float) -> bool:
        """Return whether the whole rest was given and is not proven any more, by a part's news."""
        if not self._is_news or self.present is None or not self.present.is_whole:
            return False
        assert self.planned is not None
        self._is_news = not self.is_separate(_executing(self.present, self.planned), now)
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
        present, planned, parameters = self.present, self.planned, self._parameters
        assert present is not None and planned is not None and parameters is not None
        found = None if self.fault else self._extended(now, begin, present, parameters, is_clear)
        if found is None:
            return _executing(present, planned) if is_other else None
        return _executing(found, planned)

    def _extended(
        self,
        now: float,
        begin: float,
        present: Commitment,
        parameters: PlannerParameters,
        is_clear: Callable[[Trajectory], bool],
    ) -> Commitment | None:
        """Return the commitment that was published in place of the present one; None: none was."""
        separation = parameters.separation
        if now < max(present.start_time, self._held_until) or self._body is None:
            return None
        assert separation is not None
        is_at_rest = now > present.end_time
        if is_at_rest and not present.is_whole and not self._may_resume(now, parameters):
            if parameters.resume == MANUAL:
                waits = SeparationStatus(SeparationState.PROTECTIVE_STOP, 'waits for ~/reset', 0.0)
                self._reporter.separation_status(waits)
            return None
        if is_in_sharp_stop(present, now, separation):
            blocked = self._blocked_by if self._blocked >= present.start_time else None
            self._report(blocked, float(path_state(present, now)[1]), True)
            return None
        elapsed = now - present.start_time
        if present.is_whole and (
            self.has_lost_proof(now)
            or not is_clear(part_of(present.trajectory, elapsed, present.trajectory.duration))
        ):
            # From here on the motion is given in stretches.
            present = replace(present, stretch=elapsed)
        seen = body_at(self._body, now, separation.rules)
        found = extended(present, now, seen, self._stretched(separation), is_clear)
        if found is None:
            return None
        if isinstance(found, Blocked):
            self._blocked, self._blocked_by = now, found
            is_stopping = now - present.start_time > present.stretch
            self._report(found, float(path_state(present, now)[1]), is_stopping)
            return None
        took = time.perf_counter() - begin
        self._took = max(min(took, LATEST), FADING * self._took)
        if took > LATEST or is_in_sharp_stop(present, now + took + ARRIVAL, separation):
            # The arm is on its way to rest by then: from there the next one goes on.
            return None
        self._publishers.publish_motion(found.trajectory, parameters, found.start_time)
        # A reset counts for the stop that it follows, and no later one.
        self.present, self._is_news, self._is_reset = found, False, False
        if len(self._recent) == REMEMBERED and self._recent[0].is_whole:
            # A controller that has rejected all since would execute it to the end.
            del self._recent[1]
        self._recent.append(found)
        # An error in the report must not hide what was published.
        with suppress(Exception):
            self._reporter.commitment_published(time.perf_counter() - begin)
            self._report(None, 1.0 if found.is_whole else float(path_state(found, now)[1]), False)
        return found

    def _stretched(self, separation: Separation) -> Separation:
        """Return the settings for commitments that last until the next body."""
        # Where this process has to wait for a processor, so has the controller, as a rule.
        stretch = max(separation.stretch, PERIODS * self._period + PROCESSING + self._took)
        return replace(separation, stretch=stretch)

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
        begun = [c for c in self._recent if reading is not None and c.start_time <= reading.taken]
        if reading is None or len(begun) < 2:
            return False
        is_at_rest = begun[-1].end_time < reading.taken and not reading.is_moving(reading.taken)
        aside, nearer = (ASIDE_AT_REST, NEARER_AT_REST) if is_at_rest else (ASIDE, NEARER)
        gap = np.inf
        # What was commanded until then, by all of them in turn.
        for time_ago in np.arange(0.0, LONGEST_LAG, LAG_STEP):
            then = reading.taken - time_ago
            last = next((c for c in reversed(begun) if c.start_time <= then), begun[0])
            gap = min(gap, _gap(last, reading, time_ago))
            if gap <= aside:
                return False
        gaps = [_gap(c, reading, 0.0) for c in begun[:-1]]
        k = int(np.argmin(gaps))
        if gaps[k] >= nearer * gap:
            return False
        # What has come since it was proven, and since later ones were, counts again.
        self.present, self._is_news = begun[k], True
        self._recent = deque([begun[k]], maxlen=REMEMBERED)
        if self.planned is not None and begun[k].motion is not self.planned.trajectory:
            # It is of the motion before that.
            self.planned, self._replaced = self._replaced, None
        return True

    def _commanded(self, time: float) -> Array:
        """Return the positions that were commanded for a time [s], (dof,) [rad]."""
        recent = self._recent
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


def _executing(commitment: Commitment, planned: ExecutingMotion) -> ExecutingMotion:
    """Return a commitment as the motion that the arm executes."""
    return replace(
        planned,
        trajectory=commitment.trajectory,
        start_time=commitment.start_time,
        escape_time=0.0,
    )
