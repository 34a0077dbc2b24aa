# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Requests one after the other, as coroutines of one thread."""

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, replace
import math
from pathlib import Path
import traceback
from typing import cast

from rrth_planner.execution.command import ahead
from rrth_planner.execution.coroutines import Wait
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.flight_recorder import MEMORY
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.remaining_motion import box_in_ray, is_place_free
from rrth_planner.execution.separation_status import NO_PROMISE
from rrth_planner.execution.watch import Stop
from rrth_planner.io.incident import Incident
from rrth_planner.model.errors import LONGEST_SENTENCE, one_line, RecordError, RequestError
from rrth_planner.model.frozen import changed
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.stamp import stamp_of
from rrth_planner.model.status import ErrorCode
from rrth_planner.pipeline.host import RequestHost
from rrth_planner.requests.answer import answer, FINAL
from rrth_planner.requests.ends import MotionMonitor, Publishers, Report
from rrth_planner.requests.incidents import (
    incident_of,
    incident_of_stop,
    keep,
    keep_flight,
    sentence_of,
)
from rrth_planner.requests.inputs import Inputs
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.parameters import RequestParameters
from rrth_planner.requests.plan_request import plan_request, require_not_cancelled
from rrth_planner.requests.revalidation import Revalidation

# Period of the work after a stop, and shortest time from one motion shown to the next [s].
PERIOD, SHORTEST_SHOW = 0.05, 0.2
# An arm may come to rest so much later than its commanded stop [s].
LONGEST_SETTLING = 1.0
# A request that the wearer was in the way of is planned again after this time [s].
AGAIN = 0.01
# A wearer whose hand is in the ray of an arm at rest, or about to be, has so long to take it
# out [s].
RAY_PATIENCE = 4.0
# After a stop the same goal is tried so often [s].
RESUME_PERIOD = 0.05
# It is waited for so long, each time, until it is known whether the body stands still [s].
LONGEST_UNKNOWN = 2.0
# More requests than these do not wait; that is logged at most this often [s].
MOST_WAITING, WARNING_PERIOD = 64, 5.0
# More than a code and its name take before a sentence.
LONGEST_CODE = 100
CANCELLED = (ErrorCode.PREEMPTED, 'the request was cancelled')
OVERTAKEN = (ErrorCode.PREEMPTED, 'another request has come meanwhile')


class _Ticket:
    """One plan, until its motion is published or it ends without one."""

    def __init__(self, goal: PointingGoal | None, request: int) -> None:
        """Begin, with the number of its request; without a goal it is that of the last target."""
        self.goal, self.request, self.is_cancelled = goal, request, False


@dataclass(frozen=True, slots=True)
class _Resumption:
    """
    A plan for the goal of a motion that was stopped, to be made once the arm rests.

    It is tried at once where the stop is proven free of the wearer, as a handover from the stop.
    """

    ticket: _Ticket
    goal: PointingGoal
    # Numbers of motions and requests until then.
    n_motions: int
    n_requests: int
    # When the stop ends [s], and until when to wait for the rest by the monotonic clock, since a
    # simulated one may stand still; and until when to try again while the wearer is in the way.
    stopped: float
    latest: float
    end: float
    is_during_stop: bool
    is_first: bool = True

    def is_due(self, joints: JointReading | None, present: float) -> bool:
        """
        Return whether to try now: during the stop, or once a reading after it has the arm at rest.

        Also once the time to wait for that is up, by a time that never steps [s].
        """
        if self.is_during_stop or present >= self.latest:
            return True
        return joints is not None and joints.rests_after(self.stopped)


class PlanQueue:
    """
    Plan and publish for one request at a time; the others wait their turn.

    Parameters
    ----------
    host : RequestHost
        Runs the requests.
    report : Report
        Its parameters, as they are when a request's turn begins, are those of the plan.
    monitor : MotionMonitor
        Monitors each published motion; its stops are checked again here, and replanned.

    """

    def __init__(
        self,
        host: RequestHost,
        inputs: Inputs,
        report: Report,
        publishers: Publishers,
        monitor: MotionMonitor,
    ) -> None:
        """Start with nothing to do."""
        self._host, self._inputs, self._report = host, inputs, report
        self._publishers, self._monitor = publishers, monitor
        self._open: set[_Ticket] = set()
        self._resumption: _Resumption | None = None
        # Over once the last turn that was taken has ended.
        self._turn: Wait[None] = Wait()
        self._turn.give(None)
        # What is answered and not reported yet.
        self._unreported: list[Outcome] = []
        # The newest motion that is not shown yet, and when one was last shown [s].
        self._unseen: Outcome | None = None
        self._shown = -SHORTEST_SHOW
        self._is_closed = False
        # So far, and how many of them are not answered yet.
        self._n_requests, self._n_waiting = 0, 0
        # Those that were turned away, too: the number of the last answer.
        self._n_asked = 0
        # Of the monitor, when its events were last written for that, and since when they may be
        # again [s].
        self._n_faults, self._may_save = 0, -math.inf
        # The number of the request whose goal the arm pursues; None: of none.
        self._pursued: int | None = None
        # The goal that was given up last after a stop, and why.
        self._given_up: tuple[PointingGoal | None, ErrorCode, str] = None, *CANCELLED

    @property
    def n_taken(self) -> int:
        """How many requests were planned for, or wait for their turn."""
        return self._n_requests

    async def respond(self, goal: PointingGoal | None) -> Outcome:
        """Return the outcome of a request for a goal, or for the last target, after its turn."""
        begin = self._host.steady()
        # What it finds is compared by the clock of its own time.
        self._monitor.check_clock()
        self._n_asked += 1
        ticket = _Ticket(goal, self._n_asked)
        if self._n_waiting >= MOST_WAITING:
            sentence = f'{MOST_WAITING} requests wait for their answers already: ask again later'
            self._host.warning(sentence, WARNING_PERIOD)
            return self._answered(Outcome(ErrorCode.PREEMPTED, sentence), ticket)
        self._open.add(ticket)
        self._n_waiting += 1
        self._n_requests += 1
        try:
            async with self._own_turn():
                outcome = await self._work(ticket, begin)
            return self._answered(outcome, ticket)
        finally:
            self._n_waiting -= 1
            self._open.discard(ticket)

    def _answered(self, outcome: Outcome, ticket: _Ticket) -> Outcome:
        """Publish the answer of a request; return its outcome with the number."""
        # A long sentence is cut before the number, which clients look for.
        ending = f'; answer {ticket.request}'
        begin = one_line(outcome.sentence, LONGEST_SENTENCE - len(ending) - LONGEST_CODE)
        sentence = begin + ending
        outcome = replace(outcome, sentence=sentence, number=ticket.request)
        self._publishers.publish_answer(outcome.answer)
        self._unreported.append(outcome)
        return outcome

    def _conclude(self, outcome: Outcome) -> None:
        """Report an outcome, and have its motion shown."""
        self._report.conclude(outcome)
        if outcome.trajectory is not None:
            self._unseen = outcome

    def cancel(self) -> int:
        """Cancel the requests that have published no motion yet; return their number."""
        ended, self._open, self._resumption = self._open, set(), None
        for ticket in ended:
            ticket.is_cancelled = True
            if ticket.request == self._pursued:
                self._given_up = ticket.goal, *CANCELLED
        return len(ended)

    def withdraw(self, goal: PointingGoal) -> None:
        """Cancel what is planned for this goal, unless its motion is published already."""
        for ticket in self._open.copy():
            if ticket.goal is goal:
                ticket.is_cancelled = True
                self._open.discard(ticket)
        if self._resumption is not None and self._resumption.goal is goal:
            self._resumption = None

    def pursues(self, goal: PointingGoal) -> bool:
        """Return whether a motion to this goal is planned, or will be after a stop."""
        return any(t.goal is goal for t in self._open) or any(
            stop.goal is goal and stop.is_replanned for stop in self._monitor.watch.stops
        )

    def why_given_up(self, goal: PointingGoal) -> tuple[ErrorCode, str] | None:
        """Return how the last try after a stop ended, where this goal was given up then."""
        given_up, code, sentence = self._given_up
        return (code, sentence) if given_up is goal else None

    def close(self) -> None:
        """End all work; nothing is published afterwards, and no request may follow."""
        self._is_closed = True
        self.cancel()
        self._monitor.close()
        # Who waits hears of it, as far as that is possible.
        with suppress(Exception):
            self._conclude_answered()
            self._note_end()
        self._host.close()

    @asynccontextmanager
    async def _own_turn(self) -> AsyncIterator[None]:
        """Give a turn, once those that were taken before have ended."""
        before, turn = self._turn, Wait[None]()
        self._turn = turn
        try:
            await before
            yield
        finally:
            turn.give(None)

    async def _work(self, ticket: _Ticket, begin: float, patience: float | None = None) -> Outcome:
        """
        Plan for a ticket, whose request began at a time [s], and publish the motion.

        patience: how long to plan again while the wearer moves [s]; None: `time_limit`.
        """
        parameters = await self._parameters_for(ticket)
        try:
            outcome = await self._plan(ticket, parameters, patience)
            is_cancelled = outcome.trajectory is None and ticket.is_cancelled
            if is_cancelled and outcome.code is not ErrorCode.PREEMPTED:
                outcome = replace(outcome, code=CANCELLED[0], sentence=CANCELLED[1])
        except Exception as problem:
            # After any error the caller gets an answer, and the node continues.
            self._host.error(traceback.format_exc())
            outcome = Outcome(
                ErrorCode.FAILURE, sentence_of(problem), incident=incident_of(problem)
            )
        sentence = outcome.sentence
        if outcome.incident is not None:
            sentence += await self._keep(outcome.incident, parameters.incident_path)
        if outcome.trajectory is None:
            return replace(outcome, sentence=sentence)
        if not self._publishers.has_listener():
            sentence += f'; nobody is subscribed to {self._publishers.motion_topic}'
        if outcome.parameters is not None and outcome.parameters.stands_still:
            sentence += f'; {NO_PROMISE}'
        took = self._host.steady() - begin
        return replace(outcome, sentence=sentence, response_time=took)

    async def _plan(
        self, ticket: _Ticket, parameters: RequestParameters, patience: float | None
    ) -> Outcome:
        """
        Return the outcome of a request, planned again while a wearer who moves is in its way.

        After a time [s], or `time_limit`, the last outcome stands.
        """
        longest = parameters.options.time_limit if patience is None else patience
        monitor, begin = self._monitor, self._host.steady()
        n_faults = monitor.watch.n_faults
        end, latest = begin + longest, begin + min(RAY_PATIENCE, parameters.options.time_limit)
        while True:
            begin = self._host.steady()
            blocked = await self._await_clear_ray(parameters, ticket, latest)
            if blocked is not None:
                return blocked
            # What the wearer took does not count.
            end += self._host.steady() - begin
            n_stops = monitor.watch.n_stops

            async def publish(
                outcome: Outcome, revalidation: Revalidation, n_stops: int = n_stops
            ) -> Outcome | None:
                assert outcome.trajectory is not None
                # When it begins is known once it is published.
                show = self._publishers.prepared(outcome.trajectory, revalidation.parameters)
                await self._host.read()
                # From here on nothing is awaited: no message comes in between.
                return self._publish(ticket, outcome, revalidation, (n_stops, n_faults), show)

            outcome = await plan_request(
                self._host,
                self._inputs,
                parameters,
                lambda: ticket.is_cancelled,
                publish,
                ticket.goal,
                monitor.hold,
            )
            may_change = outcome.is_outdated or (
                outcome.is_in_the_way and self._inputs.is_wearer_moving()
            )
            if not may_change or ticket.is_cancelled or self._host.steady() >= end:
                return outcome
            await self._host.sleep(AGAIN)
            parameters = await self._parameters_for(ticket)

    async def _parameters_for(self, ticket: _Ticket) -> RequestParameters:
        """Return the parameters of a plan, once it is known whether the body stands still."""
        end = self._host.steady() + LONGEST_UNKNOWN
        while not ticket.is_cancelled and self._host.steady() < end:
            left = self._inputs.time_until_known(self._host.steady())
            if not self._report.parameters.stands_still or left <= 0.0:
                break
            await self._host.sleep(min(left, AGAIN))
        return self._report.parameters

    def _require_same_source(self, parameters: RequestParameters) -> None:
        """Raise RequestError where it is not known any more that the body stands still."""
        is_standing = self._report.parameters.stands_still
        left = self._inputs.time_until_known(self._host.steady())
        if is_standing != parameters.stands_still or (is_standing and left > 0.0):
            raise RequestError(
                ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                'another body came while the motion was planned, expected the same one while it '
                'stands still, or a stream of them',
            )

    async def _await_clear_ray(
        self, parameters: RequestParameters, ticket: _Ticket, latest: float
    ) -> Outcome | None:
        """
        Let the wearer take a hand out of the pointing ray of an arm at rest, until a time [s].

        Whatever the arm did, its ray would sweep over the hand first. Return how the request ends
        where it stays there, or another one has come; None: the ray is clear, or nothing is known
        of a wearer who moves.
        """
        box, is_held = self._crossing_ray(parameters), False
        try:
            while box and not ticket.is_cancelled:
                if any(other.request > ticket.request for other in self._open):
                    return Outcome(*OVERTAKEN)
                if self._host.steady() >= latest:
                    return Outcome(
                        ErrorCode.START_STATE_IN_COLLISION,
                        f'RAY_BLOCKED: {box} is in the pointing ray of the arm at rest, or about '
                        'to be, which would sweep over it: expected the ray clear',
                    )
                is_held = True
                self._report.ray_blocked_by(box)
                await self._host.sleep(AGAIN)
                box = self._crossing_ray(parameters)
            return None
        finally:
            if is_held:
                self._report.ray_blocked_by('')

    def _crossing_ray(self, parameters: RequestParameters) -> str:
        """
        Return which box is in the pointing ray of an arm at rest, or will be soon.

        Empty: none is; the arm moves, or is itself too near to the wearer and has to leave; or he
        stands still, and would leave the ray to the arm.
        """
        if parameters.execution.separation is None and not self._inputs.is_wearer_moving():
            return ''
        now, required = self._host.now(), parameters.required
        try:
            joints = self._inputs.joints_at(now, parameters.joint_timeout)
            scene = self._inputs.scene_at(now, parameters)
        except RequestError:
            return ''
        if joints.is_moving(now):
            return ''
        q = joints.mean_positions()
        if not is_place_free(q, changed(required, ray_guard_length=0.0), scene):
            return ''
        return box_in_ray(q, required, scene) or box_in_ray(
            q, required, self._inputs.expected_scene()
        )

    def _publish(
        self,
        ticket: _Ticket,
        outcome: Outcome,
        revalidation: Revalidation,
        counts: tuple[int, int],
        show: Callable[[float], None],
    ) -> Outcome | None:
        """
        Publish the motion of a request, and have it monitored; return the outcome with its stamp.

        None where it is too late; raise RequestError where it is no longer valid. counts: of stops
        and faults, as in `execution.event.Begin`.
        """
        monitor, parameters = self._monitor, revalidation.parameters
        require_not_cancelled(lambda: ticket.is_cancelled)
        self._require_same_source(parameters)
        revalidation.require_fit()
        if revalidation.is_late():
            return None
        trajectory, plan, snapshot = outcome.trajectory, outcome.plan, outcome.snapshot
        assert trajectory is not None and plan is not None and snapshot is not None
        now = self._host.now()
        self._report.body_used(self._inputs.body_age(now))
        handover, start = outcome.handover, now + ahead(parameters.execution.controller_delay)
        planned = ExecutingMotion(
            trajectory=trajectory,
            start_time=start if handover is None else handover.time,
            target_distance=plan.target_distance,
            escape_time=plan.escape_time,
        )
        monitor.begin(
            planned,
            snapshot.goal,
            parameters,
            *counts,
            lambda: show(planned.start_time),
            math.inf if handover is None else handover.joins,
            None if handover is None else handover.before,
        )
        # From here on the request cannot be cancelled.
        self._open.discard(ticket)
        self._pursued, self._given_up = ticket.request, (None, *CANCELLED)
        self._report.pursued(ticket.request)
        # As a whole it is published with what leads to it.
        whole = monitor.watch.running if parameters.execution.separation is None else None
        published = planned if whole is None else whole
        return replace(outcome, stamp=stamp_of(published.start_time))

    def follow_up(self) -> None:
        """Report and show what was planned; check stops a second time, and plan again."""
        self._conclude_answered()
        self._show_newest()
        self._save_if_failed()
        watch = self._monitor.watch
        if watch.running is None or watch.rules.execution.separation is not None:
            self._publishers.withdraw_whole()
        now, present = self._host.now(), self._host.steady()
        for stop in self._monitor.take_stops():
            self._host.begin(self._check_stop(stop))
            if stop.goal is not None and not stop.is_replanned:
                # Also what was to be tried again after an earlier stop.
                self.withdraw(stop.goal)
            if stop.is_replanned and stop.goal is not None and not self._is_closed:
                self._discard_resumption()
                duration = stop.trajectory.duration
                self._resumption = _Resumption(
                    _Ticket(stop.goal, self._pursued or 0),
                    stop.goal,
                    stop.n_motions,
                    self._n_requests,
                    now + duration,
                    present + duration + LONGEST_SETTLING,
                    present + duration + self._report.parameters.patience,
                    is_during_stop=stop.scene is not None,
                )
                self._open.add(self._resumption.ticket)
        resumption = self._resumption
        if resumption is not None and self._is_overtaken(resumption):
            self._give_up(resumption, *OVERTAKEN)
            self._discard_resumption()
        elif resumption is not None and resumption.is_due(self._inputs.reading, present):
            self._resumption = None
            self._host.begin(self._resume(resumption))
        self._note_end()

    def _conclude_answered(self) -> None:
        """Report the outcomes whose answers have left meanwhile."""
        outcomes, self._unreported = self._unreported, []
        for outcome in outcomes:
            self._conclude(outcome)

    def _give_up(self, resumption: _Resumption, code: ErrorCode, sentence: str) -> None:
        """Keep why the goal of a stopped motion is given up, unless another motion has begun."""
        if resumption.n_motions == self._monitor.watch.n_motions:
            self._given_up = resumption.goal, code, sentence

    def _note_end(self) -> None:
        """Report a goal that is not pursued any more before the arm has arrived."""
        monitor, goal = self._monitor, self._monitor.watch.goal
        if goal is None or monitor.watch.is_monitoring or self.pursues(goal):
            return
        if self._pursued is not None:
            self._pursued = None
            if not monitor.watch.has_arrived:
                why = self.why_given_up(goal)
                stopped = monitor.watch.sentence or monitor.watch.stop_reason
                self._report.given_up(stopped if why is None else answer(*why))
        if monitor.watch.running is None:
            self._report.nothing_runs()

    def _is_overtaken(self, resumption: _Resumption) -> bool:
        """Return whether one was commanded since its stop, or requested since its first try."""
        is_requested = resumption.n_requests != self._n_requests and not resumption.is_first
        return is_requested or resumption.n_motions != self._monitor.watch.n_motions

    def _discard_resumption(self) -> None:
        if self._resumption is not None:
            self._open.discard(self._resumption.ticket)
            self._resumption = None

    async def _resume(self, resumption: _Resumption) -> None:
        """Plan again for the goal of a motion that was stopped."""
        try:
            async with self._own_turn():
                await self._try_again(resumption)
        except Exception as problem:
            # Nobody waits for it any more.
            self._open.discard(resumption.ticket)
            self._give_up(resumption, ErrorCode.FAILURE, sentence_of(problem))
            raise

    async def _try_again(self, resumption: _Resumption) -> None:
        ticket = resumption.ticket
        if ticket.is_cancelled or self._is_overtaken(resumption):
            self._give_up(resumption, *(CANCELLED if ticket.is_cancelled else OVERTAKEN))
            self._open.discard(ticket)
            return
        begin = self._host.steady()
        n_requests = resumption.n_requests if not resumption.is_first else self._n_requests
        outcome = await self._work(ticket, begin, 0.0)
        is_solved = outcome.trajectory is not None
        if resumption.is_during_stop and not is_solved:
            self._resumption = replace(resumption, is_during_stop=False)
            return
        is_last = outcome.code in FINAL or is_solved or begin >= resumption.end
        if is_solved or resumption.is_first:
            self._conclude(outcome)
        elif is_last:
            self._report.revise(outcome.code, outcome.sentence)
        if not is_solved and (resumption.is_first or is_last):
            self._monitor.report_hold(outcome.text)
        if not is_last:
            self._resumption = replace(
                resumption,
                n_requests=n_requests,
                stopped=math.inf,
                latest=begin + RESUME_PERIOD,
                is_first=False,
            )
        else:
            if not is_solved:
                self._give_up(resumption, outcome.code, outcome.sentence)
            self._open.discard(ticket)

    async def _check_stop(self, stop: Stop) -> None:
        """Have the second checker check a stop that was published as proven free."""
        incident = await incident_of_stop(stop, self._host)
        if incident is not None:
            parameters = cast(RequestParameters, stop.parameters)
            noted = await self._keep(incident, parameters.incident_path)
            self._host.error(f'fail-safe stop: {incident.sentence}{noted}')

    async def save(self) -> str:
        """Have the last events of the monitor written to a file; return its name."""
        folder = self._report.parameters.incident_path
        try:
            return str(await self._host.help(keep_flight, self._monitor.flight, folder))
        except TimeoutError as problem:
            raise RecordError(f'no flight record was written: {problem}') from problem

    def _save_if_failed(self) -> None:
        """Have them written once after an error, when the arm rests, which needs the machine."""
        monitor, present = self._monitor, self._host.steady()
        if (
            monitor.watch.n_faults != self._n_faults
            and not monitor.watch.is_active(self._host.now())
            and present >= self._may_save
        ):
            # An error that comes again and again is in the same record.
            self._n_faults, self._may_save = monitor.watch.n_faults, present + MEMORY
            self._host.begin(self._save_fault())

    async def _save_fault(self) -> None:
        """Have them written since something failed."""
        try:
            what = f'what led to it is in {await self.save()}'
        except RecordError as problem:
            what = str(problem)
        self._host.error(f'{self._monitor.watch.stop_reason}: {what}')

    async def _keep(self, incident: Incident, folder: Path) -> str:
        """Have an incident written to a file; return what to add to the answer."""
        try:
            noted, file = await self._host.help(keep, incident, folder)
        except TimeoutError as problem:
            noted, file = f'; no file was written to replay it: {problem}', None
        self._report.incident(file)
        with suppress(RecordError):
            await self.save()
        return noted

    def _show_newest(self) -> None:
        """
        Have the newest motion shown, if there is a subscriber.

        That takes the interpreter for several milliseconds, which could delay a stop.
        """
        present, unseen = self._host.steady(), self._unseen
        if (
            unseen is not None
            and present - self._shown >= SHORTEST_SHOW
            and self._publishers.is_view_subscribed()
        ):
            self._unseen, self._shown = None, present
            self._host.begin(self._show(unseen))

    async def _show(self, outcome: Outcome) -> None:
        """Publish what shows a motion."""
        trajectory, parameters, snapshot = outcome.trajectory, outcome.parameters, outcome.snapshot
        assert trajectory is not None and parameters is not None and snapshot is not None
        await self._host.help(
            self._publishers.publish_view,
            trajectory,
            parameters,
            snapshot.scene,
            snapshot.goal.target,
        )
