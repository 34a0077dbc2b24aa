# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer one part of whom leaves its place as fast as it may, to intercept the arm."""

from dataclasses import dataclass, field

import numpy as np
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arm import ArmModel, bars_of
from rrth_planner.model.arrays import Array
from rrth_planner.model.body_reach import Lines
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Scene
from rrth_planner.rehearsal.contacts import moving_bars

# The arm is looked at so far ahead, so often, at so many places of each bar.
HORIZON, STEP, PLACES = 1.0, 5e-3, 9
# A wearer who is aimed at any point of the arm, not a fast one, at least at one so fast [m/s].
SLOWEST = 1e-3
# Which point of the arm is intercepted: the one that can be soonest, or the fastest one.
EARLIEST, FASTEST = 'the earliest', 'the fastest'


@dataclass(slots=True, eq=False)
class Reaching:
    """
    A wearer at rest until one of his parts leaves, and gets as far as lines say within a time.

    Parameters
    ----------
    scene : Scene
        At rest.
    part : int
        Which box leaves.
    lines : tuple of (float, float)
        c [m] and w [m/s]: of the lines c + w t the least is the way of every point of it, or
        where it turns, of its fastest one, since it left.
    is_turning : bool
        Whether it turns about the vertical through its centre instead.
    begins, places, directions : list
        Legs of its way: from when [s], where its centre then is, and to where, of length 1 or 0.

    """

    scene: Scene
    part: int
    lines: Lines
    is_turning: bool = False
    begins: list[float] = field(default_factory=list)
    places: list[Array] = field(default_factory=list)
    directions: list[Array] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the boxes."""
        return tuple(box.name for box in self.scene.boxes)

    def way(self, times: Array) -> Array:
        """Return how far it has got by some times since it left, (n,) [s] -> (n,) [m]."""
        c, w = np.array(self.lines).T
        way: Array = (c + w * np.maximum(times, 0.0)[:, None]).min(axis=1)
        return np.where(times > 0.0, way, 0.0)

    def ways_ahead(self, time: float, ahead: Array) -> Array:
        """Return how far it can get from where it is at a time [s] within others, (n,) [m]."""
        since = time - self.begins[0] if self.begins else 0.0
        return self.way(since + ahead) - self.way(np.array([since]))

    def head_for(self, direction: Array, time: float) -> None:
        """Have the part move on in another direction from a time on; of length 0: it stays."""
        here = self.rows(np.array([time]))[0, self.part, :SIZE]
        self.begins.append(time)
        self.places.append(here)
        self.directions.append(direction)

    def rows(self, times: Array) -> Array:
        """Return the boxes as they are at increasing times, (n, m, 15)."""
        rows = np.repeat(self.scene.numbers[None], len(times), axis=0)
        borders = [*np.searchsorted(times, self.begins), len(times)]
        for k, (first, last) in enumerate(zip(borders[:-1], borders[1:], strict=True)):
            ways = self.ways_ahead(self.begins[k], times[first:last] - self.begins[k])
            steps = ways[:, None] * self.directions[k]
            rows[first:last, self.part, :SIZE] = self.places[k] + steps
        if self.is_turning and self.begins:
            box = self.scene.boxes[self.part]
            up = box.rotation.T @ [0.0, 0.0, 1.0]
            # The furthest corner from the axis is the fastest point.
            corners = 0.5 * box.size * (np.indices((2, 2, 2)).reshape(3, 8).T * 2 - 1)
            lever = np.linalg.norm(np.cross(corners, up), axis=1).max()
            angles = self.way(times - self.begins[0]) / lever
            for i in np.flatnonzero(times > self.begins[0]):
                angle = angles[i]
                turn = rotation_matrix(
                    np.array([0.0, 0.0, np.sin(0.5 * angle), np.cos(0.5 * angle)])
                )
                rows[i, self.part, ROTATION:] = (turn @ box.rotation).ravel()
        return rows


def interception(
    arm: ArmModel,
    q: Array,
    v: Array,
    row: Array,
    ways: Array,
    contact_speed: float,
    aim: str,
) -> Array | None:
    """
    Return in which direction a box has to leave to intercept the arm, (3,); None: it is there.

    q, v (n, dof): states that the arm is going to have, one after the other; row (15,): the box;
    ways (n,): how far it gets by then [m]. For each place of the bars the first of them in which
    the box can be there and the place is faster than the contact speed; then the place that `aim`
    says. Where none can be intercepted, the one that is missed by least.
    """
    ends, moved = moving_bars(arm, q, v)
    s = np.linspace(0.0, 1.0, PLACES)[None, None, :, None]
    points = (ends[:, :, :1] + s * (ends[:, :, 1:] - ends[:, :, :1])).reshape(len(q), -1, 3)
    pace = np.linalg.norm(moved[:, :, :1] + s * (moved[:, :, 1:] - moved[:, :, :1]), axis=-1)
    pace = pace.reshape(len(q), -1)
    rotation, half = row[ROTATION:].reshape(3, 3), 0.5 * row[SIZE:ROTATION]
    local = (points - row[:SIZE]) @ rotation
    gaps = local - np.clip(local, -half, half)
    radii = np.repeat([bar.radius for bar in bars_of(arm)[:-1]], PLACES)
    lack = np.linalg.norm(gaps, axis=-1) - radii - ways[:, None]
    is_fast = pace > max(contact_speed, SLOWEST)
    if not is_fast.any():
        is_fast = np.ones_like(is_fast)
    lack = np.where(is_fast, lack, np.inf)
    is_met = lack <= 0.0
    if is_met.any():
        first = is_met.argmax(axis=0)
        columns = np.flatnonzero(is_met.any(axis=0))
        rank = first[columns] if aim == EARLIEST else -pace[first[columns], columns]
        column = int(columns[rank.argmin()])
        at = int(first[column])
    else:
        at, column = (int(k) for k in np.unravel_index(lack.argmin(), lack.shape))
    gap = gaps[at, column]
    length = float(np.linalg.norm(gap))
    if length == 0.0:
        return None
    direction: Array = rotation @ (gap / length)
    return direction
