# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
An arm in virtual time that is asked for target after target beside a wearer.

Each target is planned for by the real planner from what is known then. Its answer comes after a
latency; what is known by then has to allow the motion still, and it begins, from rest or as a
handover. After a stop the same target is planned for again.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.collision.trajectory_validation import is_proven_free
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.command import ahead
from rrth_planner.execution.commitments import rate_at
from rrth_planner.execution.decide import MARGIN_LEFT
from rrth_planner.execution.event import Begin, Hold, Reset, StopsTaken
from rrth_planner.execution.executing_motion import (
    ExecutingMotion,
    FOLLOWS,
    LONGEST_LAG,
    predict_start_state,
)
from rrth_planner.execution.expected_wearer import is_expected_free
from rrth_planner.execution.handover import Handover, LATE, LEADS
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.remaining_motion import is_place_free
from rrth_planner.execution.watch import MonitorState, Stop
from rrth_planner.io.settings import PlanSettings
from rrth_planner.model.arm import pointing_error, reach_to
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode, PlanStatus
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.rehearsal.virtual_host import VirtualHost
from rrth_planner.rehearsal.world import World

# A request that the wearer was in the way of, and a stopped one, is tried again after [s].
AGAIN, RESUME_AGAIN = 0.01, 0.05
# A wearer whose hand is in the ray of an arm at rest has so long to take it out [s].
RAY_PATIENCE = 2.0
# An arm may come to rest so much later than its stop [s].
LONGEST_SETTLING = 1.0
# What the arm does is looked at so often [s].
GLANCE_PERIOD = 0.02
# An arm that aims this near to its target has arrived [m].
AIMS = 0.02
# Why there is no motion, where the wearer, who may move on, is in the way.
IN_THE_WAY = (
    PlanStatus.START_IN_COLLISION,
    PlanStatus.GOAL_IN_COLLISION,
    PlanStatus.SAMPLE_LIMIT,
)
OUTDATED = (
    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
    ErrorCode.START_STATE_IN_COLLISION,
    ErrorCode.START_STATE_INVALID,
)
REACHED, GAVE_UP, REPLACED = 'aimed', 'gave up', 'replaced'
# What the arm does in the time between two looks.
IDLE, PLANNING, MOVING, STOPPING, WAITING = (
    *('no target', 'planning', 'moving', 'stopping', 'at rest on its way'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionRules:
    """
    What somebody wants, and how long he waits for it.

    Parameters
    ----------
    pause : float
        From a target that was reached or given up to the next one [s].
    gives_up : float
        A target is given up so long after it was asked for [s].
    patience : float
        So long after a stop the same target is tried again [s].
    replaced : float
        The share of targets that the next one replaces while the arm moves.
    start_tolerance : float
        Greatest distance of a joint from where its motion begins [rad].

    """

    pause: float = 1.0
    gives_up: float = 10.0
    patience: float = 5.0
    replaced: float = 0.0
    start_tolerance: float = 0.002


@dataclass(slots=True)
class Pursuit:
    """
    What became of a target.

    Parameters
    ----------
    target : ndarray, shape (3,)
        [m].
    asked, ended : float
        When it was asked for, and reached or given up [s].
    outcome : str
        REACHED, GAVE_UP, REPLACED, or why there was no motion.
    sentence : str
        The last answer.
    n_plans, n_stops, n_begun : int
    slowest : float
        Least rate of its motions but for 0, of 1.

    """

    target: Array
    asked: float
    ended: float = math.nan
    outcome: str = ''
    sentence: str = ''
    n_plans: int = 0
    n_stops: int = 0
    n_begun: int = 0
    slowest: float = 1.0

    @property
    def took(self) -> float:
        """From asking to the end [s]."""
        return self.ended - self.asked


@dataclass(frozen=True, slots=True)
class Glance:
    """
    What the arm does at a time [s].

    rate: of its motion, of 1; cause: what it waits for, where it does not move at its full rate.
    """

    time: float
    doing: str
    state: MonitorState
    rate: float
    cause: str


@dataclass(frozen=True, slots=True)
class _Answer:
    """why: empty where a motion has begun; may_pass: whether another try may find one."""

    why: str
    sentence: str
    may_pass: bool


class Session:
    """
    Somebody who asks, and what becomes of it.

    Parameters
    ----------
    world : World
        Beside whom.
    draw : callable
        Returns the next target, (3,) [m].
    seed : int
        Of plans.

    """

    def __init__(
        self,
        world: World,
        host: VirtualHost,
        settings: PlanSettings,
        rules: SessionRules,
        draw: Callable[[], Array],
        seed: int,
        longest: float,
    ) -> None:
        """Begin with no target; longest: a request is tried again until then [s]."""
        self.world, self._host, self._settings, self._rules = world, host, settings, rules
        self._draw, self._rng = draw, np.random.default_rng((seed, 2))
        self._longest = longest
        self.pursuits: list[Pursuit] = []
        self.glances: list[Glance] = []
        self._pursuit: Pursuit | None = None
        self._doing, self._cause = IDLE, ''
        world.timeline.every(GLANCE_PERIOD, self._glance)
        host.begin(self._ask())

    def _glance(self) -> None:
        watch, now = self.world.monitor.watch, self.world.timeline.now
        rate, doing, cause = 1.0, self._doing, ''
        if doing == IDLE:
            pass
        elif watch.state is MonitorState.MONITORING:
            doing, known = MOVING, watch.commitments
            if known.is_active and not known.is_whole:
                rate = rate_at(known, now)
                if rate < 0.01:
                    doing = WAITING
                cause = known.blocked_by.box if rate < 0.995 else ''
        elif watch.state is MonitorState.STOPPING and watch.is_active(now):
            doing, rate, cause = STOPPING, 0.0, watch.stop_reason
        else:
            rate, cause = 0.0, self._cause
        if self._pursuit is not None and rate > 0.0:
            self._pursuit.slowest = min(self._pursuit.slowest, rate)
        self.glances.append(Glance(now, doing, watch.state, rate, cause))

    async def _ask(self) -> None:
        """Want one target after the other."""
        while True:
            self._doing, self._cause = IDLE, ''
            await self._host.sleep(self._rules.pause)
            pursuit = Pursuit(self._draw(), self._host.now())
            self._pursuit = pursuit
            self.pursuits.append(pursuit)
            self._doing = PLANNING
            while True:
                replaced_at = math.inf
                if self._rng.random() < self._rules.replaced:
                    replaced_at = self._host.now() + float(self._rng.uniform(0.1, 1.5))
                pursuit.outcome = await self._pursue(pursuit, replaced_at)
                pursuit.ended = self._host.now()
                if pursuit.outcome != REPLACED:
                    break
                # The next one comes while the arm moves.
                pursuit = Pursuit(self._draw(), self._host.now())
                self._pursuit = pursuit
                self.pursuits.append(pursuit)
            self._pursuit = None

    async def _pursue(self, pursuit: Pursuit, replaced_at: float) -> str:
        """Have the arm aim at a target; return what became of it."""
        goal, host, monitor = PointingGoal(pursuit.target), self._host, self.world.monitor
        if monitor.watch.commitments.fault:
            self.world.take(Reset(self.world.moment()))
        self._take_stops()
        end = pursuit.asked + self._rules.gives_up
        answer = await self._requested(goal, pursuit, self._longest)
        while not answer.why:
            stop = await self._follow(end, replaced_at)
            if stop is None and host.now() >= replaced_at and monitor.watch.is_monitoring:
                return REPLACED
            if stop is None and monitor.watch.has_arrived:
                return REACHED if self._aims(pursuit.target) else 'moved'
            if stop is None:
                await self._cancel()
                return GAVE_UP
            pursuit.n_stops += 1
            pursuit.sentence = monitor.watch.stop_reason
            if not stop.is_replanned:
                return 'stopped'
            answer = await self._resumed(goal, pursuit, stop, end)
        return answer.why

    async def _follow(self, end: float, replaced_at: float) -> Stop | None:
        """Return the stop that ends the motion; None: it has arrived, or it is time to end it."""
        host, monitor = self._host, self.world.monitor
        while True:
            stops = self._take_stops()
            if stops:
                return stops[-1]
            watch, now = monitor.watch, host.now()
            if watch.running is None or now >= min(end, replaced_at):
                return None
            await host.sleep(GLANCE_PERIOD)

    async def _cancel(self) -> None:
        monitor = self.world.monitor
        monitor.fail('the target is given up', is_replanned=False, is_fault=False)
        while monitor.watch.is_active(self._host.now()):
            await self._host.sleep(GLANCE_PERIOD)

    def _take_stops(self) -> tuple[Stop, ...]:
        stops = self.world.monitor.watch.stops
        if stops:
            self.world.take(StopsTaken(self.world.moment()))
        return stops

    def _aims(self, target: Array) -> bool:
        reading = self.world.reading
        arm = self.world.rules.arm
        return reading is not None and pointing_error(arm, reading.positions, target) < AIMS

    async def _resumed(
        self, goal: PointingGoal, pursuit: Pursuit, stop: Stop, give_up: float
    ) -> _Answer:
        """Plan for the goal of a motion again that was stopped, until patience is over."""
        host, duration = self._host, stop.trajectory.duration
        stopped = host.now() + duration
        end = min(stopped + self._rules.patience, give_up)
        if stop.scene is not None:
            # The stop is proven: at once, as a handover from it.
            answer = await self._attempt(goal, pursuit)
            if not answer.why:
                return answer
        latest = max(stopped, host.now()) + LONGEST_SETTLING
        while host.now() < latest and not self._rests_since(stopped):
            await host.sleep(RESUME_AGAIN)
        while True:
            answer = await self._attempt(goal, pursuit)
            if not answer.why or not answer.may_pass or host.now() >= end:
                return answer
            await host.sleep(RESUME_AGAIN)

    def _rests_since(self, stopped: float) -> bool:
        reading, rest_speed = self.world.reading, self.world.rules.rest_speed
        return (
            reading is not None
            and reading.received >= stopped
            and not reading.is_moving(reading.taken, rest_speed)
        )

    async def _requested(self, goal: PointingGoal, pursuit: Pursuit, patience: float) -> _Answer:
        """Plan for a goal, again and again while a wearer who moves is in the way."""
        host, end = self._host, self._host.now() + patience
        await self._await_clear_ray()
        while True:
            answer = await self._attempt(goal, pursuit)
            if not answer.why or not answer.may_pass or host.now() >= end:
                return answer
            await host.sleep(AGAIN)

    async def _await_clear_ray(self) -> None:
        """Let a wearer take a hand out of the pointing ray of an arm at rest."""
        world, host, end = self.world, self._host, self._host.now() + RAY_PATIENCE
        rules = world.rules
        while host.now() < end and world.reading is not None and world.scene.boxes:
            q, length = world.reading.positions, rules.ray_guard_length
            if world.reading.is_moving(host.now(), rules.rest_speed) or not (
                not is_place_free(q, rules.arm, world.scene, rules.margin, length)
                and is_place_free(q, rules.arm, world.scene, rules.margin, 0.0)
            ):
                return
            self._cause = 'hand in the ray at rest'
            await host.sleep(AGAIN)

    async def _attempt(self, goal: PointingGoal, pursuit: Pursuit) -> _Answer:
        """Plan for a goal once, and have the motion begin."""
        world = self.world
        pursuit.n_plans += 1
        try:
            answer = await self._planned(goal)
        except RequestError as problem:
            why = problem.code.name.lower().replace('_', ' ')
            answer = _Answer(why, str(problem), problem.code in OUTDATED)
        except RrthError as problem:
            answer = _Answer('error', str(problem), False)
        finally:
            world.take(Hold(world.moment(), -math.inf))
        pursuit.sentence, self._cause = answer.sentence, answer.why
        pursuit.n_begun += not answer.why
        return answer

    async def _planned(self, goal: PointingGoal) -> _Answer:
        world, host = self.world, self._host
        for lead in LEADS:
            n_stops = world.monitor.watch.n_stops
            now, delay = host.now(), world.rules.controller_delay
            then = now + lead + ahead(delay)
            world.take(Hold(world.moment(), then + LATE))
            running = world.monitor.watch.tracked.command
            reading, scene = self._inputs()
            handover = None
            q_start = reading.mean_positions(world.rules.rest_speed)
            if self._moves(running, then - now):
                handover = self._handover(running, then, lead)
                q_start = handover.start_state.state.positions
            else:
                world.take(Hold(world.moment(), math.inf))
                if running is not None:
                    q_start = running.trajectory.positions[-1]
            question = self._question(goal, scene, q_start, handover)
            plan = await host.plan(question)
            if plan.trajectory is None or plan.status is not PlanStatus.SOLVED:
                is_in_the_way = plan.status in IN_THE_WAY and self._is_wearer_moving()
                return _Answer(plan.status.value, plan.sentence, is_in_the_way)
            if handover is not None:
                if host.now() > handover.deadline:
                    continue
                early = handover.time - handover.publish_ahead - host.now()
                if early > 0.0:
                    await host.sleep(early)
            self._require_fit(goal, plan, scene, handover, running)
            if world.monitor.watch.n_stops != n_stops:
                raise RequestError(
                    ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE,
                    'the arm was stopped while its motion was planned',
                )
            soon = host.now() + ahead(delay)
            motion = ExecutingMotion(
                trajectory=plan.trajectory,
                start_time=soon if handover is None else handover.time,
                target_distance=plan.target_distance,
                escape_time=plan.escape_time,
            )
            joins = math.inf if handover is None else handover.joins
            before = None if handover is None else handover.before
            world.monitor.begin(Begin(world.moment(), motion, goal, world.rules, joins, before))
            return _Answer('', plan.sentence, False)
        raise RequestError(
            ErrorCode.TIMED_OUT,
            f'the arm moves, and no handover was planned and checked within {LEADS[-1]:g} s',
        )

    def _inputs(self) -> tuple[JointReading, Scene]:
        """Return where the arm and the wearer are, or raise RequestError."""
        world, now = self.world, self.world.timeline.now
        if world.reading is None or not world.scene.boxes:
            raise RequestError(
                ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no body or no joint positions yet'
            )
        lost = world.lost_since(math.inf)
        if lost or now - world.measured > world.wire.body_timeout:
            raise RequestError(
                ErrorCode.SENSOR_INFO_STALE,
                f'the body has lost parts: {", ".join(lost)}' if lost else 'the body is too old',
            )
        return world.reading, world.scene

    def _is_wearer_moving(self) -> bool:
        return self.world.is_wearer_moving

    def _moves(self, running: ExecutingMotion | None, span: float) -> bool:
        """Return whether the arm moves, or is about to within a span [s]."""
        world, now = self.world, self.world.timeline.now
        assert world.reading is not None
        if world.reading.is_moving(now, world.rules.rest_speed):
            return True
        return running is not None and running.will_move(now, span)

    def _handover(self, running: ExecutingMotion | None, time: float, lead: float) -> Handover:
        """Return the handover from a moving arm at about a time [s]."""
        world, reading = self.world, self.world.reading
        assert reading is not None
        lag = world.rules.controller_delay + LONGEST_LAG
        if running is None or not running.follows(
            reading.positions, reading.velocities, reading.taken, lag
        ):
            raise RequestError(
                ErrorCode.START_STATE_INVALID, 'the arm moves, and follows no motion that is known'
            )
        start = predict_start_state(
            reading.positions,
            reading.velocities,
            running.trajectory,
            time - reading.taken,
            (reading.taken - running.start_time, 1.0),
        )
        if start.time < running.trajectory.duration:
            time = running.start_time + start.time
        return Handover(time, lead, start, running, world.rules.controller_delay, True)

    def _question(
        self, goal: PointingGoal, scene: Scene, q_start: Array, handover: Handover | None
    ) -> PlanQuestion:
        settings, separation = self._settings, self.world.rules.separation
        return PlanQuestion(
            arm=self.world.rules.arm,
            scene=scene,
            q_start=q_start,
            goal=goal,
            limits=settings.limits,
            options=settings.options,
            margin=settings.margin,
            ray_guard_length=settings.ray_guard_length,
            seed=int(self._rng.integers(2**31)),
            moving=None if handover is None else handover.start_state,
            escape_depth=settings.escape_depth,
            reserve=settings.reserve,
            second_checker=settings.second_checker,
            rules=None if separation is None else separation.rules,
            stop_limits=self.world.rules.stop_limits,
            body_age=max(self.world.timeline.now - self.world.measured, 0.0),
        )

    def _require_fit(
        self,
        goal: PointingGoal,
        plan: MotionPlan,
        planned_beside: Scene,
        handover: Handover | None,
        running: ExecutingMotion | None,
    ) -> None:
        """Raise RequestError where a motion does not fit the arm and the wearer any more."""
        world, motion = self.world, plan.trajectory
        assert motion is not None
        reading, scene = self._inputs()
        self._require_arm(reading, motion, handover, running)
        rules, margin = world.rules, self._settings.margin
        length = self._settings.ray_guard_length
        if not np.array_equal(scene.numbers, planned_beside.numbers):
            distance = reach_to(rules.arm, goal.target, motion.positions[-1])
            free = arm_world(rules.arm, scene, margin, length)
            if not is_proven_free(free, motion, margin, distance, plan.escape_time):
                raise _outdated('the wearer moved while the motion was planned')
        if plan.escape_time == 0.0 and not is_place_free(
            reading.positions, rules.arm, scene, MARGIN_LEFT * margin, length
        ):
            raise RequestError(
                ErrorCode.START_STATE_IN_COLLISION, 'the arm is too near to the wearer'
            )
        whole = ExecutingMotion(trajectory=motion, start_time=0.0, escape_time=plan.escape_time)
        if not is_expected_free(
            whole, 0.0, rules.arm, world.expected(), margin=margin, ray_guard_length=length
        ):
            raise _outdated('the wearer is about to move into the path of the arm')

    def _require_arm(
        self,
        reading: JointReading,
        motion: Trajectory,
        handover: Handover | None,
        running: ExecutingMotion | None,
    ) -> None:
        delay, tolerance = self.world.rules.controller_delay, self._rules.start_tolerance
        if handover is not None:
            assert handover.running is not None
            aside = handover.running.deviation(reading.positions, reading.taken, delay)
            if not aside <= FOLLOWS:
                raise _outdated(f'the arm is {aside:.4f} rad from what it was commanded')
            return
        if self._moves(running, LEADS[0] + ahead(delay)):
            raise _outdated('the arm has begun to move')
        place = reading.mean_positions(self.world.rules.rest_speed)
        moved = float(np.abs(place - motion.positions[0]).max())
        if not moved <= tolerance:
            raise _outdated(
                f'the arm has moved by {moved:.4f} rad, expected {tolerance:g} at most'
            )


def _outdated(sentence: str) -> RequestError:
    return RequestError(ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE, sentence)
