# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether an arm stands still, by its positions: they are noisy, or come in steps."""

import numpy as np
from rrth_planner.model.arrays import Array

# Positions are judged over so long at most [s]. A real motion at twice the speed that counts as
# rest fills it, and is found by then.
WINDOW = 0.3
# Readings are no more exactly in time than this [s].
TICK = 1e-3
# And over so long at least [s].
SHORTEST = 0.02
# The window is as long as the standard error of the mean velocity needs to be this share of the
# speed that counts as rest: a joint at rest seems to move once in 3.5 million times, ...
SHARE = 0.2
# ... and so many times as long as a joint at that speed takes for a step of its encoder: what
# flickers between two counts has a mean velocity of 1.5 steps a window at most.
STEPS = 2.0
# Third differences of samples with independent errors have so many times their variance, and of a
# motion only its jerk is left.
THIRD = 20.0


def mean_motion(times: Array, positions: Array, rest_speed: float) -> tuple[Array, Array]:
    """
    Return the mean positions and velocities of an arm lately, each (dof,) [rad, rad/s].

    The velocity is the slope of the line of least squares. How long lately is depends on what is
    seen of noise and of steps: 0.02 s for a fine encoder, up to 0.3 s.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Of the readings, strictly increasing, at least two [s].
    positions : ndarray, shape (n, dof)
        [rad].
    rest_speed : float
        Greatest speed that counts as rest [rad/s].

    """
    since = times - times[-1]
    # Relative to the last ones: the mean of equal numbers is that number.
    moved = positions - positions[-1]
    n = min(len(times), max(2, int((since >= -TICK - _span(since, moved, rest_speed)).sum())))
    t, q = since[-n:] - since[-n:].mean(), moved[-n:]
    return positions[-1] + q.mean(axis=0), t @ q / (t @ t)


def _span(since: Array, moved: Array, rest_speed: float) -> float:
    """Return over how long positions are to be judged [s]."""
    steps = np.abs(np.diff(moved, axis=0))
    step = np.where(steps > 0.0, steps, np.inf).min(axis=0)
    span = STEPS * float(np.where(np.isinf(step), 0.0, step).max()) / rest_speed
    if len(since) > 3:
        variance = float((np.diff(moved, 3, axis=0) ** 2).mean(axis=0).max()) / THIRD
        rate = (len(since) - 1) / -float(since[0])
        # The standard error is that of a line through so many samples.
        span = max(span, (12.0 * variance / (rate * (SHARE * rest_speed) ** 2)) ** (1.0 / 3.0))
    return min(max(span, SHORTEST), WINDOW)
