# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A motion that takes over from one that runs: from the present velocity, without a jerk."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.braking import brake
from rrth_planner.kernels.speeds import ramp_time
from rrth_planner.timing import peaks
from rrth_planner.trajectory import MotionLimits, near_point, sample, Trajectory

# An arm that moves no faster is at rest [rad/s].
REST_SPEED = 0.01
# What rounding leaves of a speed where a motion ends: it has no direction [rad/s].
RESIDUAL_SPEED = 1e-6
# Accelerations die away in whole ticks, so that no two points are closer [s].
TICK = 1e-3
# The joints' limits less this, for the end of the lead-in to spend.
RESERVE = 0.99
# A reading belongs to a motion that passes so close to it [rad], and so fast [rad/s].
SAME_POSITION, SAME_VELOCITY = 2e-3, 0.03
SEARCH_SPACING = 1e-3
# Where it hardly moves, so close [rad], and by so small a share of its own speed; slower, it has
# no direction [rad/s].
SHARP_POSITION, SHARP_VELOCITY, STILL = 1e-4, 0.02, 1e-5
# No arm goes much faster than it was told.
FASTEST_RATE = 1.05


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MotionState:
    """
    Where the arm is and how it moves.

    Parameters
    ----------
    positions, velocities, accelerations : ndarray, shape (dof,)
        [rad, rad/s, rad/s^2].

    """

    positions: Array
    velocities: Array
    accelerations: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lead:
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


def lead_in(state: MotionState, limits: MotionLimits) -> Lead:
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
    grip = RESERVE * float((limits.acceleration / share).min())
    snap = RESERVE * float((limits.jerk / share).min())
    length = 0.5 * speed * ramp_time(speed, grip, snap) * (1 + 1e-6)
    return Lead(
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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Takeover:
    """
    What an arm that moves does when a motion takes over from its present one.

    Parameters
    ----------
    state : MotionState
        At that time.
    running : Trajectory or None
        The motion that it follows until then; None where that is not known.
    time : float
        Within that motion [s].

    """

    state: MotionState
    running: Trajectory | None = None
    time: float = 0.0


def stop_first(moving: Takeover, limits: MotionLimits) -> Lead | None:
    """Return the lead that is a stop along the present motion; None where that is not known."""
    if moving.running is None:
        return None
    stop = brake(moving.running, moving.time, limits)
    allowed = limits
    if len(stop.times) > 1:
        own = zip(peaks(stop), (limits.velocity, limits.acceleration, limits.jerk), strict=True)
        v, a, j = (np.maximum(*pair) for pair in own)
        allowed = MotionLimits(velocity=v, acceleration=a, jerk=j)
    return Lead(trajectory=stop, speed=0.0, q_stop=stop.positions[-1], allowed=allowed)


def takeover(
    positions: Array,
    velocities: Array,
    running: Trajectory | None,
    ahead: float,
    known: tuple[float, float] | None = None,
) -> Takeover:
    """
    Return what an arm will do, from a reading of it.

    An arm that is seen to follow a known motion, at whatever rate, goes on to follow it, and what
    it is told next it follows at the same rate: the state is that of the motion. Any other goes on
    at the velocity it has; of its acceleration nothing is known.

    Parameters
    ----------
    positions, velocities : ndarray, shape (dof,)
        Of the reading [rad, rad/s].
    running : Trajectory or None
        The motion that the arm was last told to follow.
    ahead : float
        From the reading on, >= 0 [s].
    known : tuple of float, optional
        Where in that motion the arm is known to be [s], and at which rate it follows it; without,
        that is looked for.

    """
    found = known
    if running is not None and found is None:
        found = phase_of(positions, velocities, running)
    if running is None or found is None:
        return Takeover(
            state=MotionState(
                positions=positions + ahead * velocities,
                velocities=velocities,
                accelerations=np.zeros_like(velocities),
            )
        )
    phase, rate = found
    # At a point of the motion where there is one: no piece of what follows is too short.
    time = near_point(running, min(phase + rate * ahead, running.duration))
    q, v, a = (values[0] for values in sample(running, [time]))
    return Takeover(
        state=MotionState(positions=q, velocities=v, accelerations=a), running=running, time=time
    )


def sharp_phase_of(q: Array, v: Array, running: Trajectory) -> tuple[float, float] | None:
    """Return the same as `phase_of` of an arm that hardly moves, where its reading is so exact."""
    speed = float(np.linalg.norm(v))
    if speed < STILL:
        return None
    found = phase_of(q, v, running, (SHARP_POSITION, SHARP_VELOCITY * speed))
    return None if found is None or found[1] > FASTEST_RATE else found


def phase_of(
    q: Array,
    v: Array,
    running: Trajectory,
    same: tuple[float, float] = (SAME_POSITION, SAME_VELOCITY),
) -> tuple[float, float] | None:
    """
    Return the time within a motion at which the arm is [s], and at which rate it follows it.

    None where the motion does not pass so close to the reading, `same` [rad, rad/s].
    """
    n = max(2, int(running.duration / SEARCH_SPACING))
    times = np.linspace(0.0, running.duration, n)
    path, along, _ = sample(running, times)
    # A motion that passes a place twice does so in another direction.
    speed, pace = float(np.linalg.norm(v)), np.linalg.norm(along, axis=1)
    heading = along @ v / (pace * speed + 1e-300)
    gaps = np.linalg.norm(path - q, axis=1) + np.where(heading > 0.9, 0.0, np.inf)
    phase = float(times[int(np.argmin(gaps))])
    if not np.isfinite(gaps.min()):
        return None
    for _ in range(3):
        # The nearest point, by Newton's method.
        p, w, _ = (values[0] for values in sample(running, [phase]))
        phase = float(np.clip(phase + (q - p) @ w / (w @ w + 1e-300), 0.0, running.duration))
    p, w, _ = (values[0] for values in sample(running, [phase]))
    rate = float(v @ w / (w @ w + 1e-300))
    is_same = np.abs(q - p).max() <= same[0] and np.abs(v - rate * w).max() <= same[1]
    return (phase, rate) if is_same else None
