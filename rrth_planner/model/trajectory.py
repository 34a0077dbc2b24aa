# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Geometry with time: quintic pieces, as a controller interpolates them, and states of motion."""

from collections.abc import Callable
from dataclasses import dataclass
import functools
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.model.arrays import Array, FARTHEST, FLOAT, float_array, frozen_array
from rrth_planner.model.errors import check_type, OptionsError, RrthError
from rrth_planner.model.frozen import Frozen

# Greatest speed of a joint at rest [rad/s].
REST_SPEED = 0.01

# A point so near to a cut is dropped [s]: in a shorter piece the rounding of a position is a jerk.
# The polynomial of the piece beyond the point is extended over that time; where the jerk jumps
# by 80 rad/s^3 at the point it is 1.3e-14 rad from that of the piece before.
NEAR_POINT = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class MotionLimits(Frozen):
    """
    Greatest magnitudes for each joint, array_like of shape (dof,) [rad/s, rad/s^2, rad/s^3].

    Raises
    ------
    OptionsError
        A limit that is not a positive number, or arrays of different lengths.

    """

    velocity: Array
    acceleration: Array
    jerk: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        dof: int | None = None
        units = {'velocity': 'rad/s', 'acceleration': 'rad/s^2', 'jerk': 'rad/s^3'}
        for name, unit in units.items():
            value = frozen_array(getattr(self, name), (dof,), f'max_{name}', unit, OptionsError)
            dof = len(value)
            if not (value > 0.0).all():
                raise OptionsError(
                    f'max_{name}: {value.tolist()}, expected a value > 0 for every joint [{unit}]'
                )
            object.__setattr__(self, name, value)

    @property
    def rows(self) -> tuple[Array, Array, Array]:
        """Greatest velocities, accelerations and jerks."""
        return self.velocity, self.acceleration, self.jerk


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """
    Points in time; between two of them each joint follows the quintic that fits both.

    Parameters
    ----------
    times : array_like, shape (n,)
        From 0, strictly increasing [s].
    positions, velocities, accelerations : array_like, shape (n, dof)
        [rad, rad/s, rad/s^2].

    Raises
    ------
    RrthError
        Shapes that differ, numbers that are not finite, positions beyond 1e4, times that do not
        increase.

    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        rows = self.positions, self.velocities, self.accelerations
        if all(map(_is_plain, (self.times, *rows))) and _are_points(self.times, *rows):
            # As most are, and seen at once.
            for name, value in zip(_NAMES, (self.times, *rows), strict=True):
                value = value.copy()
                value.setflags(write=False)
                object.__setattr__(self, name, value)
            return
        times = frozen_array(self.times, (None,), 'times', 's', RrthError)
        if len(times) == 0 or times[0] != 0.0 or not (times[1:] > times[:-1]).all():
            raise RrthError('times: expected at least one, from 0, strictly increasing [s]')
        object.__setattr__(self, 'times', times)
        dof: int | None = None
        for name, unit, largest in (
            ('positions', 'rad', FARTHEST),
            ('velocities', 'rad/s', np.inf),
            ('accelerations', 'rad/s^2', np.inf),
        ):
            shape = (len(times), dof)
            value = frozen_array(getattr(self, name), shape, name, unit, RrthError, largest)
            dof = value.shape[1]
            object.__setattr__(self, name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Be sent as the bytes of all arrays, in half of the time that four arrays take."""
        arrays = self.times, *self.states
        return _of_bytes, (len(self.times), b''.join(array.tobytes() for array in arrays))

    @classmethod
    def of_arrays(cls, times: Array, states: Array) -> 'Trajectory':
        """
        Return the trajectory of points, (n,) and (3, n, dof), that are known to be those of one.

        Nobody else may hold the arrays.
        """
        times.setflags(write=False)
        states.setflags(write=False)
        trajectory: Trajectory = object.__new__(cls)
        for name, values in zip(_NAMES, (times, *states), strict=True):
            object.__setattr__(trajectory, name, values)
        return trajectory

    @property
    def duration(self) -> float:
        """Time of the last point [s]."""
        return float(self.times[-1])

    @property
    def states(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations."""
        return self.positions, self.velocities, self.accelerations


_NAMES = 'times', 'positions', 'velocities', 'accelerations'


def _is_plain(array: Any) -> bool:
    if type(array) is not np.ndarray or array.dtype != FLOAT:
        return False
    flags = array.flags
    return flags.c_contiguous and flags.aligned


def _are_points(times: Array, p: Array, v: Array, a: Array) -> bool:
    """Return whether arrays are seen at once to be the points of a motion."""
    if times.ndim != 1 or p.ndim != 2 or not p.shape == v.shape == a.shape:
        return False
    if not 0 < len(times) == len(p) or times[0] != 0.0:
        return False
    # A sum of squares is finite where all numbers are, unless it overflows.
    if not np.minimum.reduce(times[1:] - times[:-1], initial=np.inf) > 0.0:
        return False
    size, rest = math.sqrt(np.vdot(p, p)), float(np.vdot(v, v)) + float(np.vdot(a, a))
    return size <= FARTHEST and math.isfinite(rest) and times[-1] < np.inf


def _of_bytes(n: int, data: bytes) -> Trajectory:
    """Return the trajectory of n points that was sent in this way; it is not checked again."""
    # An array over bytes is read-only.
    numbers = np.frombuffer(data)
    return Trajectory.of_arrays(numbers[:n], numbers[n:].reshape(3, n, -1))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionState(Frozen):
    """
    Positions, velocities, accelerations of the joints, array_like (dof,) [rad, rad/s, rad/s^2].

    Raises
    ------
    RrthError
        Arrays of different lengths, numbers that are not finite.

    """

    positions: Array
    velocities: Array
    accelerations: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        dof: int | None = None
        units = {'positions': 'rad', 'velocities': 'rad/s', 'accelerations': 'rad/s^2'}
        for name, unit in units.items():
            value = frozen_array(getattr(self, name), (dof,), name, unit, RrthError)
            dof = len(value)
            object.__setattr__(self, name, value)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StartState:
    """
    State of a moving arm at the handover to a new motion.

    `running` is the motion that it executes until then, None where that is unknown; `time` is that
    of the handover within it [s].
    """

    state: MotionState
    running: Trajectory | None = None
    time: float = 0.0


# The terms u^3, u^4 and u^5 that add a position, a velocity and an acceleration at u = 1, and
# nothing at u = 0.
_QUINTIC = np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]])


@functools.lru_cache(maxsize=8)
def piece_coefficients(trajectory: Trajectory) -> Array:
    """
    Return the polynomials of all pieces in u = (t - t_i) / (t_(i+1) - t_i), lowest power first.

    (n - 1, 6, dof): the quintic that fits position, velocity and acceleration at both ends of each
    piece [rad]; read-only, since timing and both checks share it.
    """
    p, v, a = trajectory.states
    T = (trajectory.times[1:] - trajectory.times[:-1])[:, None]
    square = T * T
    c = np.empty((len(T), 6, p.shape[1]))
    c[:, 0], c[:, 1] = p[:-1], v[:-1] * T
    a0 = a[:-1] * square
    c[:, 2] = 0.5 * a0
    # Remainders of position, velocity and acceleration at u = 1 after these three terms.
    lacks = np.empty((len(T), 3, p.shape[1]))
    lacks[:, 0] = p[1:] - p[:-1] - c[:, 1] - c[:, 2]
    lacks[:, 1] = v[1:] * T - c[:, 1] - a0
    lacks[:, 2] = a[1:] * square - a0
    np.matmul(_QUINTIC, lacks, out=c[:, 3:])
    c.setflags(write=False)
    return c


def positions_at(trajectory: Trajectory, times: ArrayLike) -> Array:
    """Return the positions at some times, as `sample` does, (m,) [s] -> (m, dof) [rad]."""
    if len(trajectory.times) == 1:
        return np.repeat(trajectory.positions, np.size(times), axis=0)
    i, u, _ = _locate(trajectory, np.atleast_1d(np.asarray(times, dtype=np.float64)))
    return _position(piece_coefficients(trajectory)[i], u)


def sample(trajectory: Trajectory, times: ArrayLike) -> tuple[Array, Array, Array]:
    """
    Return the state at some times, (m,) [s]; at rest before the first and after the last point.

    Positions [rad], velocities [rad/s] and accelerations [rad/s^2], each (m, dof); of a single
    time, (): (1, dof).
    """
    check_type(trajectory, Trajectory, 'trajectory')
    t = float_array(times, (...,), 'times', 's')
    if t.ndim != 1:
        # One time, or what is no list of times.
        t = float_array(t[None], (None,), 'times', 's')
    if len(trajectory.times) == 1:
        held = np.repeat(trajectory.positions, len(t), axis=0)
        return held, np.zeros_like(held), np.zeros_like(held)
    i, u, width = _locate(trajectory, t)
    is_outside = (t < 0.0) | (t > trajectory.times[-1])
    q, v, a = _state(piece_coefficients(trajectory)[i], u, width)
    if is_outside.any():
        v[is_outside] = a[is_outside] = 0.0
    return q, v, a


def state_at(trajectory: Trajectory, time: float) -> Array:
    """Return the state at one time [s], as `sample` does, (3, dof)."""
    times = trajectory.times
    n = len(times)
    if n == 1:
        held = np.zeros((3, trajectory.positions.shape[1]))
        held[0] = trajectory.positions[0]
        return held
    i = int(times[1:-1].searchsorted(time, side='right'))
    begin = float(times[i])
    width = float(times[i + 1]) - begin
    u = min(max((time - begin) / width, 0.0), 1.0)
    state = _one_state(piece_coefficients(trajectory)[i], u, width, width * width)
    if time < 0.0 or time > times[n - 1]:
        state[1:] = 0.0
    return state


def motion_through(times: Array, states: Array) -> Trajectory:
    """
    Return the motion through points, without copies: nobody else may hold the arrays.

    times (n,) [s]; states (3, n, dof). Raise RrthError as `Trajectory`.
    """
    if not _are_points(times, *states):
        # It says what is wrong.
        return Trajectory(times, *states)
    return Trajectory.of_arrays(times, states)


def part_of(
    trajectory: Trajectory,
    begin: float,
    end: float,
    curves_of: Callable[[Trajectory], Array] = piece_coefficients,
    through: Callable[[Array, Array], Trajectory] = motion_through,
) -> Trajectory:
    """
    Return the part of a trajectory between two times, shifted to begin at time 0.

    It is that trajectory to rounding: a part of a quintic is the quintic through its ends, and
    every point between the two times [s] stays. They are clipped to its own; where end <= begin,
    the result is a single point. curves_of, through: `piece_coefficients` and `motion_through`, or
    what has the same results sooner.
    """
    times = trajectory.times
    begin = min(max(begin, 0.0), trajectory.duration)
    end = min(max(end, 0.0), trajectory.duration)
    if end <= begin:
        return through(np.zeros(1), _state_by(trajectory, end, 0.0, curves_of)[:, None])
    i = int(times.searchsorted(begin + NEAR_POINT, side='right'))
    n = max(0, int(times.searchsorted(end - NEAR_POINT)) - i)
    points, states = np.empty(n + 2), np.empty((3, n + 2, trajectory.positions.shape[1]))
    points[0], points[1:-1], points[-1] = 0.0, times[i : i + n] - begin, end - begin
    states[:, 0] = _state_by(trajectory, begin, NEAR_POINT, curves_of)
    states[:, -1] = _state_by(trajectory, end, -NEAR_POINT, curves_of)
    for row, values in zip(states, trajectory.states, strict=True):
        row[1:-1] = values[i : i + n]
    return through(points, states)


def cut_at(trajectory: Trajectory, times: Array) -> tuple[Trajectory, NDArray[np.int64]]:
    """
    Return the part from the first to the last of some times, with a point at each, and which.

    It is that trajectory to rounding, as `part_of`. times (m,): within it, not decreasing [s];
    the indices of their points: (m,).
    """
    own = trajectory.times
    points = np.unique(np.concatenate([times, own[(own > times[0]) & (own < times[-1])]]))
    part = Trajectory(points - points[0], *sample(trajectory, points))
    return part, points.searchsorted(times)


def near_point(trajectory: Trajectory, time: float) -> float:
    """Return a time, replaced by that of a point of the trajectory within `NEAR_POINT` [s]."""
    near = _nearest(trajectory, time)
    return near if abs(near - time) <= NEAR_POINT else time


def joined(before: Trajectory, after: Trajectory) -> Trajectory:
    """Return two trajectories in one; the second begins at the last point of the first."""
    times = np.concatenate([before.times, before.times[-1] + after.times[1:]])
    pairs = zip(before.states, after.states, strict=True)
    return Trajectory(times, *(np.concatenate([one, other[1:]]) for one, other in pairs))


def _state_by(
    trajectory: Trajectory, time: float, ahead: float, curves_of: Callable[[Trajectory], Array]
) -> Array:
    """
    Return the state at a time, (3, dof), by the polynomial valid a little ahead [s].

    At one of its points the state is that of the point, to the bit.
    """
    times = trajectory.times
    i = int(times.searchsorted(time))
    if times[i] == time:
        return np.array([row[i] for row in trajectory.states])
    i = int(times[1:-1].searchsorted(time + ahead, side='right'))
    width = float(times[i + 1] - times[i])
    u = (time - float(times[i])) / width
    return _one_state(curves_of(trajectory)[i], u, width, width**2)


def _locate(trajectory: Trajectory, times: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the piece of each time, how far in it from 0 to 1, and its width [s]."""
    grid = trajectory.times
    i = np.searchsorted(grid[1:-1], times, side='right')
    width = grid[i + 1] - grid[i]
    u = (times - grid[i]) / width
    return i, np.minimum(np.maximum(u, 0.0), 1.0)[:, None], width[:, None]


def _one_state(c: Array, u: float, width: float, square: float) -> Array:
    """Return the state on a piece, (6, dof) -> (3, dof): as `_state`, for one time sooner."""
    columns = zip(*c.tolist(), strict=True)
    states = [
        (
            ((((c5 * u + c4) * u + c3) * u + c2) * u + c1) * u + c0,
            ((((5 * c5 * u + 4 * c4) * u + 3 * c3) * u + 2 * c2) * u + c1) / width,
            (((20 * c5 * u + 12 * c4) * u + 6 * c3) * u + 2 * c2) / square,
        )
        for c0, c1, c2, c3, c4, c5 in columns
    ]
    return np.array(list(zip(*states, strict=True)))


def _state(c: Array, u: Array, width: Array | float) -> tuple[Array, Array, Array]:
    v = (((5 * c[:, 5] * u + 4 * c[:, 4]) * u + 3 * c[:, 3]) * u + 2 * c[:, 2]) * u + c[:, 1]
    a = ((20 * c[:, 5] * u + 12 * c[:, 4]) * u + 6 * c[:, 3]) * u + 2 * c[:, 2]
    return _position(c, u), v / width, a / width**2


def _position(c: Array, u: Array) -> Array:
    return ((((c[:, 5] * u + c[:, 4]) * u + c[:, 3]) * u + c[:, 2]) * u + c[:, 1]) * u + c[:, 0]


def beyond(trajectory: Trajectory, escape_time: float) -> Trajectory:
    """Return the remaining motion after an escape, from the point nearest to that time [s]."""
    if escape_time == 0.0:
        return trajectory
    return part_of(trajectory, _nearest(trajectory, escape_time), trajectory.duration)


def _nearest(trajectory: Trajectory, time: float) -> float:
    return float(trajectory.times[np.abs(trajectory.times - time).argmin()])
