# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
An arm in virtual time that is asked for target after target beside a wearer.

The requests are those of the planner's node, `requests.request_queue`: each is planned for from
what is known then, and its motion begins, from rest or as a handover, if what is known by then
allows it still. After a stop the same target is planned for again.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.execution.commitments import rate_at
from rrth_planner.execution.event import Reset
from rrth_planner.execution.watch import MonitorState
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.status import ErrorCode
from rrth_planner.rehearsal.virtual_ends import LastWord, MonitorEnd, NoPublishers, VirtualInputs
from rrth_planner.rehearsal.virtual_host import VirtualHost
from rrth_planner.rehearsal.world import World
from rrth_planner.requests.parameters import RequestParameters
from rrth_planner.requests.request_queue import PERIOD, PlanQueue

# What the arm does is looked at so often [s].
GLANCE_PERIOD = 0.02
# An arm that aims this near to its target has arrived [m].
AIMS = 0.02
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
    replaced : float
        The share of targets that the next one replaces while the arm moves.

    """

    pause: float = 1.0
    gives_up: float = 10.0
    replaced: float = 0.0


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
        Why it was not reached, where that is known.
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
        parameters: RequestParameters,
        rules: SessionRules,
        draw: Callable[[], Array],
        seed: int,
    ) -> None:
        """Begin with no target."""
        self.world, self._host, self._rules = world, host, rules
        self._draw, self._rng = draw, np.random.default_rng((seed, 4))
        self._said = LastWord(parameters)
        self._queue = PlanQueue(
            *(host, VirtualInputs(world), self._said, NoPublishers(), MonitorEnd(world))
        )
        self.pursuits: list[Pursuit] = []
        self.glances: list[Glance] = []
        self._pursuit: Pursuit | None = None
        self._doing = IDLE
        world.timeline.every(GLANCE_PERIOD, self._glance)
        world.timeline.every(PERIOD, self._follow_up)
        host.begin(self._ask())

    def _follow_up(self) -> None:
        if not self.world.is_still:
            self._queue.follow_up()

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
        elif watch.state is MonitorState.HOLDING:
            rate, cause = 0.0, word_of(self._said.code)
        else:
            rate = 0.0
        if self._pursuit is not None and rate > 0.0:
            self._pursuit.slowest = min(self._pursuit.slowest, rate)
        self.glances.append(Glance(now, doing, watch.state, rate, cause))

    async def _ask(self) -> None:
        """Want one target after the other."""
        while True:
            self._doing = IDLE
            await self._host.sleep(self._rules.pause)
            self._doing, outcome = PLANNING, REPLACED
            while outcome == REPLACED:
                # After one that is replaced the next one comes while the arm moves.
                outcome = await self._pursue(self._begin())
            self._pursuit = None

    def _begin(self) -> Pursuit:
        """Return another target."""
        self._pursuit = Pursuit(self._draw(), self._host.now())
        self.pursuits.append(self._pursuit)
        return self._pursuit

    async def _pursue(self, pursuit: Pursuit) -> str:
        """Have the arm aim at a target; return what became of it."""
        host, watch = self._host, self.world.monitor.watch
        replaced_at = math.inf
        if self._rng.random() < self._rules.replaced:
            replaced_at = host.now() + float(self._rng.uniform(0.1, 1.5))
        if watch.commitments.fault:
            self.world.take(Reset(self.world.moment()))
        before = host.n_plans, watch.n_stops, watch.n_motions
        goal = PointingGoal(pursuit.target)
        answered, outcome = await self._queue.respond(goal), ''
        if answered.trajectory is None:
            outcome, pursuit.sentence = word_of(answered.code), answered.sentence
        while not outcome:
            outcome = self._outcome(pursuit, goal, replaced_at)
            await host.sleep(0.0 if outcome else GLANCE_PERIOD)
        watch = self.world.monitor.watch
        now = host.n_plans, watch.n_stops, watch.n_motions
        counts = (one - other for one, other in zip(now, before, strict=True))
        pursuit.n_plans, pursuit.n_stops, pursuit.n_begun = counts
        pursuit.outcome, pursuit.ended = outcome, host.now()
        return outcome

    def _outcome(self, pursuit: Pursuit, goal: PointingGoal, replaced_at: float) -> str:
        """Return what became of a target whose motion has begun; empty: nothing yet."""
        monitor, queue, now = self.world.monitor, self._queue, self._host.now()
        watch = monitor.watch
        if not watch.is_monitoring and not queue.pursues(goal):
            if watch.has_arrived:
                return REACHED if self._aims(pursuit.target) else 'moved'
            why = queue.why_given_up(goal)
            pursuit.sentence = watch.stop_reason if why is None else why[1]
            return 'stopped' if why is None else word_of(why[0])
        if watch.is_monitoring and now >= replaced_at:
            return REPLACED
        if now >= pursuit.asked + self._rules.gives_up:
            queue.withdraw(goal)
            monitor.fail('the target is given up', is_replanned=False, is_fault=False)
            return GAVE_UP
        return ''

    def _aims(self, target: Array) -> bool:
        reading = self.world.reading
        arm = self.world.rules.required.arm
        return reading is not None and pointing_error(arm, reading.positions, target) < AIMS


def word_of(code: ErrorCode) -> str:
    """Return a code in words."""
    return code.name.lower().replace('_', ' ')
