# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the monitor decides about: each event with its time, and with what was known then."""

from dataclasses import dataclass

from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.watch import MonitorRules
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Moment:
    """
    When something happens, and what is known then.

    Parameters
    ----------
    now : float
        By the clock of motions and measurements [s].
    steady : float
        By one that is never set, and does not stand still [s].
    reading : JointReading or None
        Where the arm was last.
    rules : MonitorRules
        Those in effect, for what begins now.
    overdue : str
        Why body or joint positions say nothing of the present any more; empty: they do.

    """

    now: float
    steady: float
    reading: JointReading | None
    rules: MonitorRules
    overdue: str = ''


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """Something that happens at a moment."""

    at: Moment


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """
    A body that came, to learn from how fast its parts are.

    Parameters
    ----------
    measured : ndarray, shape (m,)
        When each box was [s].

    """

    scene: Scene
    measured: Array


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """
    The wearer beside the running motion.

    Parameters
    ----------
    scene : Scene
        Where he is.
    expected : Scene
        Where moving parts of him will be soon, if they go on.
    age : float
        Of that [s].

    """

    scene: Scene
    expected: Scene
    age: float


@dataclass(frozen=True, slots=True, eq=False)
class BodyCame(Event):
    """A body came: sight, if it is new; look, if the running motion is to be checked with it."""

    sight: Sight | None
    look: Look | None


@dataclass(frozen=True, slots=True, eq=False)
class BodyWaited(Event):
    """A body was checked so long after its arrival [s]."""

    waited: float


@dataclass(frozen=True, slots=True, eq=False)
class StopFor(Event):
    """
    The arm is to be stopped for a body.

    phase, then: where it was within its motion, and when that was known [s].
    """

    why: str
    scene: Scene
    phase: float
    then: float


@dataclass(frozen=True, slots=True, eq=False)
class StopUnproven(Event):
    """A stop was commanded that is not proven free of the wearer."""

    stop: ExecutingMotion
    scene: Scene


@dataclass(frozen=True, slots=True, eq=False)
class CommitmentTook(Event):
    """A commitment was found in so long a time [s], be it published or too late for that."""

    took: float


@dataclass(frozen=True, slots=True, eq=False)
class Tick(Event):
    """The inputs and the commanded motion are due to be checked."""


@dataclass(frozen=True, slots=True, eq=False)
class Begin(Event):
    """
    A planned motion is to begin.

    Parameters
    ----------
    rules : MonitorRules
        Of its plan.
    joins : float or None
        The time within what is commanded at which the motion begins [s]; inf: at rest. None: what
        is commanded until then is not known.
    planned_from : ExecutingMotion or None
        What was commanded when it was planned, where that counts.
    n_stops, n_faults : int
        Those of the watch when the motion was planned, and when it was asked for: after another
        one it does not begin.

    """

    planned: ExecutingMotion
    goal: PointingGoal
    rules: MonitorRules
    joins: float | None
    planned_from: ExecutingMotion | None
    n_stops: int
    n_faults: int


@dataclass(frozen=True, slots=True, eq=False)
class NobodyListens(Event):
    """No controller is subscribed to what was commanded."""


@dataclass(frozen=True, slots=True, eq=False)
class Fail(Event):
    """
    Something failed, or the arm is no longer wanted to arrive: it is to stop if it moves.

    Parameters
    ----------
    is_replanned : bool
        Whether to plan again once it is at rest.
    is_fault : bool
        Whether no motion may begin until a reset, with separation.

    """

    why: str
    is_replanned: bool
    is_fault: bool


@dataclass(frozen=True, slots=True, eq=False)
class ClockStepped(Event):
    """The clock was set forward by a step [s], or is paused (0); all else is by the new clock."""

    step: float
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class Hold(Event):
    """What is commanded is to stay until a time [s]: a handover is planned from it."""

    until: float


@dataclass(frozen=True, slots=True, eq=False)
class Reset(Event):
    """Motions may begin again after a fault, and what waits for that goes on."""


@dataclass(frozen=True, slots=True, eq=False)
class Rest(Event):
    """The arm is to stay where it came to rest."""

    why: str


@dataclass(frozen=True, slots=True, eq=False)
class StopsTaken(Event):
    """What was stopped is known to those who plan again."""
