# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run: the commanded motions, the measured joint states, and the wearer."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from rrth_planner.collision.world import arm_world
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import RecordError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import REST_SPEED, sample, Trajectory

# The state of the monitor during a fail-safe stop.
STOPPING = 'stopping'
# Diagnostics lag the state that they report by a tenth of a second and more [s].
DIAGNOSTICS_DELAY = 0.3


class CommandedMotion(NamedTuple):
    """A commanded motion, and when it begins [s]."""

    begin: float
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """
    A run on one clock, whose zero is where the recording begins.

    Raises RecordError for no instant at all, shapes that differ, times that do not increase.

    Parameters
    ----------
    times : array_like, shape (n,)
        Of the joint states, strictly increasing [s].
    positions, velocities : array_like, shape (n, dof)
        Measured [rad, rad/s].
    commanded : sequence of CommandedMotion
        By their begin.
    bodies : sequence of (float, Scene)
        From when [s] the wearer was like that, in the base frame.
    targets : sequence of (float, ndarray)
        From when [s] the target was where, (3,) in the base frame [m].
    monitor_states : sequence of (float, str)
        From when [s] the monitor was in which state.

    """

    times: Array
    positions: Array
    velocities: Array
    commanded: tuple[CommandedMotion, ...] = ()
    bodies: tuple[tuple[float, Scene], ...] = ()
    targets: tuple[tuple[float, Array], ...] = ()
    monitor_states: tuple[tuple[float, str], ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        times = frozen_array(self.times, (None,), 'times', 's', RecordError)
        if len(times) == 0 or not (np.diff(times) > 0.0).all():
            raise RecordError('times: expected at least one, strictly increasing [s]')
        object.__setattr__(self, 'times', times)
        dof: int | None = None
        for name, unit in (('positions', 'rad'), ('velocities', 'rad/s')):
            value = frozen_array(getattr(self, name), (len(times), dof), name, unit, RecordError)
            object.__setattr__(self, name, value)
            dof = value.shape[1]


def section(recording: Recording, begin: float, end: float) -> Recording:
    """
    Return the run from one time to another [s]; the zero of the clock stays.

    Raises RecordError where there are no joint states then.
    """
    chosen = (recording.times >= begin) & (recording.times <= end)
    if not chosen.any():
        # No -0.00.
        first, last = recording.times[[0, -1]].round(2) + 0.0
        raise RecordError(
            f'from {begin:g} to {end:g}, expected times between {first:.2f} and {last:.2f}, when '
            'joint states were recorded [s]'
        )
    return replace(
        recording,
        times=recording.times[chosen],
        positions=recording.positions[chosen],
        velocities=recording.velocities[chosen],
    )


def commanded_at(recording: Recording, times: Array) -> tuple[Array, Array]:
    """
    Return the commanded positions and velocities at some times, (m,) [s] -> (m, dof) twice.

    NaN before the first commanded motion; at rest after the end of the last one.
    """
    q = np.full((len(times), recording.positions.shape[1]), np.nan)
    v = q.copy()
    for i, motion in enumerate(recording.commanded):
        later = recording.commanded[i + 1].begin if i + 1 < len(recording.commanded) else np.inf
        within = (times >= motion.begin) & (times < later)
        q[within], v[within], _ = sample(motion.trajectory, times[within] - motion.begin)
    return q, v


def at(changes: Sequence[tuple[float, Any]], time: float) -> Any:
    """Return what was the case at a time [s], from (since, what) in order; None: nothing yet."""
    # Without a list of the times: there may be thousands, and this is asked as often.
    i = bisect_right(changes, time, key=lambda change: change[0])
    return changes[i - 1][1] if i else None


def measured_clearances(recording: Recording, arm: ArmModel, ray_guard_length: float) -> Array:
    """
    Return the clearance of the arm at each joint state, (n,) [m].

    Signed: < 0 is inside a box. The pointing ray up to `ray_guard_length` counts as arm. NaN where
    there was no wearer yet.
    """
    result = np.full(len(recording.times), np.nan)
    shown: Scene | None = None
    for i, (time, q) in enumerate(zip(recording.times, recording.positions, strict=True)):
        scene = at(recording.bodies, float(time))
        if scene is not None and scene.boxes:
            if scene is not shown:
                shown, world = scene, arm_world(arm, scene, 0.0, ray_guard_length)
            result[i] = world.clearances(q).min()
    return result


def commanded_stops(recording: Recording) -> tuple[CommandedMotion, ...]:
    """Return the commanded stops: they begin in motion, while the monitor is stopping the arm."""
    since = [time for time, state in recording.monitor_states if state == STOPPING]
    return tuple(
        motion
        for motion in recording.commanded
        if np.abs(motion.trajectory.velocities[0]).max() > REST_SPEED
        and any(-DIAGNOSTICS_DELAY <= time - motion.begin <= DIAGNOSTICS_DELAY for time in since)
    )
