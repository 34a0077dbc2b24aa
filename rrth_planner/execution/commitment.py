# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Commitments: motions that are given to a controller, each safe by itself up to its end."""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.collision.separation import Blocked, first_unproven, permitted_ahead
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import part, state_at, states_at
from rrth_planner.model.separation import SeenBody, Separation
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.timing.fast_stop import fast_stop
from rrth_planner.timing.rate_profile import (
    continued,
    rate_state,
    RateProfile,
    scaled,
    steady,
    steered,
)

# The permitted rate is asked for at so many places ahead, so far from each other; to stop from the
# last ones takes the arm up to so far [s].
N_RATES, SPACING_AHEAD, BEYOND = 21, 0.03, 0.9
# Share of its limits that a motion slows down with; how much of a ramp that takes from the way.
GENTLE, RAMP = 0.5, 0.75
# Rates that are tried where the permitted one is not proven: shares of the present one, and of it.
OF_PRESENT, OF_PERMITTED = (1.0, 0.7), (0.5, 0.25)
# Stops that are completed once they have begun would also keep clear from so many times the
# permitted rate: its estimate may miss something.
RESERVE = 1.05
# The least rate that is tried: a motion at a much lower one would last for hours [-].
LEAST = 0.03
# Shares of the permitted rate that a motion from rest may begin with.
BEGINNINGS = (1.0, 0.5, 0.2)
# A slower joint is at rest [rad/s].
REST = 1e-6
# A rate at which the rest of the motion is tried as a whole.
WHOLE = 0.999
# A motion is at its end so shortly before it [s].
END = 1e-4
# How far the points of an arm may be from a new commitment when that begins, late or after a stop:
# 2e-4 rad at the tip of an arm of some metres [m].
JUMP_WAY = 5e-4
# What keeps an arm from what is proven and is not clear.
IN_THE_WAY = Blocked(0.0, 'the rest of the motion', 'the wearer')
# Spacing of the samples by which a stop is localized on its motion [s].
SPACING = 2e-3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Commitment:
    """
    A motion that was given to the controller: a stretch of the planned motion, then a stop.

    Parameters
    ----------
    motion : Trajectory
        The planned motion, to rest.
    trajectory : Trajectory
        The commitment, along the path of the motion, to rest.
    start_time : float
        When it begins [s].
    profile : RateProfile
        Where within the motion it is until the stop begins, and what was intended after that.
    stretch : float
        When the stop begins, after the start; infinite for the whole rest of the motion [s].

    """

    motion: Trajectory
    trajectory: Trajectory
    start_time: float
    profile: RateProfile
    stretch: float

    @property
    def is_whole(self) -> bool:
        """Whether it is the whole rest of the motion."""
        return self.stretch == math.inf

    @property
    def end_time(self) -> float:
        """When the arm is at rest [s]."""
        return self.start_time + self.trajectory.duration


def path_state(commitment: Commitment, time: float) -> Array:
    """
    Return where within the planned motion a commitment is at a time [s], and how fast.

    (3,): the time within the motion [s], the rate and its derivative [1/s]; those of `rate_state`.
    """
    elapsed = time - commitment.start_time
    if elapsed <= commitment.stretch:
        return rate_state(commitment.profile, max(elapsed, 0.0))
    begin = float(rate_state(commitment.profile, commitment.stretch)[0])
    motion, stop = commitment.motion, commitment.trajectory
    q, v, a = state_at(stop, min(elapsed, stop.duration))
    # Between its points a stop is up to 1e-4 rad from the path: the nearest place of that counts.
    ahead = min(motion.duration, begin + elapsed - commitment.stretch)
    places = np.linspace(begin, ahead, 2 + int((ahead - begin) / SPACING))
    gaps = ((states_at(motion, places)[0] - q) ** 2).sum(axis=1)
    tau = float(places[int(gaps.argmin())])
    for _ in range(4):
        p, w, _ = state_at(motion, tau)
        tau = min(max(tau + float((q - p) @ w) / max(float(w @ w), 1e-12), begin), ahead)
    _, w, b = state_at(motion, tau)
    square = max(float(w @ w), 1e-12)
    rate = min(max(float(v @ w) / square, 0.0), 1.0)
    return np.array([tau, rate, float((a - b * rate**2) @ w) / square])


def permitted(motion: Trajectory, time: float, body: SeenBody, settings: Separation) -> float:
    """Return the rate at a time from which a motion can slow down to what is permitted ahead."""
    ahead = min(BEYOND, motion.duration - time)
    n = max(2, math.ceil(ahead / SPACING_AHEAD) + 1)
    places = np.linspace(time, time + ahead, n)
    n_rates, margin = min(n, N_RATES), settings.margin + JUMP_WAY
    reserve = RESERVE if has_sharp_stops(settings) else 1.0
    found = permitted_ahead(motion, places, n_rates, body, settings, margin, reserve)
    rates, slows, fades = found.T
    places = places[:n_rates]
    # The square of the rate falls by 2 s_ddot along the way, less what the ramps take of that.
    way = np.maximum(places - time - RAMP * slows / fades, 0.0)
    return float(np.sqrt(rates**2 + 2.0 * GENTLE * slows * way).min(initial=1.0))


def first_commitment(
    motion: Trajectory, time: float, body: SeenBody, settings: Separation
) -> Commitment | Blocked:
    """
    Return the first commitment of a motion, from its beginning at a time on [s].

    body: the wearer at that time. Else where the motion is not proven separate from him: it can
    not even begin.
    """
    if len(motion.times) == 1:
        # It is there.
        profile = steady(0.0, 1.0)
        return Commitment(
            motion=motion,
            trajectory=motion,
            start_time=time,
            profile=profile,
            stretch=math.inf,
        )
    is_at_rest = bool((np.abs(motion.velocities[0]) < REST).all())
    # At rest the motion may begin at any rate.
    rate = permitted(motion, 0.0, body, settings) if is_at_rest else 1.0
    for share in BEGINNINGS if is_at_rest else (1.0,):
        state = np.array([0.0, rate * share, 0.0])
        found = _committed(motion, time, state, None, body, settings)
        if isinstance(found, Commitment):
            break
    return found or Blocked(0.0, 'the arm', 'its limits')


def extended(
    commitment: Commitment,
    time: float,
    body: SeenBody,
    settings: Separation,
    is_clear: Callable[[Trajectory], bool] = lambda curve: True,
) -> Commitment | Blocked | None:
    """
    Return the commitment that replaces the present one from a time on [s].

    body: the wearer at that time; is_clear: what else is asked of what the controller gets. None
    where the present one leads to the end of the motion, is over, has arrived there, or is in a
    stop that ends at rest first; where no longer one is proven, what keeps it from it: then the
    present one, which is proven, ends in its stop.
    """
    if commitment.is_whole or is_in_sharp_stop(commitment, time, settings):
        return None
    state = path_state(commitment, time)
    if state[0] >= commitment.motion.duration - END:
        return None
    elapsed = time - commitment.start_time
    held = continued(commitment.profile, elapsed) if elapsed <= commitment.stretch else None
    return _committed(commitment.motion, time, state, held, body, settings, is_clear)


def is_in_sharp_stop(commitment: Commitment, time: float, settings: Separation) -> bool:
    """
    Return whether a commitment is at a time [s] in a stop with more jerk than a motion may have.

    It is not left before it has ended: a controller to which that came 20 ms late would jump by
    more than 2e-4 rad, and mostly the arm brakes harder than a motion may.
    """
    elapsed = time - commitment.start_time
    is_stopping = commitment.stretch < elapsed < commitment.trajectory.duration
    return is_stopping and has_sharp_stops(settings)


def has_sharp_stops(settings: Separation) -> bool:
    """Return whether stops have more jerk than motions."""
    return bool((settings.stop_limits.jerk > settings.limits.jerk).any())


def _committed(
    motion: Trajectory,
    time: float,
    state: Array,
    held: RateProfile | None,
    body: SeenBody,
    settings: Separation,
    is_clear: Callable[[Trajectory], bool] = lambda curve: True,
) -> Commitment | Blocked | None:
    """
    Return the fastest commitment from a state that is proven, or what keeps it from it.

    None if only the limits of the arm keep it from it: it is in a stop, which has to end first.
    """
    rules, margin = settings.rules, settings.margin + JUMP_WAY
    blocked: Blocked | None = None

    def is_proven(curve: Trajectory) -> bool:
        nonlocal blocked
        found = first_unproven(curve, 0.0, settings.arm, body, rules, margin)
        if found is None and not is_clear(curve):
            found = IN_THE_WAY
        blocked = blocked or found
        return found is None

    target = max(permitted(motion, float(state[0]), body, settings), LEAST)
    slower = (min(target, share * float(state[1])) for share in OF_PRESENT)
    rates = [target, *(rate for rate in slower if rate >= LEAST)]
    rates += [max(share * target, LEAST) for share in OF_PERMITTED]
    for n, rate in enumerate(dict.fromkeys(rates)):
        profile = steered(motion, state, rate, settings.limits)
        if profile is None and n == 0:
            # At a limit already: the rate goes on changing as it was to.
            profile = held
        if profile is None:
            continue
        intended = scaled(motion, profile)
        if len(intended.times) == 1:
            # It would never move.
            continue
        # What was intended before may lead to another rate than the one that is wanted.
        kept = float(rate_state(profile, profile.change_time)[1])
        if kept >= WHOLE and is_proven(intended):
            return Commitment(
                motion=motion,
                trajectory=intended,
                start_time=time,
                profile=profile,
                stretch=math.inf,
            )
        curve = fast_stop(intended, 0.0, settings.stop_limits, settings.stretch)
        if len(curve.times) > 1 and is_proven(curve):
            return Commitment(
                motion=motion,
                trajectory=curve,
                start_time=time,
                profile=profile,
                stretch=min(settings.stretch, curve.duration),
            )
    if blocked is None:
        # No rate could be tried: the motion itself says what is in its way.
        is_proven(part(motion, float(state[0]), motion.duration))
    return blocked
