# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
What joint_trajectory_controller commands, by its rules in ROS 2 Jazzy.

A new trajectory replaces the present one at once. Until its first point is due the arm is led
there from its present state by one more piece; one whose start is in the past is joined where it
is by now. Between two points each joint follows the polynomial of the lowest degree that fits what
both have: a line, a cubic or a quintic. After the last point that one holds.
"""

from dataclasses import dataclass
import functools

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import MessageError, OptionsError
from rrth_planner.model.trajectory import MotionState, sample, Trajectory


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

    Raises
    ------
    MessageError
        Shapes that differ, positions that are not finite, times that do not increase.

    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array

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
        Since when it is executed [s].
    before : MotionState or None
        The state from which the arm is led to the first point, where that is due later; NaN where
        unknown.

    """

    points: TimedPoints
    start_time: float
    begin: float = 0.0
    before: MotionState | None = None
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
    points: TimedPoints, stamp: float, now: float, present: MotionState
) -> Command:
    """
    Return what is executed from now on [s], in place of anything else.

    Parameters
    ----------
    stamp : float
        When the trajectory starts [s]; 0: now.
    present : MotionState
        Where it begins if its first point is due later: what is commanded at present, or what is
        measured.

    """
    return Command(
        points=points, start_time=stamp if stamp != 0.0 else now, begin=now, before=present
    )


def commanded_state(command: Command, time: float) -> MotionState:
    """Return what is commanded at a time [s], (dof,) each."""
    points = command.points
    since = time - command.start_time
    i = int(np.searchsorted(points.times, since, side='right')) - 1
    if i < 0 and command.before is not None:
        begin = command.begin - command.start_time
        piece = _lead(command)
        return _state(piece, min(max(since - begin, 0.0), piece.duration))
    if 0 <= i < len(points.times) - 1:
        return _state(_piece(points, i), since - points.times[i])
    last = (points.velocities[i], points.accelerations[i])
    velocity, acceleration = (np.where(np.isnan(row), 0.0, row) for row in last)
    return MotionState(
        positions=points.positions[i], velocities=velocity, accelerations=acceleration
    )


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


def _state(piece: Trajectory, time: float) -> MotionState:
    q, v, a = sample(piece, [time])
    return MotionState(positions=q[0], velocities=v[0], accelerations=a[0])


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
        times=np.array([0.0, duration]),
        positions=np.array([p, p_end]),
        velocities=np.array([v, v_end]),
        accelerations=np.array([a, a_end]),
    )
