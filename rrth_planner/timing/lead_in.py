# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The lead-in of a handover: from the present velocity to a straight line at constant speed."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.kernels.trajectory.speed_profile import ramp_time
from rrth_planner.model.arrays import Array
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.trajectory import MotionLimits, MotionState, StartState, Trajectory
from rrth_planner.timing.braking import brake
from rrth_planner.timing.parameterization import peaks

# Speed that counts as rest: rounding, without a direction [rad/s].
RESIDUAL_SPEED = 1e-6
# Accelerations decay in whole ticks, so that no two points are closer [s].
TICK = 1e-3
# Share of the joints' limits for the lead-in; the rest is a reserve for its end.
RESERVE = 0.99


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LeadIn(Frozen):
    """
    From a moving state to constant velocity, and the configuration where a straight stop ends.

    Parameters
    ----------
    trajectory : Trajectory
        From the state to constant velocity; its last point does not rest.
    speed : float
        Of the last point, along the line through all joints; 0: it rests there [rad/s].
    q_stop : ndarray, shape (dof,)
        Configuration at rest after slowing down along that line [rad].
    allowed : MotionLimits
        Limits of it and of the path after it: the given ones, or the present motion where that
        exceeds them.

    """

    trajectory: Trajectory
    speed: float
    q_stop: Array
    allowed: MotionLimits


def lead_in(state: MotionState, limits: MotionLimits) -> LeadIn:
    """
    Return the lead-in of a moving arm onto a straight line.

    Each joint's acceleration decays at constant jerk, a little less than its limit; from then
    on the velocity is constant. Between two points every joint follows a cubic, which the quintic
    of a controller reproduces. The state is within the limits, and such that the velocity stays
    within them while acceleration fades.
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
        trajectory=Trajectory(times, positions, velocities, accelerations),
        speed=speed,
        q_stop=positions[-1] + u * length,
        allowed=MotionLimits(
            np.maximum(limits.velocity, np.abs(state.velocities)),
            np.maximum(limits.acceleration, np.abs(state.accelerations)),
            limits.jerk,
        ),
    )


def reserved(limits: MotionLimits) -> MotionLimits:
    """Return the limits for the path after a lead-in: those that the lead-in assumes."""
    return MotionLimits(limits.velocity, RESERVE * limits.acceleration, RESERVE * limits.jerk)


def stop_first(moving: StartState, limits: MotionLimits) -> LeadIn | None:
    """Return a lead-in that stops along the running motion; None where that is unknown."""
    if moving.running is None:
        return None
    stop = brake(moving.running, moving.time, limits)
    allowed = MotionLimits(*np.maximum(peaks(stop), limits.rows))
    return LeadIn(trajectory=stop, speed=0.0, q_stop=stop.positions[-1], allowed=allowed)
