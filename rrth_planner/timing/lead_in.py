# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A motion that takes over from one that runs: from the present velocity, without a jerk."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.kernels.trajectory.speed_profile import ramp_time
from rrth_planner.model.arrays import Array
from rrth_planner.model.start_state import MotionState, StartState
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.timing.braking import brake
from rrth_planner.timing.parameterization import peaks

# What rounding leaves of a speed where a motion ends: it has no direction [rad/s].
RESIDUAL_SPEED = 1e-6
# Accelerations die away in whole ticks, so that no two points are closer [s].
TICK = 1e-3
# The joints' limits less this, for the end of the lead-in to spend.
RESERVE = 0.99


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LeadIn:
    """
    From a moving state to constant velocity, and where straight on leads to rest.

    Parameters
    ----------
    trajectory : Trajectory
        From the state to constant velocity; its last point does not rest.
    speed : float
        Of the last point, along the line through all joints; 0: it rests there [rad/s].
    q_stop : ndarray, shape (dof,)
        Where the arm comes to rest when it goes straight on and slows down [rad].
    allowed : MotionLimits
        What it and the path after it may do: the limits, or what the arm does already.

    """

    trajectory: Trajectory
    speed: float
    q_stop: Array
    allowed: MotionLimits


def lead_in(state: MotionState, limits: MotionLimits) -> LeadIn:
    """
    Return how an arm that moves gets onto a straight line.

    Each joint's acceleration dies away at constant jerk, a little less than its limit; from then
    on the velocity is constant. Between two points every joint follows a cubic, which the quintic
    of a controller reproduces.

    Parameters
    ----------
    state : MotionState
        Within the limits, and so that the velocity stays within them while acceleration fades.
    limits : MotionLimits

    """
    a = state.accelerations
    fade = np.ceil(np.abs(a) / (RESERVE * limits.jerk) / TICK) * TICK
    times = np.unique(np.concatenate([[0.0], np.round(fade / TICK) * TICK]))
    t = np.minimum(times[:, None], fade)
    jerk = np.divide(-a, fade, out=np.zeros_like(a), where=fade > 0.0)
    v_end = state.velocities + a * fade + 0.5 * jerk * fade**2
    velocities = state.velocities + a * t + 0.5 * jerk * t**2
    positions = state.positions + state.velocities * t + 0.5 * a * t**2 + jerk * t**3 / 6
    positions += v_end * (times[:, None] - t)
    accelerations = np.where(times[:, None] < fade, a + jerk * t, 0.0)
    speed = float(np.linalg.norm(velocities[-1]))
    if speed <= RESIDUAL_SPEED:
        velocities[-1], speed = 0.0, 0.0
    u = velocities[-1] / max(speed, 1e-300)
    share = np.abs(u) + 1e-300
    a_max = RESERVE * float((limits.acceleration / share).min())
    j_max = RESERVE * float((limits.jerk / share).min())
    length = 0.5 * speed * ramp_time(speed, a_max, j_max) * (1 + 1e-6)
    return LeadIn(
        trajectory=Trajectory(
            times=times, positions=positions, velocities=velocities, accelerations=accelerations
        ),
        speed=speed,
        q_stop=positions[-1] + u * length,
        allowed=MotionLimits(
            velocity=np.maximum(limits.velocity, np.abs(state.velocities)),
            acceleration=np.maximum(limits.acceleration, np.abs(state.accelerations)),
            jerk=limits.jerk,
        ),
    )


def reserved(limits: MotionLimits) -> MotionLimits:
    """Return the limits that the path after a lead-in is timed with: those it was made for."""
    return MotionLimits(
        velocity=limits.velocity,
        acceleration=RESERVE * limits.acceleration,
        jerk=RESERVE * limits.jerk,
    )


def stop_first(moving: StartState, limits: MotionLimits) -> LeadIn | None:
    """Return the lead that is a stop along the present motion; None where that is not known."""
    if moving.running is None:
        return None
    stop = brake(moving.running, moving.time, limits)
    allowed = limits
    if len(stop.times) > 1:
        own = zip(peaks(stop), (limits.velocity, limits.acceleration, limits.jerk), strict=True)
        v, a, j = (np.maximum(*pair) for pair in own)
        allowed = MotionLimits(velocity=v, acceleration=a, jerk=j)
    return LeadIn(trajectory=stop, speed=0.0, q_stop=stop.positions[-1], allowed=allowed)
