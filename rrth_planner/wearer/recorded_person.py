# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A person as a tracker has recorded him: a posture at any time."""

from dataclasses import dataclass, replace
import math

import numpy as np
from rrth_planner.model.arrays import Array, FARTHEST
from rrth_planner.model.errors import printable, RecordError
from rrth_planner.model.frozen import Frozen
from rrth_planner.wearer.posture import Posture

# Rotations closer to each other than this, or to half a turn, have no axis [-].
NO_AXIS = 1e-6
# Times closer to that of a frame than this part of a period are that of the frame.
SAME_FRAME = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RecordedPerson(Frozen):
    """
    Where the points of a skeleton were, at a fixed rate, in the frame of the tracker.

    Parameters
    ----------
    names : tuple of str
        As the tracker calls them.
    rate : float
        Frames per second, > 0 [1/s].
    positions : array_like, shape (n_frames, n, 3)
        [m]; NaN where a point was lost.
    rotations : array_like, shape (n_frames, n, 3, 3), or None
        Axes of the frame at each point, as columns; NaN where unknown. None: points only.

    Raises
    ------
    RecordError
        Arrays of other shapes, no frame, a name that comes twice or is not printable, another
        rate, a number beyond 1e4.

    """

    names: tuple[str, ...]
    rate: float
    positions: Array
    rotations: Array | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        for k, name in enumerate(self.names):
            printable(name, f'point {k}', RecordError)
            if name in self.names[:k]:
                raise RecordError(f'point "{name}": given twice, expected each name once')
        if not 0.0 < self.rate < math.inf:
            raise RecordError(f'rate: {self.rate}, expected a number > 0 [1/s]')
        n_frames, n = len(self.positions), len(self.names)
        if not n_frames or not n:
            raise RecordError(f'{n_frames} frames of {n} points, expected at least one of each')
        for field, shape in (('positions', (n_frames, n, 3)), ('rotations', (n_frames, n, 3, 3))):
            value = getattr(self, field)
            if value is None:
                continue
            array = np.array(value, dtype=np.float64)
            if array.shape != shape:
                raise RecordError(f'{field}: shape {array.shape}, expected {shape}')
            if (np.abs(array) > FARTHEST).any():
                raise RecordError(f'{field}: beyond {FARTHEST:g} in places, expected at most that')
            array.setflags(write=False)
            object.__setattr__(self, field, array)

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return (len(self.positions) - 1) / self.rate


def posture_at(person: RecordedPerson, time: float) -> Posture:
    """
    Return the posture at a time [s] from the first frame, on and on.

    Past its last frame a recording is played backwards, and then forwards again: nowhere does he
    jump, and whoever moves backwards in time is as fast. Between two frames positions are
    interpolated linearly, and rotations about a fixed axis; a point that is lost in one of the two
    is lost.
    """
    positions, rotations = postures_at(person, np.array([time]))
    return Posture(
        names=person.names,
        positions=positions[0],
        rotations=None if rotations is None else rotations[0],
    )


def postures_at(person: RecordedPerson, times: Array) -> tuple[Array, Array | None]:
    """Return positions (m, n, 3) and rotations (m, n, 3, 3) of `posture_at`, at times (m,) [s]."""
    duration = person.duration
    if duration > 0.0:
        times = duration - np.abs(times % (2.0 * duration) - duration)
    return _interpolated(person, np.minimum(np.maximum(times, 0.0), duration))


def excerpt(
    person: RecordedPerson, begin: float = 0.0, end: float | None = None
) -> RecordedPerson:
    """
    Return the frames from one time to another, both included [s]; without `end` to the last.

    Raise RecordError where there is none between them.
    """
    end = person.duration if end is None else end
    if not 0.0 <= begin <= end <= person.duration + SAME_FRAME:
        raise RecordError(
            f'excerpt from {begin:g} to {end:g}, expected times in this order within the '
            f'recording, 0 to {person.duration:.3f} [s]'
        )
    first = math.ceil(begin * person.rate - SAME_FRAME)
    last = math.floor(end * person.rate + SAME_FRAME)
    if last < first:
        raise RecordError(
            f'excerpt from {begin:g} to {end:g}: no frame, expected at least '
            f'{1.0 / person.rate:g} between them [s]'
        )
    kept = slice(first, last + 1)
    rotations = None if person.rotations is None else person.rotations[kept]
    return replace(person, positions=person.positions[kept], rotations=rotations)


def resampled(person: RecordedPerson, rate: float) -> RecordedPerson:
    """Return a recording with another rate > 0 [1/s], interpolated as by `posture_at`."""
    if not 0.0 < rate < math.inf:
        raise RecordError(f'rate: {rate}, expected a number > 0 [1/s]')
    n_frames = 1 + math.floor(person.duration * rate + SAME_FRAME)
    positions, rotations = _interpolated(person, np.arange(n_frames) / rate)
    return replace(person, rate=rate, positions=positions, rotations=rotations)


def _interpolated(person: RecordedPerson, times: Array) -> tuple[Array, Array | None]:
    """Return positions (m, n, 3) and rotations (m, n, 3, 3) at times (m,) of the recording."""
    place = times * person.rate
    nearest = np.rint(place)
    # A point that is known in a frame is known at its time, whatever the next frame lacks.
    place = np.where(np.abs(place - nearest) < SAME_FRAME, nearest, place)
    last = len(person.positions) - 1
    before = np.clip(np.floor(place).astype(int), 0, last)
    after = np.clip(np.ceil(place).astype(int), 0, last)
    part = np.clip(place - before, 0.0, 1.0)[:, None, None]
    begin, end = person.positions[before], person.positions[after]
    positions = begin + part * (end - begin)
    if person.rotations is None:
        return positions, None
    return positions, _turned(person.rotations[before], person.rotations[after], part[..., None])


def _turned(begin: Array, end: Array, part: Array) -> Array:
    """
    Return rotations a part of the way from one to another, about the axis between them.

    It is the slerp of their quaternions, by the formula of Rodrigues. Where there is no axis, the
    nearer of the two is taken.
    """
    between = np.swapaxes(begin, -1, -2) @ end
    # The sine of the angle, times the axis as a cross product.
    cross = 0.5 * (between - np.swapaxes(between, -1, -2))
    sine = np.sqrt(0.5) * np.linalg.norm(cross, axis=(-2, -1))[..., None, None]
    cosine = 0.5 * (np.trace(between, axis1=-2, axis2=-1)[..., None, None] - 1.0)
    has_axis = sine > NO_AXIS
    axis = cross / np.where(has_axis, sine, 1.0)
    angle = part * np.arctan2(sine, cosine)
    turn = np.eye(3) + np.sin(angle) * axis + (1.0 - np.cos(angle)) * (axis @ axis)
    # The sine of a lost one is NaN, so it has no axis; lost in either, it is lost.
    nearer = np.where(part < 0.5, begin + 0.0 * end, end + 0.0 * begin)
    return np.where(has_axis, begin @ turn, nearer)
