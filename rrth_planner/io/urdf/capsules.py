# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Few slim capsules around the surface of a link, and the proof that they enclose it.

A capsule is convex: one that contains the three corners of a triangle contains the triangle.
Where one capsule is too thick, the surface is cut into slabs, triangles at the cuts included, and
each slab gets its own.
"""

from collections.abc import Sequence
from itertools import pairwise
import math
from typing import NamedTuple, Protocol

import numpy as np
from rrth_planner.model.arrays import Array

# Radii are rounded up to this, after as much again for rounding [m].
STEP = 1e-6
# Slabs overlap by twice this: without, what lies on a cut would be in no capsule but for rounding
# [m].
OVERLAP = 2e-4
# A triangle this small that lies in no capsule as a whole is not enclosed [m].
SMALLEST = 1e-5
# A further capsule has to be worth this share of the volume.
WORTH = 0.1
# Slabs that cost so many times what has been found already are not looked at more closely.
HOPELESS = 1.2
# Between so many planes along each axis slabs begin and end.
N_PLANES = 11
# Axes of a greater cosine are one.
SAME = 0.995
# How far chosen planes are moved, in turn, in spacings of the planes.
SHIFTS = np.array([0.5, 0.25, 0.125])
# Radii that are tried, as multiples of the least one: a thicker capsule may be shorter.
THICKER = np.array([1.0, 1.005, 1.02, 1.04, 1.07, 1.1, 1.15, 1.2, 1.3, 1.45])
# Angles by which the direction of a capsule is varied, in turn [rad].
TILTS = 0.4 * 0.6 ** np.arange(12)


class Rounded(Protocol):
    """What has a line, (2, 3), and a radius [m]: an `Enclosure` or a `Capsule` of an arm."""

    @property
    def ends(self) -> Array:
        """Return the ends of the line [m]."""

    @property
    def radius(self) -> float:
        """Return the radius [m]."""


class Enclosure(NamedTuple):
    """
    A capsule around something.

    Parameters
    ----------
    ends : ndarray, shape (2, 3)
        Of its line [m].
    radius, slack : float
        [m]; slack: how far it reaches beyond the convex hull of what it encloses.

    """

    ends: Array
    radius: float
    slack: float


def enclosing_capsules(triangles: Array, largest_slack: float, most: int) -> list[Enclosure]:
    """
    Return as few capsules as keep a surface slim.

    Parameters
    ----------
    triangles : ndarray, shape (n, 3, 3)
        The corners of the triangles of the surface [m].
    largest_slack : float
        As long as a capsule reaches farther than this beyond what it encloses, more are tried [m].
    most : int
        Greatest number of capsules; a further one is used only where it saves 10 % of the volume.

    Returns
    -------
    list of Enclosure
        Each triangle lies in one of them, or in pieces in several.

    """
    whole = triangles.reshape(-1, 3)
    shape = _capsule_around(whole)
    found, cost = [shape], volume(shape)
    if most < 2 or shape.slack <= largest_slack:
        return found
    slabs = [_Slabs(triangles, axis) for axis in _axes_to_cut(triangles)]
    for n in range(2, most + 1):
        least, k = min((candidate.best(n)[0], k) for k, candidate in enumerate(slabs))
        worth = (1.0 + WORTH) ** (n - 1)
        if least * worth > HOPELESS * cost:
            continue
        parts = slabs[k].parts(slabs[k].refined(slabs[k].best(n)[1]))
        shapes = [_capsule_around(part) for part in parts]
        price = sum(map(volume, shapes)) * worth
        if price < cost:
            found, cost = shapes, price
        if max(shape.slack for shape in shapes) <= largest_slack:
            break
    return found


def volume(shape: Rounded) -> float:
    """Return the volume of a capsule [m^3]."""
    (begin, end), radius = shape.ends, shape.radius
    length = float(np.linalg.norm(end - begin))
    return float(np.pi * radius**2 * (length + 4.0 / 3.0 * radius))


def enclosed_in(points: Array, shape: Rounded) -> Array:
    """Return which points, (..., 3) [m], lie in a capsule, (...)."""
    (begin, end), radius = shape.ends, shape.radius
    step = end - begin
    share = np.clip((points - begin) @ step / max(float(step @ step), 1e-300), 0.0, 1.0)
    result: Array = np.linalg.norm(points - begin - share[..., None] * step, axis=-1) <= radius
    return result


def uncovered(triangles: Array, shapes: Sequence[Rounded]) -> Array:
    """
    Return the corners of what is not proven to lie in the capsules, (m, 3) [m].

    None: the capsules enclose all triangles, shape (n, 3, 3) [m], every point of them. Where no
    capsule contains all three corners of a triangle, the triangle is halved. The proof knows
    nothing of slabs.
    """
    lost = [np.empty((0, 3))]
    while len(triangles):
        inside = np.array([enclosed_in(triangles, shape) for shape in shapes], dtype=bool)
        inside = inside.reshape(-1, len(triangles), 3)
        is_left = ~inside.all(axis=2).any(axis=0)
        triangles, corners = triangles[is_left], inside[:, is_left].any(axis=0)
        edges = np.linalg.norm(triangles[:, [1, 2, 0]] - triangles, axis=2)
        is_lost = ~np.asarray(corners).all(axis=1) | (edges.max(axis=1, initial=0.0) < SMALLEST)
        lost.append(triangles[is_lost].reshape(-1, 3))
        triangles, longest = triangles[~is_lost], edges[~is_lost].argmax(axis=1)
        row = np.arange(len(triangles))
        a, b, c = (triangles[row, (longest + k) % 3] for k in range(3))
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(lost)


def half_of(triangles: Array, axis: Array, height: float) -> Array:
    """Return what lies below a height along an axis, cut there, (n, 3, 3) -> (m, 3, 3) [m]."""
    above = triangles @ axis - height
    n_below = (above <= 0.0).sum(axis=1)
    pieces = [triangles[n_below == 3]]
    for n in (1, 2):
        # The corner that lies alone on its side comes first.
        chosen, heights = triangles[n_below == n], above[n_below == n]
        lone = ((heights <= 0.0) == (n == 1)).argmax(axis=1)
        row = np.arange(len(chosen))
        (a, b, c), (u, v, w) = (
            [values[row, (lone + k) % 3] for k in range(3)] for values in (chosen, heights)
        )
        ab = a + (u / (u - v))[:, None] * (b - a)
        ac = a + (u / (u - w))[:, None] * (c - a)
        corners = [(a, ab, ac)] if n == 1 else [(ab, b, c), (ab, c, ac)]
        pieces += [np.stack(piece, axis=1) for piece in corners]
    return np.concatenate(pieces)


class _Slabs:
    """A surface between planes across an axis, and what capsules around its slabs cost."""

    def __init__(self, triangles: Array, axis: Array) -> None:
        self._triangles, self._axis = triangles, axis
        heights = triangles @ axis
        self._planes = np.linspace(heights.min(), heights.max(), N_PLANES)
        thin = [_extreme(part, N_COARSE) for part in self.parts(self._planes)]
        self._costs = np.full((N_PLANES, N_PLANES), np.inf)
        for low in range(N_PLANES - 1):
            for high in range(low + 1, N_PLANES):
                self._costs[low, high] = _least_volume(np.concatenate(thin[low:high]))

    def parts(self, planes: Array) -> list[Array]:
        """Return the corners of what lies between each two planes, (n, 3) [m]."""
        left, result = self._triangles, []
        for low, high in pairwise(planes):
            # Nothing of what lies below the first plane or above the last one, but for rounding.
            rest = left if low == planes[0] else half_of(left, -self._axis, OVERLAP - low)
            part = rest if high == planes[-1] else half_of(rest, self._axis, high + OVERLAP)
            result.append(part.reshape(-1, 3))
            left = half_of(left, -self._axis, OVERLAP - high)
        return result

    def best(self, n: int) -> tuple[float, list[int]]:
        """Return the least volume of capsules round n slabs [m^3], and the planes between."""
        # least[k]: of what lies below plane k, in as many slabs as there have been rounds.
        least, ways = self._costs[0], [[0, k] for k in range(N_PLANES)]
        for _ in range(n - 1):
            sums = least[:, None] + self._costs
            before = sums.argmin(axis=0)
            least = sums.min(axis=0)
            ways = [[*ways[k], high] for high, k in enumerate(before)]
        return float(least[-1]), ways[-1]

    def refined(self, chosen: list[int]) -> Array:
        """Return the heights of chosen planes, moved by less than their spacing [m]."""
        planes = self._planes[chosen].copy()
        for step in (self._planes[1] - self._planes[0]) * SHIFTS:
            for k in range(1, len(planes) - 1):
                tried = [planes.copy() for _ in range(3)]
                for shift, moved in zip((0.0, -step, step), tried, strict=True):
                    moved[k] += shift
                # The slabs beyond the neighbours stay as they are.
                costs = [
                    sum(map(_least_volume, self.parts(moved)[k - 1 : k + 1])) for moved in tried
                ]
                planes = tried[int(np.argmin(costs))]
        return planes


def _least_volume(points: Array) -> float:
    """Return about the volume of a capsule round points, (n, 3) [m^3], or inf: there are none."""
    if len(points) == 0:
        return np.inf
    few = _extreme(points, N_COARSE)
    directions = np.concatenate([_principal_axes(few), COARSE])
    return float(_volumes(*_capsules_along(few, directions)).min())


def _capsule_around(points: Array) -> Enclosure:
    """Return a capsule of little volume that contains points, (n, 3) [m]."""
    points = np.unique(points, axis=0)
    few = _extreme(points, N_FINE)
    directions = np.concatenate([np.eye(3), _principal_axes(few), COARSE])
    centres, axes, radii, ends = _capsules_along(few, directions)
    for tilt in TILTS:
        k = int(_volumes(centres, axes, radii, ends).argmin())
        beside = axes[k] + tilt * AROUND
        tried = beside / np.linalg.norm(beside, axis=1)[:, None]
        centres, axes, radii, ends = _capsules_along(few, np.concatenate([axes[k : k + 1], tried]))
    k = int(_volumes(centres, axes, radii, ends).argmin())
    line = centres[k] + ends[k][:, None] * axes[k]
    # Few of the points were looked at: what they miss, the radius makes up for.
    step = line[1] - line[0]
    share = np.clip((points - line[0]) @ step / max(float(step @ step), 1e-300), 0.0, 1.0)
    farthest = np.linalg.norm(points - line[0] - share[:, None] * step, axis=1).max()
    radius = round(STEP * (math.ceil(farthest / STEP) + 1), 9)
    return Enclosure(line, radius, _slack(few, line, radius))


def _slack(points: Array, ends: Array, radius: float) -> float:
    """
    Return how far a capsule reaches beyond the convex hull of points in it, (n, 3) [m].

    The greatest distance of a point of a convex body from another body in it is the greatest
    difference of their supports, of which those in many directions are looked at.
    """
    directions = DIRECTIONS[N_FINE].T
    reach = (ends @ directions).max(axis=0) + radius
    return float((reach - (points @ directions).max(axis=0)).max())


def _capsules_along(points: Array, axes: Array) -> tuple[Array, Array, Array, Array]:
    """
    Return the capsule of least volume along each of m axes that contains points, (n, 3) [m].

    Returns
    -------
    centres, axes : ndarray, shape (m, 3)
        A point of the line [m] and its direction.
    radii : ndarray, shape (m,)
        [m].
    ends : ndarray, shape (m, 2)
        From the centre along the axis [m].

    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    local = points - middle
    along = axes @ local.T
    square = (local * local).sum(axis=1) - along * along
    centre = np.zeros((len(axes), 3))
    row = np.arange(len(axes))
    # Centre of the least circle around the projections (Badoiu and Clarkson 2003).
    best, least, nearest = centre, np.full(len(axes), np.inf), square
    for i in range(N_ROUNDS):
        here = square - 2.0 * (centre @ local.T) + (centre * centre).sum(axis=1)[:, None]
        far = here.argmax(axis=1)
        is_less = (here[row, far] < least)[:, None]
        least = np.where(is_less[:, 0], here[row, far], least)
        best, nearest = np.where(is_less, centre, best), np.where(is_less, here, nearest)
        across = local[far] - along[row, far, None] * axes
        centre = centre + (across - centre) / (i + 2.0)
    square = np.maximum(nearest, 0.0)
    radii = THICKER[:, None] * np.sqrt(square.max(axis=1))
    # A cap contains a point so far beyond its end.
    beyond = np.sqrt(np.maximum(radii[..., None] ** 2 - square, 0.0))
    low, high = (along + beyond).min(axis=2), (along - beyond).max(axis=2)
    low, high = np.minimum(low, 0.5 * (low + high)), np.maximum(high, 0.5 * (low + high))
    k = (np.pi * radii**2 * (high - low + 4.0 / 3.0 * radii)).argmin(axis=0)
    return middle + best, axes, radii[k, row], np.stack([low[k, row], high[k, row]], axis=1)


def _volumes(_centres: Array, _axes: Array, radii: Array, ends: Array) -> Array:
    """Return the volumes of capsules of `_capsules_along` [m^3]."""
    result: Array = np.pi * radii**2 * (ends[:, 1] - ends[:, 0] + 4.0 / 3.0 * radii)
    return result


def _extreme(points: Array, n: int) -> Array:
    """Return the points, (m, 3), that lie farthest along one of n directions."""
    if len(points) == 0:
        return points
    n_parts = 1 + len(points) // 10000
    parts = [part for part in np.array_split(DIRECTIONS[n], n_parts) if len(part)]
    found = np.concatenate([(part @ points.T).argmax(axis=1) for part in parts])
    result: Array = points[np.unique(found)]
    return result


def _principal_axes(points: Array) -> Array:
    """Return the principal axes of points, (n, 3) -> (3, 3)."""
    offsets = points - points.mean(axis=0)
    result: Array = np.linalg.eigh(offsets.T @ offsets)[1].T
    return result


def _axes_to_cut(triangles: Array) -> Array:
    """Return directions across which a surface may be cut, (n, 3): no two are much the same."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    # Of a tube they lie across it, of a body with square corners along its edges.
    scatter = normals.T @ (normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None])
    principal = _principal_axes(_extreme(triangles.reshape(-1, 3), N_COARSE))
    axes: list[Array] = []
    for axis in (*np.eye(3), *np.linalg.eigh(scatter)[1].T, *principal):
        if all(abs(axis @ other) < SAME for other in axes):
            axes.append(axis)
    return np.array(axes)


def _sphere(n: int) -> Array:
    """Return n directions that lie evenly (Fibonacci's lattice), (n, 3)."""
    k = np.arange(n) + 0.5
    z, turn = 1.0 - 2.0 * k / n, np.pi * (1.0 + np.sqrt(5.0)) * k
    wide = np.sqrt(1.0 - z * z)
    return np.stack([wide * np.cos(turn), wide * np.sin(turn), z], axis=1)


N_COARSE, N_FINE, N_ROUNDS = 100, 600, 30
DIRECTIONS = {n: _sphere(n) for n in (N_COARSE, N_FINE)}
# Of one half of the sphere: an axis has no sign.
COARSE, AROUND = _sphere(32)[:16], _sphere(14)
