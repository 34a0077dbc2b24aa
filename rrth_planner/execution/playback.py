# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The kinematic arm: it executes a motion exactly, stops along its path, or stands still.

It accepts motions from its present state that are within its limits.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.bernstein import first_outside, to_bernstein
from rrth_planner.model.errors import MessageError, OptionsError
from rrth_planner.model.joint_range import bounds_from, not_led_in
from rrth_planner.model.trajectory import MotionLimits, piece_coefficients, sample, Trajectory

# A motion is rejected where it exceeds a limit by more than this share.
EXCESS = 0.01
BOUND_TOLERANCE = 1e-6
# What lets the arm accept a motion that exceeds one.
SLOWER = ': max_velocity of the arm must be no lower than that of the planner'
SOFTER = (
    ': max_acceleration of the arm must be no lower than max_acceleration and stop_acceleration '
    'of the planner'
)
# A motion that ends later than this is rejected [s].
LONGEST_WAIT = 3600.0
# Matrices to Bernstein form, by number of coefficients; and the factors that differentiation
# brings down.
_TO_BERNSTEIN = {size: to_bernstein(size - 1) for size in (4, 5, 6)}
_POWERS = np.arange(1.0, 6.0)[:, None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Playback:
    """
    The motion of the arm from some time on, executed at the rate `time_scale`.

    Parameters
    ----------
    trajectory : Trajectory
        A single point is an arm that stands still.
    start_time : float
        When the motion begins [s].
    before : Playback or None
        The motion until then; None: it stands at the first point.
    time_scale : float
        Seconds of the motion per second of the clock [-].
    is_stopping : bool
        Whether the motion is a stop.

    """

    trajectory: Trajectory
    start_time: float
    time_scale: float
    before: 'Playback | None' = None
    is_stopping: bool = False

    @property
    def end_time(self) -> float:
        """When the motion has ended [s]."""
        return self.start_time + self.trajectory.duration / self.time_scale

    def state_at(self, time: float) -> tuple[Array, Array, Array]:
        """Return positions, velocities, accelerations [rad, rad/s, rad/s^2], each (dof,)."""
        if self.before is not None and time < self.start_time:
            return self.before.state_at(time)
        rate = self.time_scale
        q, v, a = sample(self.trajectory, [rate * (time - self.start_time)])
        return q[0], v[0] * rate, a[0] * rate**2


def standing(q: ArrayLike) -> Playback:
    """Return an arm that stands still at a configuration, shape (dof,) [rad]."""
    positions = np.atleast_2d(np.asarray(q, dtype=np.float64))
    still = np.zeros_like(positions)
    point = Trajectory(
        times=np.zeros(1), positions=positions, velocities=still, accelerations=still
    )
    return Playback(trajectory=point, start_time=0.0, time_scale=1.0)


def at_present(playback: Playback, time: float) -> Playback:
    """Return the present motion of an arm, without one that begins after a time [s]."""
    if playback.before is None:
        return playback
    return playback.before if time < playback.start_time else replace(playback, before=None)


def stop(playback: Playback, limits: MotionLimits, time: float) -> Playback:
    """
    Return the motion of an arm that stops along its path from a time on, which is now [s].

    It is the stop of `fast_stop.fast_stop`; the limits hold by the clock, at any time scale. An
    arm that comes to rest by itself as soon continues, and so does one that is stopping already.
    """
    playback = at_present(playback, time)
    if playback.is_stopping or time >= playback.end_time:
        return playback
    if time <= playback.start_time:
        return standing(playback.trajectory.positions[0])
    # Kernels take a while to load, and only a stop needs them.
    from rrth_planner.timing.fast_stop import fast_stop

    scale = playback.time_scale
    in_motion = MotionLimits(
        velocity=limits.velocity / scale,
        acceleration=limits.acceleration / scale**2,
        jerk=limits.jerk / scale**3,
    )
    phase = scale * (time - playback.start_time)
    # Without the compiler numpy would warn in kernels.
    with np.errstate(all='ignore'):
        stopping = fast_stop(playback.trajectory, phase, in_motion, lead=0.0)
    return replace(playback, trajectory=stopping, start_time=time, is_stopping=True)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlaybackRules:
    """
    Which motions the arm accepts, and how it moves.

    Parameters
    ----------
    start_tolerance : float
        Greatest distance of a new motion from the present state, per joint [rad and rad/s].
    time_scale : float
        Seconds of a motion that begins at rest per second of the clock, above 0 and up to 1 [-].
    limits : MotionLimits
        Of each joint; a stop keeps the jerk limit, a motion may have any jerk.

    Raises
    ------
    OptionsError
        A value out of its range.

    """

    start_tolerance: float
    time_scale: float
    limits: MotionLimits

    def __post_init__(self) -> None:
        """Validate."""
        if not 0.0 < self.start_tolerance < np.inf:
            raise OptionsError(f'start_tolerance: {self.start_tolerance}, expected > 0 [rad]')
        if not 0.0 < self.time_scale <= 1.0:
            raise OptionsError(f'time_scale: {self.time_scale}, expected above 0, up to 1 [-]')


def accept(
    playback: Playback,
    trajectory: Trajectory,
    arm: ArmModel,
    rules: PlaybackRules,
    *,
    start_time: float,
    time: float,
) -> Playback:
    """
    Return what the arm does when a new motion replaces the present one.

    Until the new motion begins the arm continues the present one; a motion that has not begun when
    another one comes is dropped. A handover or a stop within a motion keeps the time scale of that
    motion: a new `time_scale` counts from the next rest on.

    Parameters
    ----------
    trajectory : Trajectory
        The new motion; the bounds of the arm hold along its whole curve, not only at the points.
        A joint may begin a little beyond (`joint_range.start_bounds`), and then moves towards its
        limit only.
    start_time, time : float
        When the new motion begins, and now [s].

    Raises
    ------
    MessageError
        The new motion does not start at the state of the arm when it begins (now, if it has
        begun), exceeds a limit, or ends more than an hour ahead. Within `start_tolerance` the arm
        steps onto it.

    """
    before = at_present(playback, time)
    is_under_way = before.end_time > max(time, start_time)
    new = Playback(
        trajectory=trajectory,
        start_time=start_time,
        time_scale=before.time_scale if is_under_way else rules.time_scale,
        before=before if start_time > time else None,
    )
    # Numbers that overflow become infinite or NaN, which every comparison below rejects.
    with np.errstate(all='ignore'):
        # First what no later motion would change: an arm that did not set off for it is soon far
        # from where the next one begins.
        _check_limits(new, arm, rules)
        _check_start(before, new, arm, rules, max(time, start_time))
        ahead = new.end_time - time
    if not ahead <= LONGEST_WAIT:
        raise MessageError(
            f'the motion ends in {ahead:.6g} s, expected an end within {LONGEST_WAIT:g} s'
        )
    return new


def _check_start(
    playback: Playback, new: Playback, arm: ArmModel, rules: PlaybackRules, time: float
) -> None:
    """Raise MessageError where a motion does not start at the state of the arm at a time [s]."""
    q, v, _ = playback.state_at(time)
    q_new, v_new, _ = new.state_at(time)
    for what, unit, wanted, present in (
        ('position', 'rad', q_new, q),
        ('velocity', 'rad/s', v_new, v),
    ):
        gap = np.abs(wanted - present)
        i = int(np.argmax(gap))
        if not gap[i] <= rules.start_tolerance:
            raise MessageError(
                f'{arm.joint_names[i]}: the motion begins at {what} {wanted[i]:.6g}, the arm is '
                f'at {present[i]:.6g}, expected at most {rules.start_tolerance:g} apart [{unit}]'
            )


def _check_limits(playback: Playback, arm: ArmModel, rules: PlaybackRules) -> None:
    """Raise MessageError where a motion exceeds bounds or limits anywhere."""
    trajectory, scale, top = playback.trajectory, playback.time_scale, 1.0 + EXCESS
    c, durations = _pieces(trajectory)
    rates = scale / durations[:, None, None]
    first = c[:, 1:] * _POWERS * rates
    second = first[:, 1:] * _POWERS[:4] * rates
    least, most = bounds_from(arm, trajectory.positions[0])
    v, a = top * rules.limits.velocity, top * rules.limits.acceleration
    for what, unit, polynomials, low, high, hint in (
        ('position', 'rad', c, least - BOUND_TOLERANCE, most + BOUND_TOLERANCE, ''),
        ('velocity', 'rad/s', first, -v, v, SLOWER),
        ('acceleration', 'rad/s^2', second, -a, a, SOFTER),
    ):
        n, size, dof = polynomials.shape
        control = np.swapaxes(_TO_BERNSTEIN[size] @ polynomials, 0, 1).reshape(size, n * dof)
        found = first_outside(control, np.tile(low, n), np.tile(high, n))
        if found is not None:
            (k, i), (_, share, value) = divmod(found[0], dof), found
            instant = trajectory.times[k] + share * durations[k]
            raise MessageError(
                f'{arm.joint_names[i]}: {what} {value:.6g} at {instant:.6g} s, '
                f'expected {low[i]:.6g} to {high[i]:.6g} [{unit}]{hint}'
            )
    k = not_led_in(arm, trajectory)
    if k is not None:
        raise MessageError(
            f'{arm.joint_names[k]}: the motion begins beyond a limit, at '
            f'{trajectory.positions[0, k]:.6g}, and moves not only towards it, expected '
            f'{arm.bounds[0, k]:.6g} to {arm.bounds[1, k]:.6g} [rad]'
        )


def _pieces(trajectory: Trajectory) -> tuple[Array, Array]:
    """Return the polynomials of all pieces, (n, 6, dof), and their durations, (n,) [s]."""
    if len(trajectory.times) > 1:
        return piece_coefficients(trajectory), np.diff(trajectory.times)
    # A single point: the arm stands still.
    held = np.zeros((1, 6, trajectory.positions.shape[1]))
    held[0, 0] = trajectory.positions[0]
    return held, np.ones(1)
