# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Localization of an arm on a motion, by a reading of it."""

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.start_state import MotionState, StartState
from rrth_planner.model.trajectory import near_point, sample, Trajectory

# A reading belongs to a motion that passes so close to it [rad], and so fast [rad/s].
SAME_POSITION, SAME_VELOCITY = 2e-3, 0.03
SEARCH_SPACING = 1e-3
# Tolerances where it hardly moves: [rad], and a share of its speed; slower, it has no direction
# [rad/s].
SHARP_POSITION, SHARP_VELOCITY, STILL = 1e-4, 0.02, 1e-5
# No arm executes a motion much faster than commanded.
FASTEST_RATE = 1.05


def predict_start_state(
    positions: Array,
    velocities: Array,
    running: Trajectory | None,
    ahead: float,
    known: tuple[float, float] | None = None,
) -> StartState:
    """
    Return the predicted state of an arm, from a reading of it.

    An arm that is found to execute a known motion, at any rate, is predicted to continue it, and
    to execute the next motion at the same rate: the state is that of the motion. Any other arm is
    predicted to keep its velocity; its acceleration is unknown.

    Parameters
    ----------
    positions, velocities : ndarray, shape (dof,)
        Of the reading [rad, rad/s].
    ahead : float
        From the reading on, >= 0 [s].
    known : tuple of float, optional
        The time within the running motion [s], and the rate at which the arm executes it.

    """
    found = known
    if running is not None and found is None:
        found = phase_of(positions, velocities, running)
    if running is None or found is None:
        return StartState(
            state=MotionState(
                positions=positions + ahead * velocities,
                velocities=velocities,
                accelerations=np.zeros_like(velocities),
            )
        )
    phase, rate = found
    # At a point of the motion where there is one: no piece of the next motion is too short.
    time = near_point(running, min(phase + rate * ahead, running.duration))
    q, v, a = (values[0] for values in sample(running, [time]))
    return StartState(
        state=MotionState(positions=q, velocities=v, accelerations=a), running=running, time=time
    )


def sharp_phase_of(q: Array, v: Array, running: Trajectory) -> tuple[float, float] | None:
    """Return `phase_of` of an arm that hardly moves, with tolerances that are tight enough."""
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
    Return the time within a motion that the arm is at [s], and the rate of its execution.

    None where the motion does not pass the reading within `same` [rad, rad/s].
    """
    n = max(2, int(running.duration / SEARCH_SPACING))
    times = np.linspace(0.0, running.duration, n)
    path, along, _ = sample(running, times)
    # A motion that passes a point twice does so in different directions.
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
