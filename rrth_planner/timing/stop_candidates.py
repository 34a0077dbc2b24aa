# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Rates at which a motion may come to rest: candidates, the soonest first."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.timing.line_stops import line_stops, LineStops
from rrth_planner.timing.running import (
    along_path,
    derivatives_around,
    derivatives_at,
    Running,
    slowed,
)
from rrth_planner.timing.time_law import integrated, RateProfile

# What is tried: delays, in shares of the time that is looked at; in shares of the limits that are
# left along the path, decelerations and the jerks that build them up.
DELAYS = np.linspace(0.0, 0.8, 9)
DECELERATIONS = np.array([0.98, 0.85, 0.7, 0.5, 0.3, 0.15])
JERKS = np.array([0.97, 0.8, 0.6, 0.4, 0.2, 0.1])
# Instants that the motion is looked at; steps of each phase of a profile, and of those stops that
# are only compared.
GRID, STEPS, FEW_STEPS = 512, 16, 8
# How many stops become profiles, and how many of one delay.
CHOSEN, ALIKE = 10, 3
# How often a profile is fitted to where it meets the points of the motion, at most, and how
# closely [s].
FITS, FIT = 6, 1e-10


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Outlook:
    """
    What a motion does within a time, without a stop.

    Parameters
    ----------
    running : Running
    weights : ndarray, shape (dof,)
        Greatest accelerations, by which the joints are weighed.
    times : ndarray, shape (m,)
        From now on, equally spaced [s].
    states : ndarray, shape (m, 3, dof)
        Velocity, acceleration, jerk.
    limits : ndarray, shape (m, 3, dof)
        What a stop that gets that far may do.
    speeds, slopes : ndarray, shape (m,)
        Speed along the path and its slope [1/s, 1/s^2].
    ways : ndarray, shape (m,)
        Integral of the speed [-].

    """

    running: Running
    weights: Array
    times: Array
    states: Array
    limits: Array
    speeds: Array
    slopes: Array
    ways: Array

    def times_at(self, ways: Array) -> Array:
        """Return when it has come so far [s], by the cubics that fit its speeds too."""
        i = np.clip(np.searchsorted(self.ways, ways, side='right') - 1, 0, GRID - 2)
        width = self.ways[i + 1] - self.ways[i]
        u = (ways - self.ways[i]) / width
        first, last = width / self.speeds[i], width / self.speeds[i + 1]
        step = self.times[1] - self.times[0]
        return np.asarray(
            self.times[i]
            + u * (first + u * (3.0 * step - 2.0 * first - last + u * (first + last - 2.0 * step)))
        )


def outlook(running: Running, limits: MotionLimits, window: float) -> Outlook:
    """Return what a motion does within a time [s]."""
    times = np.linspace(0.0, window, GRID)
    states = derivatives_at(running, times)
    speeds, slopes, _ = along_path(states, limits.acceleration)
    step = times[1] - times[0]
    # The trapezoid, and what the slopes at its ends say of the bulge.
    pieces = 0.5 * step * (speeds[1:] + speeds[:-1]) - step**2 / 12.0 * np.diff(slopes)
    most = np.stack([limits.velocity, limits.acceleration, limits.jerk])
    return Outlook(
        running=running,
        weights=limits.acceleration,
        times=times,
        states=states,
        limits=np.maximum(most, np.maximum.accumulate(np.abs(states))),
        speeds=speeds,
        slopes=slopes,
        ways=np.append(0.0, np.cumsum(pieces)),
    )


def soonest_profiles(ahead: Outlook, limits: MotionLimits, latest: float) -> Iterator[RateProfile]:
    """
    Yield rates that seem to hold the limits, in the order in which they come to rest.

    Parameters
    ----------
    ahead : Outlook
    limits : MotionLimits
    latest : float
        Before which they have to [s].

    """
    stops = _candidates(ahead, limits)
    is_real = (stops.ends < latest) & np.isfinite(stops.ways).all(axis=1)
    # Those that do not reach their deceleration are the same for all of these.
    kind = np.stack([stops.delays, stops.ends, stops.durations[:, 2]], axis=1).round(9)
    unlike = np.unique(kind[is_real], axis=0, return_index=True)[1]
    stops = stops.chosen(np.flatnonzero(is_real)[unlike])
    stops = stops.chosen(np.flatnonzero(_seem_to_hold(stops, ahead)))
    for i in _soonest(stops):
        # A number out of the range of all numbers is no profile either.
        with suppress(RrthError):
            profile = _profile(stops.chosen(np.array([i])), ahead)
            if profile.is_forward and profile.ways[-1] <= ahead.times[-1]:
                yield profile


def _soonest(stops: LineStops) -> list[int]:
    """Return the soonest stops, a few of each delay: what fails one will fail the next."""
    chosen: list[int] = []
    for i in np.argsort(stops.ends, kind='stable').tolist():
        if (stops.delays[chosen] == stops.delays[i]).sum() < ALIKE:
            chosen.append(i)
    return chosen[:CHOSEN]


def _candidates(ahead: Outlook, limits: MotionLimits) -> LineStops:
    """Return all stops that are tried."""
    first = (DELAYS * (GRID - 1)).astype(np.intp)
    direction = np.abs(ahead.states[first, 0]) / ahead.speeds[first, None] + 1e-300
    decelerations = (limits.acceleration / direction).min(axis=1)
    jerks = (limits.jerk / direction).min(axis=1)
    k, deceleration, jerk = (
        part.ravel()
        for part in np.meshgrid(np.arange(len(first)), DECELERATIONS, JERKS, indexing='ij')
    )
    i = first[k]
    return line_stops(
        ahead.times[i],
        (ahead.ways[i], ahead.speeds[i], ahead.slopes[i]),
        deceleration * decelerations[k],
        jerk * jerks[k],
    )


def _seem_to_hold(stops: LineStops, ahead: Outlook) -> Array:
    """Return which stops hold limits at some instants, as far as a glance shows, (n,)."""
    _, way, speed, slope, bend = stops.at(np.linspace(0.0, 1.0, FEW_STEPS + 1))
    last = np.searchsorted(ahead.ways, way[:, -1, -1])
    # Linear between instants of the motion: good enough to choose from.
    at = np.interp(way, ahead.ways, np.arange(GRID, dtype=np.float64))
    low = np.minimum(at.astype(np.intp), GRID - 2)
    step = ahead.states[low + 1] - ahead.states[low]
    states = ahead.states[low] + (at - low)[..., None, None] * step
    values = slowed(states, *_rate(states, speed, slope, bend, ahead.weights))
    allowed = ahead.limits[np.minimum(last, GRID - 1)]
    holds = (np.abs(values).max(axis=(1, 2)) <= allowed).all(axis=(1, 2))
    return np.asarray(holds & (last < GRID))


def _rate(
    states: Array, speed: Array, slope: Array, bend: Array, weights: Array
) -> tuple[Array, Array, Array]:
    """Return the rate, its slope and bend that give a motion a speed along its path."""
    v, a, j = along_path(states, weights)
    rate = speed / v
    rate_slope = (slope - a * rate**2) / v
    return rate, rate_slope, (bend - 3.0 * a * rate * rate_slope - j * rate**3) / v


def _profile(stop: LineStops, ahead: Outlook) -> RateProfile:
    """Return the rate that brings a motion to rest like a stop on a line, or raise RrthError."""
    shares = np.arange(STEPS) / STEPS
    # Just after the start a motion is so slow that bends are great, and fall fast.
    phases = stop.at(np.stack([shares**2, shares, shares]))[0].ravel()
    knots = ahead.running.knots
    used, profile = np.empty(0), None
    # Where pieces of the motion meet its jerk may jump, so the bend has to; but when the arm gets
    # there depends on the bends.
    for _ in range(FITS):
        times = np.unique(np.concatenate([[0.0], phases, used, stop.ends]))
        times = times[np.append(np.diff(times) > 0.1 * FIT, True)]
        bends = _bends(stop, times, ahead, profile)
        for _ in range(FITS):
            profile = RateProfile(times=times, bends=_to_rest(times, bends, stop.delays[0]))
            found = profile.times_of(knots)
            found = found[found > stop.delays[0]]
            if len(found) != len(used):
                break
            if np.abs(found - used).max(initial=0.0) < FIT:
                return profile
            # The same bends, their jumps where they belong.
            moved = times.copy()
            moved[np.searchsorted(times, used)] = found
            used = found
            if not (np.diff(moved) > 0.0).all():
                break
            times = moved
        used = found
    assert profile is not None
    return profile


def _bends(stop: LineStops, times: Array, ahead: Outlook, guess: RateProfile | None) -> Array:
    """Return the bends at both ends of intervals that follow a stop on a line, (n, 2)."""
    middle = 0.5 * (times[1:] + times[:-1])
    instants = np.stack([times[:-1], middle, times[1:]])
    way, speed, slope, bend = stop.during(instants, middle)
    # Where the profile really gets, once there is one: its bends have to fit the motion there.
    reached = ahead.times_at(way) if guess is None else guess.at(instants)[0]
    states = derivatives_around(ahead.running, reached)
    bends = _rate(states, speed, slope, bend, ahead.weights)[2][[0, 2]].T
    return np.where(middle[:, None] < stop.delays[0], 0.0, bends)


def _to_rest(times: Array, bends: Array, begin: float) -> Array:
    """Return bends, (n, 2), and what they lack to a rate and a slope of 0 at the end, a line."""
    T = times[-1] - begin
    share = (np.stack([times[:-1], times[1:]], axis=1) - begin) / T
    is_before = (times[1:] <= begin)[:, None]
    # Twice, for rounding.
    for _ in range(2):
        slopes, rates, _ = integrated(times, bends)
        by_time = (12.0 * rates[-1] - 6.0 * slopes[-1] * T) / T**2
        line = -slopes[-1] / T + by_time * (share - 0.5)
        bends = np.where(is_before, 0.0, bends + line)
    return bends
