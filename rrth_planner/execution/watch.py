# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""All that is known of what the arm was given, and of what became of that: one frozen value."""

from dataclasses import dataclass, field
from enum import Enum, IntEnum
import math
from typing import Protocol

from rrth_planner.execution.commitments import Commitments, ExecutionRules
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.separation_status import SeparationStatus
from rrth_planner.execution.tracked_motion import TrackedMotion
from rrth_planner.model.frozen import changed
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory

# Stops that were not taken yet: so many of the last ones are kept.
MOST_STOPS = 10
# So many motions one after the other that an arm ignores from their begin on are the last ones.
MOST_IGNORED = 3


class MonitorState(Enum):
    """What the monitor is doing; the values appear in diagnostics."""

    IDLE = 'no motion'
    MONITORING = 'monitoring'
    STOPPING = 'stopping'
    HOLDING = 'holding'


class Level(IntEnum):
    """How bad it is, with the numbers of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


class MonitorRules(Protocol):
    """What decisions take of the parameters of a motion's plan, or of those in effect."""

    @property
    def required(self) -> RequiredClearance:
        """What stays clear of the wearer."""

    @property
    def stop_limits(self) -> MotionLimits:
        """Of fail-safe stops."""

    @property
    def execution(self) -> ExecutionRules:
        """How a motion is executed."""

    @property
    def stands_still(self) -> bool:
        """Whether motions are published as they are planned since the body stands still."""

    @property
    def replan(self) -> bool:
        """Whether a stopped motion is planned again."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlainRules:
    """The rules by themselves, without a node."""

    required: RequiredClearance
    stop_limits: MotionLimits
    execution: ExecutionRules
    stands_still: bool = False
    replan: bool = True


def plain(rules: MonitorRules) -> PlainRules:
    """Return rules by themselves."""
    return PlainRules(
        required=rules.required,
        stop_limits=rules.stop_limits,
        execution=rules.execution,
        stands_still=rules.stands_still,
        replan=rules.replan,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """
    A commanded fail-safe stop, for its second check and for replanning.

    Parameters
    ----------
    goal : PointingGoal or None
        Of the stopped motion.
    parameters : MonitorRules
        Of the stopped motion's plan.
    scene : Scene or None
        The wearer that the stop is proven free of; None: it is not.
    is_replanned : bool
        Whether to plan for the goal again once the arm is at rest.
    n_motions : int
        Number of motions commanded until then.

    """

    trajectory: Trajectory
    goal: PointingGoal | None
    parameters: MonitorRules
    scene: Scene | None
    is_replanned: bool
    n_motions: int


@dataclass(frozen=True, slots=True)
class PendingStop:
    """
    A stop that is still to be published.

    Parameters
    ----------
    since : float
        By a clock that is never set [s].
    is_replanned : bool
        Whether to plan again after it.

    """

    why: str
    since: float
    is_replanned: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Watch:
    """
    The memory of the monitor; `decide.decide` says what follows it.

    Parameters
    ----------
    rules : MonitorRules
        Of the last motion's plan: parameters that are changed later do not apply to it.
    motion_topic : str
        On which a controller is expected to listen.
    tracked : TrackedMotion
        What the controller was given, and where on it the arm is.
    commitments : Commitments
        The same with separation, and what is known of how the wearer moves.
    goal : PointingGoal or None
        Of the last commanded motion.
    sentence, level : str, Level
        About the state.
    separation : SeparationStatus
        How the running motion is executed beside the wearer.
    unfollowed : (Level, str)
        Whether the arm follows what it is given; with OK that it does.
    pending : PendingStop or None
        None: no stop is still to be published.
    stop_reason, stop_level : str, Level
        Of the last stop.
    is_held : bool
        Whether the arm stays where the last stop ends.
    stops : tuple of Stop
        Those that nobody has taken yet.
    waiting : Stop or None
        The last one, where the arm goes on after a reset only.
    withheld : ExecutingMotion or None
        The motion that a stop was to end which was not published, since the commitment, which
        comes to rest by itself, is proven and the stop is not.
    in_the_way_since : float or None
        Since when the wearer has been in the way of the running motion [s].
    n_ignored, is_ignored : int, bool
        How many motions the arm has ignored from their begin on, one after the other, and whether
        it ignores the last one.
    is_doubted : bool
        Whether anything of that kind was reported since the arm has followed a motion.
    has_arrived : bool
        Whether the last motion was executed to its end.
    settles, unsettled_by : float, str
        Until when no motion begins, by a clock that is never set [s], and why.
    is_unstamped : bool
        Whether the next stop begins on reception: the controller's clock may not have stepped.
    n_stops, n_motions, n_faults : int
        A motion that was planned before a stop must not follow it, nor a replanned one another
        motion, nor any an error.

    """

    rules: MonitorRules
    motion_topic: str
    tracked: TrackedMotion = field(default_factory=TrackedMotion)
    commitments: Commitments = field(default_factory=Commitments)
    goal: PointingGoal | None = None
    state: MonitorState = MonitorState.IDLE
    sentence: str = ''
    level: Level = Level.OK
    separation: SeparationStatus = field(default_factory=SeparationStatus)
    unfollowed: tuple[Level, str] = (Level.OK, '')
    pending: PendingStop | None = None
    stop_reason: str = ''
    stop_level: Level = Level.WARN
    is_held: bool = False
    stops: tuple[Stop, ...] = ()
    waiting: Stop | None = None
    withheld: ExecutingMotion | None = None
    in_the_way_since: float | None = None
    n_ignored: int = 0
    is_ignored: bool = False
    is_doubted: bool = False
    has_arrived: bool = False
    settles: float = -math.inf
    unsettled_by: str = ''
    is_unstamped: bool = False
    n_stops: int = 0
    n_motions: int = 0
    n_faults: int = 0

    @property
    def running(self) -> ExecutingMotion | None:
        """The motion that the arm executes, as far as known."""
        return self.tracked.motion

    @property
    def is_monitoring(self) -> bool:
        """Whether a motion is monitored that is not being stopped."""
        return self.state is MonitorState.MONITORING

    def is_active(self, now: float) -> bool:
        """Return whether the arm is to execute a motion or a stop at a time [s]."""
        running = self.running
        return running is not None and (
            self.is_monitoring or now < running.start_time + running.trajectory.duration
        )


def with_commitments(watch: Watch, commitments: Commitments) -> Watch:
    """Return it with other commitments, or itself where they are the same."""
    return watch if commitments is watch.commitments else changed(watch, commitments=commitments)


def with_tracked(watch: Watch, tracked: TrackedMotion) -> Watch:
    """Return it with another tracked motion, or itself where that is the same."""
    return watch if tracked is watch.tracked else changed(watch, tracked=tracked)


def entered(watch: Watch, state: MonitorState, sentence: str, level: Level = Level.WARN) -> Watch:
    """Return it in a state, with a sentence about that."""
    level = level if sentence else Level.OK
    return changed(watch, state=state, sentence=sentence, level=level)


def doubted(watch: Watch, level: Level, why: str) -> Watch:
    """Say, until the arm follows a motion, that it may not be given what it needs."""
    sentence = f'{why}: expected a controller that executes {watch.motion_topic}'
    return changed(watch, is_doubted=True, unfollowed=(level, sentence))


def ignored(watch: Watch, why: str, has_moved: bool = False) -> Watch:
    """Count a motion that the arm ignores; has_moved: it has followed a part of it."""
    # An arm that ignores one motion after the other, as with its drives off, holds.
    n = 0 if has_moved else watch.n_ignored + 1
    level = Level.ERROR if n >= MOST_IGNORED else Level.WARN
    sentence = f'{why} ({n} motions one after the other)' if n > 1 else why
    return doubted(changed(watch, n_ignored=n, is_ignored=True), level, sentence)


def followed(watch: Watch) -> Watch:
    """Withdraw what was said of an arm that follows its motion."""
    return changed(
        watch, n_ignored=0, is_ignored=False, is_doubted=False, unfollowed=(Level.OK, '')
    )


def recorded(
    watch: Watch, stop: Trajectory, scene: Scene | None, rules: MonitorRules, is_replanned: bool
) -> Watch:
    """
    Keep a stop, with the wearer that it is proven free of.

    rules: those in effect now, which say whether anything is planned again.
    """
    is_replanned = is_replanned and rules.replan
    found = Stop(stop, watch.goal, watch.rules, scene, is_replanned, watch.n_motions)
    is_manual = watch.commitments.is_active and watch.rules.execution.is_manual
    waiting = changed(found, scene=None) if is_manual and is_replanned else None
    if is_manual:
        # It goes on after a reset, or a request.
        found = changed(found, is_replanned=False)
    stops = (*watch.stops, found)[-MOST_STOPS:]
    return changed(watch, stops=stops, waiting=waiting, is_held=not found.is_replanned)
