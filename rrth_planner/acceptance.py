# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which motions the kinematic arm takes: those at its present state, and within limits."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.arm import ArmModel
from rrth_planner.arrays import Array, frozen_array
from rrth_planner.errors import MessageError, OptionsError
from rrth_planner.playback import Playback
from rrth_planner.trajectory import sample, Trajectory

# Planned limits may be touched; a motion is refused when it goes further than this beyond them.
EXCESS = 0.01
BOUND_TOLERANCE = 1e-6
# Instants of each piece of a motion at which limits are looked at.
INSTANTS = 64
# A motion that ends later than this is refused [s].
LONGEST_WAIT = 3600.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlaybackRules:
    """
    Which motions the arm takes, and how it moves.

    Parameters
    ----------
    start_tolerance : float
        Greatest distance of a new motion from the present state, per joint [rad and rad/s].
    time_scale : float
        Seconds of the motion per second of the clock, above 0 and up to 1 [-].
    max_velocity, max_acceleration : array_like, shape (dof,)
        What each joint may do [rad/s, rad/s^2].

    Raises
    ------
    OptionsError
        A value outside its range.

    """

    start_tolerance: float
    time_scale: float
    max_velocity: Array
    max_acceleration: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        if not 0.0 < self.start_tolerance < np.inf:
            raise OptionsError(f'start_tolerance: {self.start_tolerance}, expected > 0 [rad]')
        if not 0.0 < self.time_scale <= 1.0:
            raise OptionsError(f'time_scale: {self.time_scale}, expected above 0, up to 1 [-]')
        dof = np.size(self.max_velocity)
        for name, unit in (('max_velocity', 'rad/s'), ('max_acceleration', 'rad/s^2')):
            value = frozen_array(getattr(self, name), (dof,), name, unit, OptionsError)
            if not (value > 0.0).all():
                raise OptionsError(f'{name}: {value.tolist()}, expected values > 0 [{unit}]')
            object.__setattr__(self, name, value)


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

    Parameters
    ----------
    playback : Playback
        What it does now.
    trajectory : Trajectory
        The new motion.
    arm : ArmModel
        Its bounds hold along the whole curve, not only at the points.
    rules : PlaybackRules
    start_time, time : float
        When the new motion begins, and now [s].

    Raises
    ------
    MessageError
        The new motion is not at the present state now, leaves limits somewhere, or ends more
        than an hour ahead. Within `start_tolerance` the arm steps onto it.

    """
    new = Playback(trajectory=trajectory, start_time=start_time, time_scale=rules.time_scale)
    # Numbers that overflow become infinite or NaN, which every comparison below refuses.
    with np.errstate(all='ignore'):
        _check_start(playback, new, arm, rules, time)
        _check_limits(new, arm, rules)
        ahead = new.end_time - time
    if not ahead <= LONGEST_WAIT:
        raise MessageError(
            f'the motion ends in {ahead:.6g} s, expected an end within {LONGEST_WAIT:g} s'
        )
    return new


def _check_start(
    playback: Playback, new: Playback, arm: ArmModel, rules: PlaybackRules, time: float
) -> None:
    """Raise MessageError where a motion is not at the present state now."""
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
    """Raise MessageError where the curve of a motion leaves the bounds or limits."""
    grid = playback.trajectory.times
    within = np.linspace(0.0, 1.0, INSTANTS, endpoint=False)
    instants = np.append((grid[:-1, None] + np.diff(grid)[:, None] * within).ravel(), grid[-1])
    q, v, a = sample(playback.trajectory, instants)
    scale = playback.time_scale
    top = 1.0 + EXCESS
    lowest, highest = arm.bounds[0] - BOUND_TOLERANCE, arm.bounds[1] + BOUND_TOLERANCE
    for what, unit, value, low, high in (
        ('position', 'rad', q, lowest, highest),
        ('velocity', 'rad/s', v * scale, -top * rules.max_velocity, top * rules.max_velocity),
        (
            'acceleration',
            'rad/s^2',
            a * scale**2,
            -top * rules.max_acceleration,
            top * rules.max_acceleration,
        ),
    ):
        excess = np.maximum(low - value, value - high)
        k, i = np.unravel_index(np.argmax(excess), excess.shape)
        if not excess[k, i] <= 0.0:
            raise MessageError(
                f'{arm.joint_names[i]}: {what} {value[k, i]:.6g} at {instants[k]:.6g} s, '
                f'expected {low[i]:.6g} to {high[i]:.6g} [{unit}]'
            )
