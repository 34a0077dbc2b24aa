# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Few slim capsules around the surface of a link, and the proof that they enclose it.

A capsule is convex: one that contains the three corners of a triangle contains the triangle.
Where one capsule is too thick, the surface is cut into slabs, triangles at the cuts included, and
each slab gets its own.
"""

from collections.abc import Iterator, Sequence
from itertools import islice, pairwise
import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arm import Capsule
from rrth_planner.model.arrays import Array

# Radii are rounded up to this, after as much again for rounding [m].
STEP = 1e-6
# Slabs overlap by twice this: without, what lies on a cut would be in no capsule but for rounding
# [m].
OVERLAP = 2e-4
# A triangle this small that lies in no capsule as a whole is not enclosed [m].
SMALLEST = 1e-5
# Slabs that cost so many times what has been found already are not looked at more closely.
HOPELESS = 1.2
# Between so many planes along each axis slabs begin and end.
N_PLANES = 11
# Axes of a greater cosine are one.
SAME_AXIS_COSINE = 0.995
# How far chosen planes are moved, in turn, in spacings of the planes.
SHIFTS = np.array([0.5, 0.25, 0.125])
# Radii that are tried, as multiples of the least one: a thicker capsule may be shorter.
THICKER = np.array([1.0, 1.005, 1.02, 1.04, 1.07, 1.1, 1.15, 1.2, 1.3, 1.45])
# Angles by which the direction of a capsule is varied, in turn [rad].
TILTS = 0.4 * 0.6 ** np.arange(12)


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


class Fit(NamedTuple):
    """
    How closely capsules are to follow a surface.

    Parameters
    ----------
    slack : float
        As long as a capsule reaches farther than this beyond what it encloses, more are tried [m].
    most : int
        Greatest number of capsules, >= 1.
    worth : float
        A further capsule has to save this share of the cost [-].
    power : float
        What a capsule costs is its volume times this power of its radius [-]: the greater it is,
        the longer and thinner are the capsules.

    """

    slack: float
    most: int
    worth: float = 0.1
    power: float = 0.0


# What has a line, (2, 3), and a radius [m].
Rounded: TypeAlias = Enclosure | Capsule


def enclosing_capsules(triangles: Array, fit: Fit) -> list[Enclosure]:
    """
    Return as few capsules as keep a surface slim.

    Parameters
    ----------
    triangles : ndarray, shape (n, 3, 3)
        The corners of the triangles of the surface [m].
    fit : Fit
        How slim that is.

    Returns
    -------
    list of Enclosure
        Each triangle lies in one of them, or in pieces in several.

    """
    whole = triangles.reshape(-1, 3)
    shape = _capsule_around(whole, fit.power)
    found, cost = [shape], cost_of(shape, fit.power)
    if fit.most < 2 or shape.slack <= fit.slack:
        return found
    slabs = [_Slabs(triangles, axis, fit.power) for axis in _axes_to_cut(triangles)]
    for n in range(2, fit.most + 1):
        least, k = min((candidate.best(n)[0], k) for k, candidate in enumerate(slabs))
        worth = (1.0 + fit.worth) ** (n - 1)
        if least * worth > HOPELESS * cost:
            continue
        parts = slabs[k].parts(slabs[k].refined(slabs[k].best(n)[1]))
        shapes = [_capsule_around(part, fit.power) for part in parts]
        price = sum(cost_of(one, fit.power) for one in shapes) * worth
        if price < cost:
            found, cost = shapes, price
        if max(shape.slack for shape in shapes) <= fit.slack:
            break
    return found


def cost_of(shape: Rounded, power: float = 0.0) -> float:
    """Return what a capsule costs, as in `Fit` [m^(3 + power)]; power 0: its volume [m^3]."""
    length = float(np.linalg.norm(shape.ends[1] - shape.ends[0]))
    return float(_costs(np.array(shape.radius), np.array(length), power))


def _costs(radii: Array, lengths: Array, power: float) -> Array:
    """Return what capsules cost whose lines are so long [m]."""
    result: Array = np.pi * radii ** (2.0 + power) * (lengths + 4.0 / 3.0 * radii)
    return result


def enclosed_in(points: Array, shape: Rounded) -> NDArray[np.bool_]:
    """Return which points, (..., 3) [m], lie in a capsule, (...)."""
    result: NDArray[np.bool_] = line_distances(points, shape.ends) <= shape.radius
    return result


def line_distances(points: Array, ends: Array) -> Array:
    """Return the distances of points, (..., 3), from a line, (2, 3), (...) [m]."""
    begin, step = ends[0], ends[1] - ends[0]
    share = np.clip((points - begin) @ step / max(float(step @ step), 1e-300), 0.0, 1.0)
    result: Array = np.linalg.norm(points - begin - share[..., None] * step, axis=-1)
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

    def __init__(self, triangles: Array, axis: Array, power: float) -> None:
        self._triangles, self._axis, self._power = triangles, axis, power
        heights = triangles @ axis
        self._planes = np.linspace(heights.min(), heights.max(), N_PLANES)
        thin = [_extreme(part, N_COARSE) for part in self.parts(self._planes)]
        self._costs = np.full((N_PLANES, N_PLANES), np.inf)
        rows, columns = np.triu_indices(N_PLANES, 1)
        slabs = [np.concatenate(thin[low:high]) for low, high in zip(rows, columns, strict=True)]
        self._costs[rows, columns] = _least_costs(slabs, power)

    def parts(self, planes: Array) -> Iterator[Array]:
        """Yield the corners of what lies between each two planes, (n, 3) [m]."""
        left = self._triangles
        for low, high in pairwise(planes):
            # Nothing of what lies below the first plane or above the last one, but for rounding.
            rest = left if low == planes[0] else half_of(left, -self._axis, OVERLAP - low)
            part = rest if high == planes[-1] else half_of(rest, self._axis, high + OVERLAP)
            yield part.reshape(-1, 3)
            left = half_of(left, -self._axis, OVERLAP - high)

    def best(self, n: int) -> tuple[float, list[int]]:
        """Return the least cost of capsules round n slabs, and the planes between."""
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
                beside = [
                    part for moved in tried for part in islice(self.parts(moved), k - 1, k + 1)
                ]
                costs = _least_costs(beside, self._power).reshape(3, 2).sum(axis=1)
                planes = tried[int(np.argmin(costs))]
        return planes


def _least_costs(parts: list[Array], power: float) -> Array:
    """Return about what capsules round points cost, each (n, 3) [m]; inf: no points."""
    result: Array = np.full(len(parts), np.inf)
    chosen = [k for k, points in enumerate(parts) if len(points)]
    if not chosen:
        return result
    few = [_extreme(parts[k], N_COARSE) for k in chosen]
    directions = np.stack([np.concatenate([_principal_axes(points), COARSE]) for points in few])
    # All at once: the first point again and again changes nothing.
    most = max(map(len, few))
    filled = np.stack(
        [points[np.where(np.arange(most) < len(points), np.arange(most), 0)] for points in few]
    )
    *_, radii, ends = _capsules_along(filled, directions, power)
    result[chosen] = _costs(radii, ends[..., 1] - ends[..., 0], power).min(axis=1)
    return result


def _capsule_around(points: Array, power: float) -> Enclosure:
    """Return a capsule of little cost that contains points, (n, 3) [m]."""
    points = np.unique(points, axis=0)
    few = _extreme(points, N_FINE)
    directions = np.concatenate([np.eye(3), _principal_axes(few), COARSE])
    centres, axes, radii, ends = _capsules_round(few, directions, power)
    for tilt in TILTS:
        k = int(_costs(radii, ends[:, 1] - ends[:, 0], power).argmin())
        beside = axes[k] + tilt * AROUND
        tried = beside / np.linalg.norm(beside, axis=1)[:, None]
        tried = np.concatenate([axes[k : k + 1], tried])
        centres, axes, radii, ends = _capsules_round(few, tried, power)
    k = int(_costs(radii, ends[:, 1] - ends[:, 0], power).argmin())
    line = centres[k] + ends[k][:, None] * axes[k]
    # Few of the points were looked at: what they miss, the radius makes up for.
    farthest = line_distances(points, line).max()
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


def _capsules_round(points: Array, axes: Array, power: float) -> tuple[Array, ...]:
    """Return `_capsules_along` of one set of points, (n, 3), along axes, (m, 3)."""
    return tuple(values[0] for values in _capsules_along(points[None], axes[None], power))


def _capsules_along(points: Array, axes: Array, power: float) -> tuple[Array, Array, Array, Array]:
    """
    Return the capsule of least cost along each of m axes that contains points, for k sets.

    Parameters
    ----------
    points : ndarray, shape (k, n, 3)
        [m].
    axes : ndarray, shape (k, m, 3)
    power : float
        Of the cost, as in `Fit`.

    Returns
    -------
    centres, axes : ndarray, shape (k, m, 3)
        A point of the line [m] and its direction.
    radii : ndarray, shape (k, m)
        [m].
    ends : ndarray, shape (k, m, 2)
        From the centre along the axis [m].

    """
    middle = 0.5 * (points.min(axis=-2) + points.max(axis=-2))[..., None, :]
    local = points - middle
    across_axes, twice = local.swapaxes(-1, -2), 2.0 * local.swapaxes(-1, -2)
    along = axes @ across_axes
    square = (local * local).sum(axis=-1)[..., None, :] - along * along
    centre = np.zeros(axes.shape)
    # Centre of the least circle around the projections (Badoiu and Clarkson 2003).
    which, row = np.ogrid[: len(axes), : axes.shape[1]]
    best, least, here = centre, np.full(axes.shape[:2], np.inf), np.empty(square.shape)
    for i in range(N_ROUNDS):
        _squares_from(centre, twice, square, here)
        far = here.argmax(axis=-1)
        farthest = here[which, row, far]
        is_less = farthest < least
        least = np.where(is_less, farthest, least)
        best = np.where(is_less[..., None], centre, best)
        across = local[which, far] - along[which, row, far, None] * axes
        centre = centre + (across - centre) / (i + 2.0)
    _squares_from(best, twice, square, here)
    square = np.maximum(here, 0.0)
    radii = THICKER * np.sqrt(square.max(axis=-1))[..., None]
    low, high = np.empty(radii.shape), np.empty(radii.shape)
    for k in range(len(THICKER)):
        # A cap contains a point so far beyond its end.
        beyond = np.sqrt(np.maximum(radii[..., k, None] ** 2 - square, 0.0))
        low[..., k], high[..., k] = (along + beyond).min(axis=-1), (along - beyond).max(axis=-1)
    low, high = np.minimum(low, 0.5 * (low + high)), np.maximum(high, 0.5 * (low + high))
    k = _costs(radii, high - low, power).argmin(axis=-1)
    ends = np.stack([low[which, row, k], high[which, row, k]], axis=-1)
    return middle + best, axes, radii[which, row, k], ends


def _squares_from(centre: Array, twice: Array, square: Array, here: Array) -> None:
    """Fill in the squares of the distances of points from centres, (..., m, n) [m^2]."""
    np.matmul(centre, twice, out=here)
    np.subtract(square, here, out=here)
    here += (centre * centre).sum(axis=-1)[..., None]


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
        if all(abs(axis @ other) < SAME_AXIS_COSINE for other in axes):
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
