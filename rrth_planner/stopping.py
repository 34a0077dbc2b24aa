# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The soonest stop along the path of a motion that holds velocity, acceleration and jerk."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rrth_planner.arrays import Array
from rrth_planner.bernstein import from_values
from rrth_planner.rate import integrated, RateProfile
from rrth_planner.trajectory import (
    jerks_at,
    MotionLimits,
    piece_coefficients,
    sample,
    Trajectory,
)

# What is tried: delays, in shares of the time that is looked at; in shares of the limits that are
# left along the path, decelerations and the jerks that build them up.
DELAYS = np.linspace(0.0, 0.8, 9)
DECELERATIONS = np.array([0.98, 0.85, 0.7, 0.5, 0.3, 0.15])
JERKS = np.array([0.97, 0.8, 0.6, 0.4, 0.2, 0.1])
# Instants that the motion is looked at; steps of each phase of a stop, and of those that are only
# compared.
GRID, STEPS, FEW_STEPS = 512, 16, 8
# How many of the candidates, the soonest first, are put to the proof before longer times are.
PROOFS = 6
# How often a profile is fitted to where it meets the points of the motion, at most.
FITS = 6
# A stop that saves less of the motion's own time is none.
WORTH = 0.99
# Rounding of bounds that hold exactly.
ROUNDING = 1e-6
# On each interval velocity, acceleration and jerk are polynomials of degree 19, 18 and 17 in time:
# derivatives of a quintic of a quartic, times rates.
NODES, TO_BERNSTEIN = from_values(19)
# Messages carry whole nanoseconds: less is no time [s].
TICK = 1e-9


def first_rest(trajectory: Trajectory, phase: float) -> int:
    """Return the first point after some time [s] at which the motion stands still."""
    is_rest = ~(trajectory.velocities.any(axis=1) | trajectory.accelerations.any(axis=1))
    after = np.flatnonzero(is_rest & (trajectory.times > phase))
    return int(after[0]) if len(after) else len(trajectory.times) - 1


def soonest_stop(
    trajectory: Trajectory, phase: float, scale: float, limits: MotionLimits
) -> RateProfile | None:
    """
    Return how a motion comes to rest along its path, or None where it does so itself as soon.

    Of some thousand stops with a constant jerk along the path up to a constant deceleration, and
    back, some beginning later, the soonest is taken that is proven to hold the limits of every
    joint at every instant, or what the motion itself does up to there, where that is more.

    Parameters
    ----------
    trajectory : Trajectory
    phase : float
        Where in the motion [s].
    scale : float
        Seconds of the motion per second of the clock; times of the profile are the clock's [-].
    limits : MotionLimits

    """
    remaining = (trajectory.times[first_rest(trajectory, phase)] - phase) / scale
    with np.errstate(all='ignore'):
        window = min(remaining, _first_window(trajectory, phase, scale, limits))
        while True:
            own = _own_motion(trajectory, phase, scale, limits, window)
            for profile in _soonest_first(own, trajectory, phase, scale, limits, remaining):
                if holds(trajectory, phase, scale, profile, limits):
                    return profile
            if window >= remaining:
                return None
            window = min(remaining, 4.0 * window)


def holds(
    trajectory: Trajectory, phase: float, scale: float, profile: RateProfile, limits: MotionLimits
) -> bool:
    """Return whether a stop is proven to hold limits, or what the motion does where it is more."""
    # Until it begins the motion is what it was.
    begin = 0.0 if profile.bends[0].any() else profile.times[1]
    knots = profile.times_of((trajectory.times - phase) / scale)
    cuts = np.unique(np.concatenate([profile.times, knots]))
    cuts = cuts[cuts >= begin]
    cuts = cuts[np.append(np.diff(cuts) > TICK, True)]
    times = cuts[:-1, None] + np.diff(cuts)[:, None] * NODES
    reached = phase + scale * np.linspace(0.0, profile.ways[-1], GRID)
    own = _derivatives(trajectory, reached, scale)
    stop = slowed(trajectory, phase, scale, profile, times.ravel())
    for limit, most, values in zip(
        (limits.velocity, limits.acceleration, limits.jerk), own, stop, strict=True
    ):
        allowed = np.maximum(limit, np.abs(most).max(axis=0)) * (1.0 + ROUNDING)
        control = np.abs(TO_BERNSTEIN @ values.reshape(*times.shape, -1)).max(axis=(0, 1))
        if not (control <= allowed).all():
            return False
    return True


def slowed(
    trajectory: Trajectory, phase: float, scale: float, profile: RateProfile, times: Array
) -> tuple[Array, Array, Array]:
    """
    Return velocities, accelerations and jerks along a stop, each (m, dof), (m,) [s].

    With the time in the motion s(t) these are q' s', q'' s'^2 + q' s'' and
    q''' s'^3 + 3 q'' s' s'' + q' s'''.
    """
    way, *rates = profile.at(times)
    rate, slope, bend = (values[:, None] for values in rates)
    v, a, j = _derivatives(trajectory, phase + scale * way, scale)
    return v * rate, a * rate**2 + v * slope, j * rate**3 + 3.0 * a * rate * slope + v * bend


def _derivatives(trajectory: Trajectory, phases: Array, scale: float) -> tuple[Array, ...]:
    """Return velocities, accelerations and jerks of a motion by the clock, each (m, dof)."""
    _, v, a = sample(trajectory, phases)
    return v * scale, a * scale**2, jerks_at(trajectory, phases) * scale**3


def _on_one_piece(trajectory: Trajectory, phases: Array, scale: float) -> Array:
    """Return `_derivatives` of the pieces of the middle row, (3, m) -> (3, m, 3, dof)."""
    i = np.searchsorted(trajectory.times[1:-1], phases[1], side='right')
    width = (trajectory.times[i + 1] - trajectory.times[i])[:, None]
    u = (phases - trajectory.times[i])[..., None] / width
    c = piece_coefficients(trajectory)[i]
    v = (((5 * c[:, 5] * u + 4 * c[:, 4]) * u + 3 * c[:, 3]) * u + 2 * c[:, 2]) * u + c[:, 1]
    a = ((20 * c[:, 5] * u + 12 * c[:, 4]) * u + 6 * c[:, 3]) * u + 2 * c[:, 2]
    j = (60 * c[:, 5] * u + 24 * c[:, 4]) * u + 6 * c[:, 3]
    rate = scale / width
    return np.stack([v * rate, a * rate**2, j * rate**3], axis=-2)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _OwnMotion:
    """
    What a motion does from now on, at instants of the clock.

    Parameters
    ----------
    times : ndarray, shape (m,)
        From now on, equally spaced [s].
    states : ndarray, shape (m, 3, dof)
        Velocity, acceleration, jerk.
    limits : ndarray, shape (m, 3, dof)
        What a stop that gets that far may do.
    speeds, slopes : ndarray, shape (m,)
        Speed along the path, in accelerations of the joints [1/s], and its slope [1/s^2].
    ways : ndarray, shape (m,)
        Integral of the speed [-].

    """

    times: Array
    states: Array
    limits: Array
    speeds: Array
    slopes: Array
    ways: Array


def _times_at(own: _OwnMotion, ways: Array) -> Array:
    """Return when a motion has come so far [s], by the cubics that fit its speeds too."""
    i = np.clip(np.searchsorted(own.ways, ways, side='right') - 1, 0, GRID - 2)
    width = own.ways[i + 1] - own.ways[i]
    u = (ways - own.ways[i]) / width
    first, last = width / own.speeds[i], width / own.speeds[i + 1]
    step = own.times[1] - own.times[0]
    return own.times[i] + u * (
        first + u * (3.0 * step - 2.0 * first - last + u * (first + last - 2.0 * step))
    )


def _first_window(
    trajectory: Trajectory, phase: float, scale: float, limits: MotionLimits
) -> float:
    """Return a time in which the arm could stop three times if it moved on a line [s]."""
    v, a, _ = (np.abs(x[0]) for x in _derivatives(trajectory, np.array([phase]), scale))
    ramp = (limits.acceleration + a) / limits.jerk
    return 3.0 * float((v / limits.acceleration + ramp).max())


def _own_motion(
    trajectory: Trajectory, phase: float, scale: float, limits: MotionLimits, window: float
) -> _OwnMotion:
    """Return what a motion does within a time [s], without a stop."""
    times = np.linspace(0.0, window, GRID)
    v, a, j = _derivatives(trajectory, phase + scale * times, scale)
    speed, slope, _ = _along(np.stack([v, a, j], axis=1), limits.acceleration)
    step = times[1] - times[0]
    # The trapezoid with what its ends' slopes say of the bulge.
    pieces = 0.5 * step * (speed[1:] + speed[:-1]) + step**2 / 12.0 * (slope[:-1] - slope[1:])
    states = np.stack([v, a, j], axis=1)
    most = np.stack([limits.velocity, limits.acceleration, limits.jerk])
    return _OwnMotion(
        times=times,
        states=states,
        limits=np.maximum(most, np.maximum.accumulate(np.abs(states))),
        speeds=speed,
        slopes=slope,
        ways=np.append(0.0, np.cumsum(pieces)),
    )


def _along(states: Array, weights: Array) -> tuple[Array, Array, Array]:
    """
    Return the speed along the path and its two derivatives, from (..., 3, dof).

    Joints are weighed by their accelerations, so that radians and metres can be added.
    """
    v, a, j = (states[..., k, :] / weights for k in range(3))
    # At rest the derivatives come out as 0 or immense, never as no number.
    speed = np.maximum(np.sqrt((v * v).sum(axis=-1)), 1e-150)
    slope = (v * a).sum(axis=-1) / speed
    bend = ((a * a).sum(axis=-1) + (v * j).sum(axis=-1) - slope**2) / speed
    return speed, slope, bend


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Stops:
    """
    Stops of three phases: jerk -rho, none, rho along the path, from a speed and a slope to 0.

    Parameters
    ----------
    delays : ndarray, shape (n,)
        When each begins [s].
    durations : ndarray, shape (n, 3)
        Of the phases [s].
    ways, speeds, slopes : ndarray, shape (n, 3)
        At the beginning of the phases [-, 1/s, 1/s^2].
    bends : ndarray, shape (n, 3)
        Jerks of the phases [1/s^3].

    """

    delays: Array
    durations: Array
    ways: Array
    speeds: Array
    slopes: Array
    bends: Array

    def chosen(self, which: NDArray[np.intp]) -> '_Stops':
        """Return some of them."""
        names = ('delays', 'durations', 'ways', 'speeds', 'slopes', 'bends')
        return _Stops(**{name: getattr(self, name)[which] for name in names})

    def at(self, shares: Array) -> tuple[Array, ...]:
        """Return times, ways, speeds, slopes, bends at shares of each phase, (n, 3, m)."""
        t = self.durations[..., None] * shares
        begin = self.delays[:, None] + np.cumsum(self.durations, axis=1) - self.durations
        x, v, a, j = (
            part[..., None] for part in (self.ways, self.speeds, self.slopes, self.bends)
        )
        return (
            begin[..., None] + t,
            x + t * (v + t * (0.5 * a + t * j / 6.0)),
            v + t * (a + 0.5 * t * j),
            a + t * j,
            j + 0.0 * t,
        )

    def during(self, times: Array, middle: Array) -> tuple[Array, ...]:
        """Return ways, speeds, slopes, bends of one stop, in the phases that `middle` is in."""
        ends = self.delays[0] + np.cumsum(self.durations[0])
        p = np.searchsorted(ends[:2], middle)
        t = times - (ends - self.durations[0])[p]
        x, v, a, j = (part[0, p] for part in (self.ways, self.speeds, self.slopes, self.bends))
        return (
            x + t * (v + t * (0.5 * a + t * j / 6.0)),
            v + t * (a + 0.5 * t * j),
            a + t * j,
            j + 0.0 * t,
        )


def _stops(own: _OwnMotion, limits: MotionLimits) -> _Stops:
    """Return all stops that are tried."""
    first = np.unique((DELAYS * (GRID - 1)).astype(np.intp))
    direction = np.abs(own.states[first, 0]) / own.speeds[first, None] + 1e-300
    most = (limits.acceleration / direction).min(axis=1)
    hardest = (limits.jerk / direction).min(axis=1)
    i, deceleration, jerk = (
        part.ravel() for part in np.meshgrid(first, DECELERATIONS, JERKS, indexing='ij')
    )
    of = np.searchsorted(first, i)
    x, v, a = own.ways[i], own.speeds[i], own.slopes[i]
    rho = jerk * hardest[of]
    # Where the motion already slows down faster, the stop goes on from there.
    sigma = np.maximum(deceleration * most[of], -a)
    peak = np.minimum(np.sqrt(rho * v + 0.5 * a * a), sigma)
    ramp = (a + peak) / rho
    hold = np.maximum((v + 0.5 * a * a / rho - peak * peak / rho) / peak, 0.0)
    # What is lost in the ramp back is more than there is.
    is_real = (ramp >= 0.0) & (v >= 0.5 * a * np.minimum(a, 0.0) / rho)
    durations = np.stack([np.where(is_real, ramp, np.nan), hold, peak / rho], axis=1)
    speed_1 = v + ramp * (a - 0.5 * rho * ramp)
    speed_2 = 0.5 * peak * peak / rho
    way_1 = x + ramp * (v + ramp * (0.5 * a - rho * ramp / 6.0))
    way_2 = way_1 + 0.5 * hold * (speed_1 + speed_2)
    zero = np.zeros_like(v)
    return _Stops(
        delays=own.times[i],
        durations=durations,
        ways=np.stack([x, way_1, way_2], axis=1),
        speeds=np.stack([v, speed_1, speed_2], axis=1),
        slopes=np.stack([a, -peak, -peak], axis=1),
        bends=np.stack([-rho, zero, rho], axis=1),
    )


def _soonest_first(
    own: _OwnMotion,
    trajectory: Trajectory,
    phase: float,
    scale: float,
    limits: MotionLimits,
    remaining: float,
) -> Iterator[RateProfile]:
    """Yield profiles that seem to hold the limits, those that end first before."""
    stops = _stops(own, limits)
    ends = stops.delays + stops.durations.sum(axis=1)
    shares = np.linspace(0.0, 1.0, FEW_STEPS + 1)
    is_real = (ends < WORTH * remaining) & np.isfinite(stops.ways).all(axis=1)
    # Those that do not get as far as their deceleration are the same for all of these.
    same = np.stack([stops.delays, stops.bends[:, 2], stops.durations[:, 2]], axis=1)
    soon = np.unique(same[is_real], axis=0, return_index=True)[1]
    soon = np.flatnonzero(is_real)[soon]
    stops, ends = stops.chosen(soon), ends[soon]
    _, way, speed, slope, bend = stops.at(shares)
    last = np.searchsorted(own.ways, way[:, -1, -1])
    is_within = last < GRID
    # By linear interpolation between instants of the motion: good enough to choose from.
    at = np.interp(way, own.ways, np.arange(GRID, dtype=np.float64))
    low = np.minimum(at.astype(np.intp), GRID - 2)
    states = own.states[low] + (at - low)[..., None, None] * (
        own.states[low + 1] - own.states[low]
    )
    own_speed, own_slope, own_bend = _along(states, limits.acceleration)
    rate = speed / own_speed
    rate_slope = (slope - own_slope * rate**2) / own_speed
    rate_bend = (bend - 3.0 * own_slope * rate * rate_slope - own_bend * rate**3) / own_speed
    r, w, u = (part[..., None] for part in (rate, rate_slope, rate_bend))
    v, a, j = (states[..., k, :] for k in range(3))
    allowed = own.limits[np.minimum(last, GRID - 1)]
    fits = is_within
    for k, value in enumerate((v * r, a * r**2 + v * w, j * r**3 + 3.0 * a * r * w + v * u)):
        fits &= (np.abs(value).max(axis=(1, 2)) <= allowed[:, k]).all(axis=-1)
    order = np.flatnonzero(fits)
    for i in order[np.argsort(ends[order], kind='stable')][:PROOFS]:
        profile = _profile(stops.chosen(np.array([i])), own, trajectory, phase, scale, limits)
        if profile is not None:
            yield profile


def _profile(
    stop: _Stops,
    own: _OwnMotion,
    trajectory: Trajectory,
    phase: float,
    scale: float,
    limits: MotionLimits,
) -> RateProfile | None:
    """Return the rate of a stop, or None where there is none that never goes back."""
    shares = np.arange(STEPS) / STEPS
    # Just after its start a motion is so slow that bends are great, and fall fast.
    phases = stop.at(np.stack([shares**2, shares, shares]))[0].ravel()
    end = float(stop.delays[0] + stop.durations[0].sum())
    knots = (trajectory.times - phase) / scale
    inner = np.empty(0)
    profile = None
    # Where pieces of the motion meet, its jerk may change at once, and so has the bend to; when
    # that is depends on the bends.
    for _ in range(FITS):
        times = np.unique(np.concatenate([[0.0], phases, inner, [end]]))
        times = times[np.append(np.diff(times) > 0.01 * TICK, True)]
        bends = _bends(stop, times, own, trajectory, phase, scale, limits, profile)
        if bends is None:
            return None
        profile = RateProfile(times=times, bends=bends)
        if not (profile.is_forward and profile.ways[-1] <= own.times[-1]):
            return None
        before, inner = inner, profile.times_of(knots)
        inner = inner[inner > stop.delays[0]]
        if len(inner) == len(before) and np.abs(inner - before).max(initial=0.0) < 0.1 * TICK:
            break
    return profile


def _bends(
    stop: _Stops,
    times: Array,
    own: _OwnMotion,
    trajectory: Trajectory,
    phase: float,
    scale: float,
    limits: MotionLimits,
    guess: RateProfile | None,
) -> Array | None:
    """Return bends at the ends of intervals that give a stop along the path, (n, 2)."""
    middle = 0.5 * (times[1:] + times[:-1])
    instants = np.stack([times[:-1], middle, times[1:]])
    way, speed, slope, bend = stop.during(instants, middle)
    # At what the profile really passes, once there is one: bends have to fit the motion there.
    reached = _times_at(own, way) if guess is None else guess.at(instants)[0]
    at = phase + scale * reached
    # The piece that the middle of an interval is on goes on to both of its ends.
    states = _on_one_piece(trajectory, at, scale)[[0, 2]]
    speed, slope, bend = speed[[0, 2]], slope[[0, 2]], bend[[0, 2]]
    own_speed, own_slope, own_bend = _along(states, limits.acceleration)
    rate = speed / own_speed
    rate_slope = (slope - own_slope * rate**2) / own_speed
    bends = ((bend - 3.0 * own_slope * rate * rate_slope - own_bend * rate**3) / own_speed).T
    bends[middle < stop.delays[0]] = 0.0
    # What is still missing to a rate and a slope of 0 at the end, as a line; twice, for rounding.
    begin, T = stop.delays[0], times[-1] - stop.delays[0]
    share = (np.stack([times[:-1], times[1:]], axis=1) - begin) / T
    for _ in range(2):
        slopes, rates, _ = integrated(times, bends)
        lacks = [-slopes[-1], -rates[-1]]
        c = np.linalg.solve([[T, T / 2], [T**2 / 2, T**2 / 6]], lacks)
        bends += np.where(middle[:, None] < begin, 0.0, c[0] + c[1] * share)
    return bends if np.isfinite(bends).all() else None
