# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A commanded motion, and the time within it that an arm has come to, by readings of the arm."""

from dataclasses import dataclass, replace
import functools
import math

import numpy as np
from rrth_planner.kernels.trajectory.quintics import time_on
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import curves_of, state_at, states_at
from rrth_planner.model.trajectory import (
    MotionState,
    near_point,
    positions_at,
    REST_SPEED,
    sample,
    StartState,
    Trajectory,
)

# An arm is on a motion that is, at some time, as near to its reading as this [rad, rad/s].
SAME_POSITION, SAME_VELOCITY = 2e-3, 0.03
# Spacing of the samples among which that time is sought first [s].
SEARCH_SPACING = 1e-3
# The same for an arm that hardly moves: [rad], and as a share of its speed. An arm slower than
# STILL has no direction [rad/s].
SHARP_POSITION, SHARP_VELOCITY, STILL = 1e-4, 0.02, 1e-5
# No arm executes a motion much faster than commanded.
FASTEST_RATE = 1.05
# Below this speed the lag of an arm is not measurable [rad/s]; the greatest lag that counts [s].
SLOW, LATEST = 0.05, 0.05
# An arm that is further from its whole motion, in one joint, does not execute it [rad].
MAX_DEVIATION = 0.1
# Longest time from publishing a motion to its beginning; a longer one means that the clock was
# set back [s].
LONGEST_LEAD = 0.25
# Spacing of the samples of a motion that an arm is located by [s].
SPACING = 5e-3
# An arm follows what is commanded where no joint is further from it than this [rad], at some time
# within its lag. One that is later than stated, by up to LONGEST_LAG [s], still executes it.
FOLLOWS, LONGEST_LAG = 0.02, 0.1
# Where it is to be faster than this [rad/s], and has less than this share of the velocity, it
# executes the motion more slowly than commanded.
PACED, SLOWEST = 0.5, 0.6
# Greatest deviation of an arm that is on time [rad].
ON_TIME = 5e-4
# Until this time a motion has hardly left its start [s].
BEGINNING = 0.05
# Number of samples to decide whether it moves soon.
N_SOON = 9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ExecutingMotion:
    """
    A motion and when it began.

    Parameters
    ----------
    start_time : float
        [s].
    target_distance : float
        From the tool to the target at the end: so much of the pointing ray must be clear [m].
    escape_time : float
        Until then the motion may escape from boxes [s].

    """

    trajectory: Trajectory
    start_time: float
    target_distance: float = 0.0
    escape_time: float = 0.0

    def shifted(self, step: float) -> 'ExecutingMotion':
        """Return the motion by a clock that was set forward by a step [s]."""
        return replace(self, start_time=self.start_time + step)

    def phase(self, q: Array, taken: float, now: float) -> float | None:
        """
        Return the time within the motion that the arm is at now [s]; None where it is off it.

        The arm was at q, shape (dof,) [rad], at the time `taken`; both times in seconds. It may be
        late, slow, or a little off its motion: the nearest point counts. Before the motion begins
        the time is negative. Velocities are not needed: not every driver has them.
        """
        motion, guess = self.trajectory, taken - self.start_time
        if now < self.start_time <= now + LONGEST_LEAD and not self._has_begun(q, guess):
            # Before the handover: the arm is still on the previous motion.
            return now - self.start_time
        if len(motion.times) == 1:
            is_there = np.abs(motion.positions[0] - q).max() <= MAX_DEVIATION
            return max(0.0, now - self.start_time) if is_there else None
        # Mostly the arm is at the commanded state, a little late.
        at = self.near(guess, q, SAME_POSITION)
        if not math.isfinite(at):
            at = self._place(q, guess)
        return at + now - taken if math.isfinite(at) else None

    def _place(self, q: Array, guess: float) -> float:
        """Return when [s] the motion is nearest to q, if often, then near a guess; NaN: never."""
        motion = self.trajectory
        times = np.linspace(0.0, motion.duration, 2 + int(motion.duration / SPACING))
        gaps = positions_at(motion, times) - q
        if not np.abs(gaps).max(axis=1).min() <= MAX_DEVIATION:
            return math.nan
        squares = (gaps * gaps).sum(axis=1)
        # A motion may pass a point twice.
        near = times[squares <= squares.min() + SAME_POSITION**2]
        return self.near(float(near[np.abs(near - guess).argmin()]), q)

    def _has_begun(self, q: Array, guess: float) -> bool:
        """Return whether an arm is on the motion, past its beginning, by its positions alone."""
        at = math.nan if len(self.trajectory.times) == 1 else self._place(q, guess)
        if not at > BEGINNING:
            return False
        return bool(np.abs(state_at(self.trajectory, at)[0] - q).max() <= SAME_POSITION)

    def follows(self, q: Array, v: Array, taken: float, lag: float) -> bool:
        """
        Return whether an arm follows it, at most `lag` late [s].

        q, v, (dof,): of a reading that was taken at a time [rad, rad/s, s].
        """
        places, paces = self._commanded(taken, lag)
        gaps = np.abs(places - q).max(axis=1)
        k = int(gaps.argmin())
        square = float(paces[k] @ paces[k])
        # Not every driver has velocities: some send zeros.
        is_slow = v.any() and square > PACED**2 and float(v @ paces[k]) < SLOWEST * square
        return bool(gaps[k] <= FOLLOWS) and not is_slow

    def deviation(self, q: Array, taken: float, lag: float) -> float:
        """Return how far an arm was from what was commanded until a time, within a lag [rad]."""
        places, _ = self._commanded(taken, lag)
        return float(np.abs(places - q).max(axis=1).min())

    def _commanded(self, taken: float, lag: float) -> tuple[Array, Array]:
        """Return positions and velocities that were commanded within a lag until a time [s]."""
        ago = _lags(lag)
        places, paces, _ = states_at(self.trajectory, taken - self.start_time - ago)
        return places, paces

    def is_on_time(self, q: Array, v: Array, taken: float) -> bool:
        """Return whether an arm had positions and velocities of the motion at a time [s]."""
        since = taken - self.start_time
        if not BEGINNING <= since <= self.trajectory.duration:
            return False
        wanted, pace, _ = state_at(self.trajectory, since)
        return bool(np.abs(wanted - q).max() <= ON_TIME and np.abs(pace - v).max() <= REST_SPEED)

    def will_move(self, time: float, span: float) -> bool:
        """Return whether the motion moves soon after a time [s], within a span [s]."""
        since = time - self.start_time + np.linspace(0.0, span, N_SOON)
        return bool((np.abs(sample(self.trajectory, since)[1]) > REST_SPEED).any())

    def near(self, guess: float, q: Array, same: float = math.inf) -> float:
        """Return when [s], near a guess, the motion passes q; NaN if not within `same` [rad]."""
        curves = curves_of(self.trajectory)
        return float(time_on(curves, self.trajectory.times, guess, q, same, SLOW, LATEST))

    def gap(self, q: Array, taken: float) -> float:
        """Return how far a reading, taken at a time [s], is off the motion [rad]."""
        at = self.phase(q, taken, taken)
        if at is None:
            return math.inf
        return float(np.abs(state_at(self.trajectory, at)[0] - q).max())


@functools.lru_cache(maxsize=8)
def _lags(longest: float) -> Array:
    """Return times ago from the longest to none, read-only [s]."""
    ago = np.linspace(longest, 0.0, 2 + int(longest / SPACING))
    ago.setflags(write=False)
    return ago


def is_same(motion: ExecutingMotion, other: ExecutingMotion) -> bool:
    """Return whether two motions are the same at the same times."""
    one, two = motion.trajectory, other.trajectory
    return motion is other or (
        motion.start_time == other.start_time
        and np.array_equal(one.times, two.times)
        and all(map(np.array_equal, one.states, two.states))
    )


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
    running : Trajectory or None
        The last commanded motion.
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
    q, v, a = state_at(running, time)
    return StartState(
        state=MotionState(positions=q, velocities=v, accelerations=a), running=running, time=time
    )


def sharp_phase_of(q: Array, v: Array, running: Trajectory) -> tuple[float, float] | None:
    """
    Return `phase_of` of an arm that hardly moves, with tolerances that are tight enough.

    None also where it is too slow to have a direction, or faster than arms execute a motion.
    """
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

    q and v, shape (dof,), are a reading of the arm [rad, rad/s]; None where the motion does not
    pass it within `same` [rad, rad/s].
    """
    times, path, along, pace = _search_samples(running)
    # A motion that passes a point twice does so in different directions.
    speed = float(np.linalg.norm(v))
    heading = along @ v / (pace * speed + 1e-300)
    gaps = np.linalg.norm(path - q, axis=1) + np.where(heading > 0.9, 0.0, np.inf)
    phase = float(times[int(np.argmin(gaps))])
    if not np.isfinite(gaps.min()):
        return None
    for _ in range(3):
        # The nearest point, by Newton's method.
        p, w, _ = state_at(running, phase)
        phase = float(np.clip(phase + (q - p) @ w / (w @ w + 1e-300), 0.0, running.duration))
    p, w, _ = state_at(running, phase)
    rate = float(v @ w / (w @ w + 1e-300))
    is_same = np.abs(q - p).max() <= same[0] and np.abs(v - rate * w).max() <= same[1]
    return (phase, rate) if is_same else None


@functools.lru_cache(maxsize=4)
def _search_samples(motion: Trajectory) -> tuple[Array, Array, Array, Array]:
    """Return times of a motion [s], positions, velocities and speeds at these (read-only)."""
    times = np.linspace(0.0, motion.duration, max(2, int(motion.duration / SEARCH_SPACING)))
    path, along, _ = sample(motion, times)
    samples = times, path, along, np.linalg.norm(along, axis=1)
    for array in samples:
        array.setflags(write=False)
    return samples
