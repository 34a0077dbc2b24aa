# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A run that is over: what the arm was told, where it was seen, and the wearer beside it."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rrth_planner.collision.world import arm_world, World
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import RecordError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import REST_SPEED, sample, Trajectory

# What the guard says while it brakes.
STOPPING = 'stopping'
# Diagnostics come a tenth of a second after what they tell of, and a little later still [s].
TOLD_LATE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """
    A motion that the arm was told.

    Parameters
    ----------
    begin : float
        When it is to begin [s].
    trajectory : Trajectory

    """

    begin: float
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Recording:
    """
    A run on one clock, whose zero is where the recording begins.

    Parameters
    ----------
    times : array_like, shape (n,)
        When the arm was seen, strictly increasing [s].
    positions, velocities : array_like, shape (n, dof)
        Where it was seen, and how it moved [rad, rad/s].
    told : sequence of Told
        By their begin.
    bodies : sequence of (float, Scene)
        From when [s] the wearer was like that, in the base frame.
    targets : sequence of (float, ndarray)
        From when [s] the target was where, (3,) in the base frame [m].
    guard : sequence of (float, str)
        From when [s] the guard of the motion did what.

    Raises
    ------
    RecordError
        No instant at all, shapes that differ, times that do not increase.

    """

    times: Array
    positions: Array
    velocities: Array
    told: tuple[Told, ...] = ()
    bodies: tuple[tuple[float, Scene], ...] = ()
    targets: tuple[tuple[float, Array], ...] = ()
    guard: tuple[tuple[float, str], ...] = ()

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
    Return what was seen from one time to another [s]; the zero of the clock stays.

    Raises
    ------
    RecordError
        The arm was not seen then.

    """
    chosen = (recording.times >= begin) & (recording.times <= end)
    if not chosen.any():
        # No -0.00.
        first, last = recording.times[[0, -1]].round(2) + 0.0
        raise RecordError(
            f'from {begin:g} to {end:g}, expected times between {first:.2f} and {last:.2f}, when '
            'the arm was seen [s]'
        )
    return replace(
        recording,
        times=recording.times[chosen],
        positions=recording.positions[chosen],
        velocities=recording.velocities[chosen],
    )


def told_at(recording: Recording, times: Array) -> tuple[Array, Array]:
    """
    Return where the arm was to be at some times, and how fast, (m,) [s] -> (m, dof) twice.

    NaN before it was told anything; at rest after the end of what it was told last.
    """
    q = np.full((len(times), recording.positions.shape[1]), np.nan)
    v = q.copy()
    for i, told in enumerate(recording.told):
        later = recording.told[i + 1].begin if i + 1 < len(recording.told) else np.inf
        within = (times >= told.begin) & (times < later)
        q[within], v[within], _ = sample(told.trajectory, times[within] - told.begin)
    return q, v


def at(changes: Sequence[tuple[float, Any]], time: float) -> Any:
    """Return what was the case at a time [s], from (since, what) in order; None: nothing yet."""
    # Without a list of the times: there may be thousands, and this is asked as often.
    i = bisect_right(changes, time, key=lambda change: change[0])
    return changes[i - 1][1] if i else None


def clearances_seen(recording: Recording, arm: ArmModel, ray_guard_length: float) -> Array:
    """
    Return how far the arm was from the wearer whenever it was seen, (n,) [m].

    Signed: < 0 is inside a box. The guarded part of the pointing ray counts as arm. NaN where
    there was no wearer yet.
    """
    result = np.full(len(recording.times), np.nan)
    worlds: dict[int, World] = {}
    for i, (time, q) in enumerate(zip(recording.times, recording.positions, strict=True)):
        scene = at(recording.bodies, float(time))
        if scene is not None and scene.boxes:
            if id(scene) not in worlds:
                worlds = {id(scene): arm_world(arm, scene, 0.0, ray_guard_length)}
            result[i] = worlds[id(scene)].clearances(q).min()
    return result


def brakes(recording: Recording) -> tuple[Told, ...]:
    """Return the motions that were told to stop the arm: in motion, while the guard braked."""
    since = [time for time, state in recording.guard if state == STOPPING]
    return tuple(
        told
        for told in recording.told
        if np.abs(told.trajectory.velocities[0]).max() > REST_SPEED
        and any(-TOLD_LATE <= time - told.begin <= TOLD_LATE for time in since)
    )
