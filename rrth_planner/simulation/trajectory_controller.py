# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What joint_trajectory_controller commands, cycle by cycle, by the rules of its versions.

A cycle at a time commands the state one period later. Of the messages that came since the last
cycle the newest counts. It replaces the present trajectory, as its version does: at once, with one
more piece that leads the arm from the state before to the first point until that is due; or not
before its stamp. One whose stamp has passed is joined where it is by now. Between two points each
joint follows the polynomial of the lowest degree that fits what both have: a line, a cubic or a
quintic. After the last point that one holds.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
import functools

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import MessageError, OptionsError
from rrth_planner.model.trajectory import motion_through, state_at, Trajectory


class ControllerVersion(Enum):
    """
    Releases of the controller that join a message to what they execute in different ways.

    `V4_42` stands for Jazzy, and for what comes later with `allow_trajectory_replacement` false;
    `BLENDING` for what comes after 6.9 with its default, true.
    """

    V4_20 = '4.20'
    V4_42 = '4.42'
    V6_9 = '6.9'
    BLENDING = 'blending'

    @property
    def defers(self) -> bool:
        """Whether a message with a stamp ahead waits until then."""
        return self in (ControllerVersion.V6_9, ControllerVersion.BLENDING)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ControllerState:
    """
    What is commanded or measured of the joints, (dof,) [rad, rad/s, rad/s^2].

    Accelerations that are not measured are NaN: no state that a motion may begin with.
    """

    positions: Array
    velocities: Array
    accelerations: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TimedPoints:
    """
    The points of a trajectory as they were sent: not all need velocities and accelerations.

    Parameters
    ----------
    times : array_like, shape (n,)
        Since the start, >= 0, strictly increasing [s].
    positions : array_like, shape (n, dof)
        [rad or m].
    velocities, accelerations : ndarray, shape (n, dof)
        Rows of NaN where a point has none [rad/s, rad/s^2].

    Attributes
    ----------
    motion : Trajectory or None
        The motion whose points they are, where they are known to be those of one.

    Raises
    ------
    MessageError
        Shapes that differ, positions that are not finite, times that do not increase.

    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    motion: Trajectory | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Validate and freeze times and positions."""
        times = frozen_array(self.times, (None,), 'times', 's', MessageError)
        if not len(times) or times[0] < 0.0 or not (np.diff(times) > 0.0).all():
            raise MessageError('times: expected at least one, from >= 0, strictly increasing [s]')
        shape = (len(times), None)
        positions = frozen_array(self.positions, shape, 'positions', 'rad', MessageError)
        for name in ('velocities', 'accelerations'):
            if getattr(self, name).shape != positions.shape:
                raise MessageError(
                    f'{name}: shape {getattr(self, name).shape}, expected {positions.shape}'
                )
        object.__setattr__(self, 'times', times)
        object.__setattr__(self, 'positions', positions)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Command:
    """
    A trajectory that is executed, or a position that is held.

    Parameters
    ----------
    points : TimedPoints
    start_time : float
        When its time is 0 [s].
    begin : float
        To which time the state before belongs, as the controller has it [s].
    before : ControllerState or None
        The state from which the arm is led to the first point, where that is due later; NaN where
        unknown.

    """

    points: TimedPoints
    start_time: float
    begin: float = 0.0
    before: ControllerState | None = None
    is_holding: bool = False

    @property
    def end_time(self) -> float:
        """When the last point is due [s]."""
        return self.start_time + float(self.points.times[-1])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tolerances:
    """
    How far the arm may be from what is commanded; 0: as far as it likes.

    Parameters
    ----------
    path, goal : array_like, shape (dof,)
        While it moves, and after the last point [rad or m].
    goal_time : float
        By so long after the last point it has to be within `goal` [s]; 0: any time.

    Raises
    ------
    OptionsError
        A value below 0.

    """

    path: Array
    goal: Array
    goal_time: float = 0.0

    def __post_init__(self) -> None:
        """Validate and freeze."""
        for name in ('path', 'goal'):
            label = f'{name}_tolerance'
            value = frozen_array(getattr(self, name), (None,), label, 'rad', OptionsError)
            if not (value >= 0.0).all():
                raise OptionsError(f'{label}: {value.tolist()}, expected values >= 0 [rad]')
            object.__setattr__(self, name, value)
        if not 0.0 <= self.goal_time < np.inf:
            raise OptionsError(f'goal_time: {self.goal_time}, expected >= 0 [s]')


def hold(q: Array) -> Command:
    """Return what holds a position, (dof,) [rad or m]."""
    unknown = np.full((1, len(q)), np.nan)
    points = TimedPoints(
        times=np.zeros(1), positions=np.array([q]), velocities=unknown, accelerations=unknown
    )
    return Command(points=points, start_time=-np.inf, is_holding=True)


def replace_command(
    points: TimedPoints,
    stamp: float,
    now: float,
    before: ControllerState,
    begin: float | None = None,
) -> Command:
    """
    Return what is executed from now on [s], in place of anything else.

    Parameters
    ----------
    stamp : float
        When the trajectory starts [s]; 0: now.
    before : ControllerState
        From where the arm is led to the first point if that is due later: what was commanded, or
        what is measured.
    begin : float, optional
        The time to which that state belongs, as the controller has it [s]; without, now.

    """
    return Command(
        points=points,
        start_time=stamp if stamp != 0.0 else now,
        begin=now if begin is None else begin,
        before=before,
    )


def ramp_to_rest(present: ControllerState, deceleration: Array, now: float) -> Command:
    """Return what takes each joint to rest at a constant deceleration, (dof,) [rad/s^2]."""
    v = present.velocities
    durations = np.abs(v) / deceleration
    times = np.unique(np.concatenate([[0.0], durations]))
    t = np.minimum(times[:, None], durations)
    slowing = np.sign(v) * deceleration
    velocities = np.where(times[:, None] < durations, v - slowing * t, 0.0)
    points = TimedPoints(
        times=times,
        positions=present.positions + v * t - 0.5 * slowing * t**2,
        velocities=velocities,
        # The cubic through both ends is the parabola.
        accelerations=np.full_like(velocities, np.nan),
    )
    return Command(points=points, start_time=now, is_holding=True)


def points_of(motion: Trajectory) -> TimedPoints:
    """Return the points of a motion, which are those of a trajectory already."""
    points: TimedPoints = object.__new__(TimedPoints)
    for name in ('times', 'positions', 'velocities', 'accelerations'):
        object.__setattr__(points, name, getattr(motion, name))
    object.__setattr__(points, 'motion', motion)
    return points


def commanded_state(
    command: Command, time: float, state_of: Callable[[Trajectory, float], Array] = state_at
) -> ControllerState:
    """
    Return what is commanded at a time [s], (dof,) each.

    state_of: `trajectory.state_at`, or what has the same results sooner.
    """
    points = command.points
    since = time - command.start_time
    i = int(points.times.searchsorted(since, side='right')) - 1
    if i < 0 and command.before is not None:
        begin = command.begin - command.start_time
        piece = _lead(command)
        return _state(piece, min(max(since - begin, 0.0), piece.duration))
    if 0 <= i < len(points.times) - 1:
        if points.motion is not None:
            q, v, a = state_of(points.motion, since)
            return ControllerState(positions=q, velocities=v, accelerations=a)
        return _state(_piece(points, i), since - points.times[i])
    return _state_of(points, i)


def is_moving(command: Command, time: float) -> bool:
    """Return whether the last point is not due yet at a time [s]."""
    return time < command.end_time


def deviation(
    command: Command, tolerances: Tolerances, time: float, error: Array
) -> tuple[int, str] | None:
    """
    Return why a trajectory is given up: which joint, and a sentence; None while it is not.

    Parameters
    ----------
    error : ndarray, shape (dof,)
        Commanded minus measured positions [rad or m].

    """
    if command.is_holding:
        return None
    moves = is_moving(command, time)
    allowed = tolerances.path if moves else tolerances.goal
    excess = np.where(allowed > 0.0, np.abs(error) - allowed, -np.inf)
    i = int(excess.argmax())
    if not excess[i] > 0.0:
        return None
    if not moves and not 0.0 < tolerances.goal_time < time - command.end_time:
        return None
    what = (
        'path_tolerance' if moves else f'goal_tolerance {tolerances.goal_time:g} s after its end'
    )
    return i, f'{abs(error[i]):.4g} from what is commanded, expected {what} {allowed[i]:g} [rad]'


# Held cycle after cycle.
@functools.lru_cache(maxsize=8)
def _state_of(points: TimedPoints, i: int) -> ControllerState:
    """Return the state of a point, at rest in what it does not say."""
    last = (points.velocities[i], points.accelerations[i])
    velocity, acceleration = (np.where(np.isnan(row), 0.0, row) for row in last)
    for array in (velocity, acceleration):
        array.setflags(write=False)
    return ControllerState(
        positions=points.positions[i], velocities=velocity, accelerations=acceleration
    )


def _state(piece: Trajectory, time: float) -> ControllerState:
    q, v, a = state_at(piece, time)
    return ControllerState(positions=q, velocities=v, accelerations=a)


# A stretch of a motion comes with every body: of the one before it nothing is asked any more.
@functools.lru_cache(maxsize=8)
def _piece(points: TimedPoints, i: int) -> Trajectory:
    """Return the motion from a point to the next one."""
    rows = [
        (points.positions[k], points.velocities[k], points.accelerations[k]) for k in (i, i + 1)
    ]
    return piece_between(rows[0], rows[1], float(points.times[i + 1] - points.times[i]))


@functools.lru_cache(maxsize=8)
def _lead(command: Command) -> Trajectory:
    """Return the motion from the state before a trajectory to its first point."""
    points, before = command.points, command.before
    assert before is not None
    duration = command.start_time + float(points.times[0]) - command.begin
    return piece_between(
        (before.positions, before.velocities, before.accelerations),
        (points.positions[0], points.velocities[0], points.accelerations[0]),
        duration,
    )


def piece_between(
    first: tuple[Array, Array, Array], last: tuple[Array, Array, Array], duration: float
) -> Trajectory:
    """
    Return the motion between two points, each positions, velocities and accelerations, (dof,).

    Where one of them has no velocities (NaN), a line; where one has no accelerations, the cubic;
    else the quintic, of which those are special cases.
    """
    times, states = np.array([0.0, duration]), np.array([first, last]).swapaxes(0, 1)
    if np.isfinite(states).all():
        return motion_through(times, np.ascontiguousarray(states))
    (p, v, a), (p_end, v_end, a_end) = first, last
    step = p_end - p
    if np.isnan(v).any() or np.isnan(v_end).any():
        v = v_end = step / duration
        a = a_end = np.zeros_like(p)
    elif np.isnan(a).any() or np.isnan(a_end).any():
        # The cubic of Hermite: its second derivatives at both ends.
        a = (6.0 * step - (4.0 * v + 2.0 * v_end) * duration) / duration**2
        a_end = (-6.0 * step + (2.0 * v + 4.0 * v_end) * duration) / duration**2
    return Trajectory(
        times=times,
        positions=np.array([p, p_end]),
        velocities=np.array([v, v_end]),
        accelerations=np.array([a, a_end]),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ControllerRules:
    """
    How a controller is set up.

    Parameters
    ----------
    version : ControllerVersion
    is_from_desired : bool
        `interpolate_from_desired_state` (before 4.22 `open_loop_control`): whether the state
        before a trajectory is what was commanded, or what is measured.
    tolerances : Tolerances or None
        None: none.
    deceleration : ndarray, shape (dof,), or None
        `decelerate_on_cancel`, since 4.39: of a trajectory that is given up [rad/s^2]; None: it
        is held at once.

    """

    version: ControllerVersion = ControllerVersion.V4_42
    is_from_desired: bool = True
    tolerances: Tolerances | None = None
    deceleration: Array | None = None


DEFAULT_RULES = ControllerRules()


class TrajectoryController:
    """The controller of an arm: messages come at any time, `update` is called once a period."""

    def __init__(
        self,
        q: Array,
        period: float,
        rules: ControllerRules = DEFAULT_RULES,
        state_of: Callable[[Trajectory, float], Array] = state_at,
    ) -> None:
        """
        Activate it: it holds a position, (dof,) [rad or m], and is updated every `period` [s].

        That is the last command where there was one, the default, or what is measured. state_of:
        as for `commanded_state`.
        """
        self.period, self.rules, self._state_of = period, rules, state_of
        self.command = hold(np.array(q, dtype=np.float64))
        # Why the last cycle gave its trajectory up, if it did: which joint, and a sentence.
        self.given_up: tuple[int, str] | None = None
        # The last setpoint, and the time of the cycle that found it [s].
        self._last: tuple[ControllerState, float] | None = None
        # The newest message that is not executed yet: points and stamp [s].
        self._message: tuple[TimedPoints, float] | None = None
        # Whether a cycle has left it to wait for its stamp.
        self._is_waiting = False

    def receive(self, points: TimedPoints, stamp: float) -> None:
        """Take a message that starts at a time [s], 0: at once; one that still waits is lost."""
        self._message, self._is_waiting = (points, stamp), False

    def update(self, now: float, measured: ControllerState) -> ControllerState:
        """
        Return what is commanded in the cycle at a time [s], which is the state a period later.

        Where a tolerance is exceeded that is the measured position. Accelerations that are not
        measured are NaN.
        """
        self._take_message(now, measured)
        self.given_up = None
        if self.rules.tolerances is not None:
            commanded = commanded_state(self.command, now, self._state_of)
            error = commanded.positions - measured.positions
            self.given_up = deviation(self.command, self.rules.tolerances, now, error)
            if self.given_up is not None:
                self.cancel(now, measured)
        setpoint = commanded_state(self.command, now + self.period, self._state_of)
        self._last = setpoint, now
        return setpoint

    def cancel(self, now: float, measured: ControllerState) -> None:
        """Give the trajectory up: hold the *measured* position, or slow down from there."""
        deceleration = self.rules.deceleration
        self.command = (
            hold(measured.positions.copy())
            if deceleration is None
            else ramp_to_rest(measured, deceleration, now)
        )

    def _take_message(self, now: float, measured: ControllerState) -> None:
        if self._message is None:
            return
        (points, stamp), version = self._message, self.rules.version
        if version.defers and stamp > now:
            self._is_waiting = True
            return
        before, begin = measured, now
        if self.rules.is_from_desired and self._last is not None:
            before, begin = self._last
            if version is ControllerVersion.V4_20:
                # The state is due now; later versions leave it the time of the cycle that found
                # it.
                begin = now
        if version is ControllerVersion.BLENDING and not self._is_waiting:
            stamp = now
        self._message = None
        self.command = replace_command(points, stamp, now, before, begin)
