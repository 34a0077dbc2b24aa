# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The soonest stop along the path of a motion that is proven to hold every limit."""

import numpy as np
from rrth_planner.model.bernstein import from_values
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.timing.running import derivatives_along, derivatives_at, first_rest, Running
from rrth_planner.timing.stop_candidates import outlook, soonest_profiles
from rrth_planner.timing.time_law import RateProfile

# A stop that saves less of the motion's own time is none.
WORTH = 0.99
# So many times the stop on a line is looked ahead at first; then so many times further.
AHEAD, FURTHER = 3.0, 4.0
# Instants at which the motion itself is looked at, for what it does.
INSTANTS = 512
# Rounding of bounds that hold exactly.
ROUNDING = 1e-6
# On each interval velocity, acceleration and jerk are polynomials of degree 19, 18 and 17 in time:
# derivatives of a quintic of a quartic, times rates.
NODES, TO_BERNSTEIN = from_values(19)
# Messages carry whole nanoseconds: less is no time [s].
TICK = 1e-9


def soonest_stop(running: Running, limits: MotionLimits) -> RateProfile | None:
    """
    Return how a motion comes to rest along its path, or None where it does so itself as soon.

    Of some hundred stops with a constant jerk along the path up to a constant deceleration, and
    back, some beginning later, the soonest is taken that is proven to hold the limits of every
    joint at every instant, or what the motion itself does up to there, where that is more.
    """
    remaining = float(running.knots[first_rest(running.trajectory, running.phase)])
    window = 0.0
    with np.errstate(all='ignore'):
        while window < remaining:
            further = FURTHER * window if window else _first_look(running, limits)
            window = min(remaining, further)
            ahead = outlook(running, limits, window)
            for profile in soonest_profiles(ahead, limits, WORTH * remaining):
                if holds(running, profile, limits):
                    return profile
    return None


def holds(running: Running, profile: RateProfile, limits: MotionLimits) -> bool:
    """
    Return whether a stop is proven to hold limits, or what the motion does, where that is more.

    The proof is that of `bernstein`: a polynomial is within the hull of its coefficients. It does
    not see what lasts less than a nanosecond.
    """
    # Until the rate falls, the motion is what it was.
    begin = 0.0 if profile.bends[0].any() else profile.times[1]
    cuts = np.union1d(profile.times, profile.times_of(running.knots))
    cuts = cuts[cuts >= begin]
    cuts = cuts[np.append(np.diff(cuts) > TICK, True)]
    times = cuts[:-1, None] + np.diff(cuts)[:, None] * NODES
    values = derivatives_along(running, profile, times.ravel())
    control = TO_BERNSTEIN @ values.reshape(*times.shape, -1)
    most = np.abs(control).max(axis=(0, 1)).reshape(values.shape[1:])
    own = derivatives_at(running, np.linspace(0.0, profile.ways[-1], INSTANTS))
    limit = np.stack([limits.velocity, limits.acceleration, limits.jerk])
    allowed = np.maximum(limit, np.abs(own).max(axis=0))
    return bool((most <= allowed * (1.0 + ROUNDING)).all())


def _first_look(running: Running, limits: MotionLimits) -> float:
    """Return how far to look ahead for a stop, as if the arm moved on a line [s]."""
    v, a, _ = np.abs(derivatives_at(running, np.zeros(1))[0])
    ramp = (limits.acceleration + a) / limits.jerk
    return AHEAD * float((v / limits.acceleration + ramp).max())
