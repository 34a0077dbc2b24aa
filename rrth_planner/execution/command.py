# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The commanded curve: each message continues what the controller was given before it.

A controller follows time, not the arm: what replaces a motion begins with the state that is
commanded then, wherever an arm that lags behind may be. A message begins shortly before it is
published, with the motion that it replaces, and leaves that only once every controller has it: so
no controller has to make a piece of its own, and a late one misses nothing.
"""

import numpy as np
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.curves import motion_through, part
from rrth_planner.model.errors import RrthError
from rrth_planner.model.frozen import changed
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.timing.fast_stop import fast_stop

# A controller samples a message up to a cycle after it has it; it runs at 200 Hz or faster. In
# half of such a cycle two motions part by less than 3e-7 rad at 80 rad/s^3 [s].
CYCLE = 2.5e-3
# A message begins so long before its publication, and the greatest delay of the controller before
# that: where the arm may be belongs to it [s].
BEFORE = 5e-3
# A message continues the one before it where their states differ by no more than this: rounding,
# and what a change of rate differs from its polynomials [rad, rad/s, rad/s^2].
SAME_STATE = 1e-6, 1e-4, 0.02
# A point of the motion before so near to the end of a lead-in is left out: in a shorter piece the
# rounding of a position is an acceleration [s].
NEAR_END = 1e-4


def ahead(delay: float) -> float:
    """Return how long after its publication a message may leave the motion before it [s]."""
    return delay + CYCLE


def begin_of(now: float, delay: float) -> float:
    """Return when a message begins that is published now [s]."""
    return now - delay - BEFORE


def lead_in(before: Trajectory, begin: float, end: float) -> Trajectory:
    """Return what is commanded between two times of a motion [s], and at rest after its end."""
    begin = min(max(begin, 0.0), end)
    if end <= before.duration:
        return part(before, begin, end)
    motion = part(before, begin, before.duration)
    n, dof = motion.positions.shape
    times, states = np.empty(n + 1), np.zeros((3, n + 1, dof))
    times[:n] = motion.times
    times[n] = motion.duration + max(end - max(begin, before.duration), 0.0)
    states[0, :n], states[0, n] = motion.positions, motion.positions[-1]
    # At rest from its end on.
    states[1, : n - 1], states[2, : n - 1] = motion.velocities[:-1], motion.accelerations[:-1]
    return motion_through(times, states)


def rest_at(motion: Trajectory, duration: float) -> Trajectory:
    """Return a rest where a motion begins, for some time before it [s]; 0: only that point."""
    still = np.zeros_like(motion.positions[:1])
    place = Trajectory(np.zeros(1), motion.positions[:1], still, still)
    return lead_in(place, 0.0, duration) if duration > 0.0 else part(motion, 0.0, 0.0)


def continues(lead: Trajectory, after: Trajectory) -> bool:
    """Return whether a motion begins with the state in which its lead-in ends."""
    gaps = zip(_gaps(lead, after), SAME_STATE, strict=True)
    return all(gap <= largest for gap, largest in gaps)


def led(lead: Trajectory, after: ExecutingMotion) -> ExecutingMotion:
    """
    Return a motion with its lead-in before it.

    Raises
    ------
    RrthError
        It does not begin with the state in which the lead-in ends.

    """
    motion = after.trajectory
    if not continues(lead, motion):
        q, v, a = _gaps(lead, motion)
        raise RrthError(
            f'the motion begins {q:.2g} rad (or m), {v:.2g} rad/s and {a:.2g} rad/s^2 from what '
            f'is commanded then, expected at most {SAME_STATE[0]:g}, {SAME_STATE[1]:g} and '
            f'{SAME_STATE[2]:g}'
        )
    end = lead.duration
    # The first point stays, however near to the end it is.
    kept = int(lead.times[:-1].searchsorted(end - NEAR_END)) if end > 0.0 else 0
    kept = max(kept, int(end > 0.0))
    n, dof = motion.positions.shape
    times, states = np.empty(kept + n), np.empty((3, kept + n, dof))
    times[:kept], times[kept:] = lead.times[:kept], end + motion.times
    for row, one, other in zip(states, lead.states, motion.states, strict=True):
        row[:kept], row[kept:] = one[:kept], other
    return changed(
        after,
        trajectory=motion_through(times, states),
        start_time=after.start_time - end,
        escape_time=after.escape_time + end if after.escape_time > 0.0 else 0.0,
    )


def stop_along(
    running: ExecutingMotion,
    phase: float,
    now: float,
    limits: MotionLimits,
    delay: float,
    is_on_reception: bool = False,
) -> ExecutingMotion:
    """
    Return the fail-safe stop along a motion, to be published now [s].

    phase: the time within the motion that is commanded now [s]; delay: greatest delay of the
    controller [s]; is_on_reception: the controller executes it from its begin, whatever time it
    is by its clock. Before the motion begins the stop begins with it.
    """
    if phase < 0.0:
        stop = fast_stop(running.trajectory, phase, limits)
        return ExecutingMotion(trajectory=stop, start_time=running.start_time)
    back = 0.0 if is_on_reception else min(phase, now - begin_of(now, delay))
    stop = fast_stop(running.trajectory, phase - back, limits, back + ahead(delay))
    return ExecutingMotion(trajectory=stop, start_time=now - back)


def _gaps(lead: Trajectory, after: Trajectory) -> list[float]:
    """Return how far apart the states are where two motions meet: three numbers."""
    pairs = zip(lead.states, after.states, strict=True)
    return [max(map(abs, (one[-1] - other[0]).tolist())) for one, other in pairs]
