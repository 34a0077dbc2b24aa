# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The reference checker: slow and simple numpy code to validate kernels and planners.

It shares nothing with them: kinematics are products of matrices, contact is clipping the bar
against the slabs of the box, and a motion is checked instant by instant.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arm import ArmModel, bar_ends, bars_of, Capsule, is_called, NO_BARS
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import growth_at, SeenBody, SeparationRules
from rrth_planner.model.trajectory import Trajectory

# Speeds [m/s] and depths [m] no further than this beyond what is allowed are rounding.
ROUNDING = 1e-9
# So small an imaginary part of a joint position that its square is nothing [s].
TINY = 1e-30
# A bar is on a known side of a box where so much is left of the box, from its middle to each face,
# once it is shrunk until the bar is clear of it [m]. Depths are halved to, from so far away [m].
LEFT, FAR, HALVINGS = 1e-3, 1.0, 40
# A part of a bar is looked at in so many places, and once more in so many round the nearest one.
PLACES, ROUNDS = 33, 2
# Bounds are made for so many instants together.
STRETCH = 32
# The corners of a box, in halves of its edges.
_CORNERS = 0.5 * (np.indices((2, 2, 2)).reshape(3, 8).T * 2.0 - 1.0)


@dataclass(frozen=True, slots=True)
class Contact:
    """A bar of the arm in contact with a box at an instant of a motion."""

    index: int
    bar: int
    box: str


def frames(arm: ArmModel, q: Array) -> Array:
    """
    Return the poses of all link frames and of the tool, q (n, dof) -> (n, dof + 1, 4, 4).

    They are analytic in q, which may be complex, and so are the bars: see `bar_velocities`.
    """
    n, kind = len(q), np.result_type(q.dtype, np.float64)
    T = np.tile(arm.T_base_mount, (n, 1, 1))
    result = np.empty((n, arm.dof + 1, 4, 4), dtype=kind)
    for i, (alpha, a, offset, d) in enumerate(arm.dh):
        value = q[:, i] if i < arm.dof else np.zeros(n)
        slides = i < arm.dof and arm.is_prismatic[i]
        theta = np.full(n, offset) if slides else offset + value
        rx = np.eye(4)
        rx[1:3, 1:3] = [[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]]
        rx[0, 3] = a
        rz = np.tile(np.eye(4, dtype=kind), (n, 1, 1))
        rz[:, 0, 0] = rz[:, 1, 1] = np.cos(theta)
        rz[:, 1, 0] = np.sin(theta)
        rz[:, 0, 1] = -np.sin(theta)
        rz[:, 2, 3] = d + (value if slides else 0.0)
        T = T @ rx @ rz
        result[:, i] = T
    return result


def bars(arm: ArmModel, q: Array, ray_length: float) -> Array:
    """
    Return all bars of the moving arm in the base frame, (n, n_bars, 2, 3) [m].

    Its capsules first. Then each DH row gives two, `a` along the x axis before it and `d` along
    its own z axis; the last is the pointing ray. Bars of the mount (before the first joint) are
    left out.
    """
    T = frames(arm, q)
    result = [_capsule_ends(arm, T, c) for c in arm.capsules if c.link > 0]
    for i in range(arm.dof + 1):
        origin, z = T[:, i, :3, 3], T[:, i, :3, 2]
        if i == arm.dof:
            corner, end = origin, origin + ray_length * z
        else:
            d = arm.dh[i, 3] + (q[:, i, None] if arm.is_prismatic[i] else 0.0)
            corner, end = origin - d * z, origin
        if arm.radii[i] == NO_BARS:
            continue
        if i > 0:
            result.append(np.stack([T[:, i - 1, :3, 3], corner], axis=1))
        if i > 0 or arm.is_prismatic[0]:
            result.append(np.stack([corner, end], axis=1))
    return np.stack(result, axis=1)


def _capsule_ends(arm: ArmModel, T: Array, capsule: Capsule) -> Array:
    """Return the line of a capsule in the base frame, T as from `frames`, (n, 2, 3) [m]."""
    if capsule.link == 0:
        pose = np.tile(arm.T_base_mount, (len(T), 1, 1))
    else:
        pose = T[:, capsule.link - 1]
    result: Array = capsule.ends @ pose[:, :3, :3].swapaxes(1, 2) + pose[:, None, :3, 3]
    return result


def bar_ends_at(arm: ArmModel, q: Array, ray_length: float) -> Array:
    """Return the ends of `arm.bars_of` and `arm.mount_bars`, (n, dof) -> (n, n_bars, 2, 3) [m]."""
    ends, n = bars(arm, q, ray_length), sum(capsule.link > 0 for capsule in arm.capsules)
    rows = [
        (i, end)
        for i in range(arm.dof + 1)
        for end in 'ad'
        if arm.radii[i] != NO_BARS and (i > 0 or (end == 'd' and arm.is_prismatic[0]))
    ]
    wanted = [*range(n), *(n + rows.index(offset) for offset in bar_ends(arm))]
    on_mount = [capsule for capsule in arm.capsules if capsule.link == 0]
    if not on_mount:
        return ends[:, wanted]
    T = frames(arm, q)
    mount = [_capsule_ends(arm, T, c)[:, None] for c in on_mount]
    return np.concatenate([ends[:, wanted], *mount], axis=1)


def bar_distances(one: Array, other: Array) -> Array:
    """
    Return the distances of the lines of two bars, (n, 2, 3) each -> (n,) [m].

    The distance of a point of one line from the other one is convex along the first. It is least
    at an end of the first, nearest to an end of the other, or where the common normal of both
    meets it.
    """
    a, step = one[:, 0], one[:, 1] - one[:, 0]
    b, along = other[:, 0], other[:, 1] - other[:, 0]
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    step_square = np.maximum((step * step).sum(axis=1), 1e-300)

    def distance(s: Array) -> Array:
        p = a + s[:, None] * step
        t = np.clip(((p - b) * along).sum(axis=1) / square, 0.0, 1.0)
        result: Array = np.linalg.norm(p - b - t[:, None] * along, axis=1)
        return result

    def nearest(point: Array) -> Array:
        result: Array = np.clip(((point - a) * step).sum(axis=1) / step_square, 0.0, 1.0)
        return result

    # Without its part along the other line a step leads to the common normal.
    across = step - ((step * along).sum(axis=1) / square)[:, None] * along
    across_square = np.maximum((across * across).sum(axis=1), 1e-300)
    normal = np.clip(((b - a) * across).sum(axis=1) / across_square, 0.0, 1.0)
    ends = (np.zeros(len(a)), np.ones(len(a)), nearest(b), nearest(b + along))
    least: Array = np.minimum.reduce([distance(s) for s in (*ends, normal)])
    return least


def bar_box_contact(ends: Array, center: Array, rotation: Array, half: Array) -> NDArray[np.bool_]:
    """Return which bars, (..., 2, 3), meet a closed box: clipping against its slabs."""
    local = ends - center
    # For one box a single product of two matrices, not one for each bar.
    flat = local.reshape(-1, 3) if rotation.ndim == 2 else local
    local = (flat @ rotation).reshape(local.shape)
    a, b, half = np.broadcast_arrays(local[..., 0, :], local[..., 1, :], half)
    result = np.ones(a.shape[:-1], dtype=np.bool_)
    for i in range(3):
        # Not where both ends are beyond the same face.
        result &= (np.minimum(a[..., i], b[..., i]) <= half[..., i]) & (
            np.maximum(a[..., i], b[..., i]) >= -half[..., i]
        )
    if not result.any():
        return result
    a, b, half = a[result], b[result], half[result]
    step = b - a
    with np.errstate(divide='ignore', invalid='ignore'):
        t0, t1 = (-half - a) / step, (half - a) / step
    is_parallel = step == 0.0
    is_between = np.abs(a) <= half
    enter = np.where(is_parallel, np.where(is_between, -np.inf, np.inf), np.minimum(t0, t1))
    leave = np.where(is_parallel, np.where(is_between, np.inf, -np.inf), np.maximum(t0, t1))
    first = np.maximum(enter.max(axis=-1), 0.0)
    last = np.minimum(leave.min(axis=-1), 1.0)
    result[result] = first <= last
    return result


def first_contact(
    arm: ArmModel, scene: Scene, q: Array, ray_length: float, margin: float
) -> Contact | None:
    """
    Return the first contact of the arm with the boxes grown by `margin` [m], or None.

    q (n, dof): the instants of a motion [rad]; ray_length: how much of the pointing ray counts as
    arm [m]. Each box grows on every side; the bars' own radii come on top.
    """
    ends = bars(arm, q, ray_length)
    begins = np.arange(0, len(q), STRETCH)
    lows = np.minimum.reduceat(np.minimum(ends[:, :, 0], ends[:, :, 1]), begins)
    highs = np.maximum.reduceat(np.maximum(ends[:, :, 0], ends[:, :, 1]), begins)
    found: Contact | None = None
    for box in scene.boxes:
        halves = 0.5 * box.size + margin + bar_radii(arm)[:, None]
        # Not where all of a stretch is to one side of the whole box.
        reach = np.abs(halves) @ np.abs(box.rotation).T + ROUNDING
        overlaps = (lows <= box.center + reach) & (highs >= box.center - reach)
        is_near = np.logical_and.reduce(overlaps, axis=2)
        for k in np.flatnonzero(is_near.any(axis=0)):
            rows = np.flatnonzero(np.repeat(is_near[:, k], STRETCH)[: len(q)])
            hit = rows[bar_box_contact(ends[rows, k], box.center, box.rotation, halves[k])]
            if len(hit) and (found is None or hit[0] < found.index):
                found = Contact(int(hit[0]), int(k), box.name)
    return found


def bar_radii(arm: ArmModel) -> Array:
    """Return the radius of each of the `bars` [m]."""
    offsets = np.repeat(arm.radii, 2)[1 if arm.is_prismatic[0] else 2 :]
    capsules = [capsule.radius for capsule in arm.capsules if capsule.link > 0]
    radii: Array = np.concatenate([capsules, offsets[offsets != NO_BARS]])
    return radii


def penetration_depths(
    arm: ArmModel, scene: Scene, q: Array, ray_length: float, margin: float
) -> Array:
    """
    Return by how much each grown box would have to shrink on every side for each bar to be clear.

    (n_bars, m) [m], bars as `arm.bars_of`, at q, shape (dof,); < 0: apart, by no more than `FAR`.
    Infinite where the bar reaches the middle of the box: it is in it until nothing of it is left.
    """
    parts = bars_of(arm)
    ends = bar_ends_at(arm, q[None], ray_length)[0, : len(parts), None]
    radii = np.array([bar.radius for bar in parts])[:, None, None]
    centers, rotations, halves = (
        np.array([getattr(box, name) for box in scene.boxes])
        for name in ('center', 'rotation', 'size')
    )
    halves = 0.5 * halves + margin

    def is_met(by: Array) -> NDArray[np.bool_]:
        half = halves - by[..., None]
        is_left = (half > 0.0).all(axis=-1)
        return is_left & bar_box_contact(ends, centers[:, None], rotations, half + radii)

    shape = (len(ends), len(scene.boxes))
    low = np.full(shape, -FAR)
    high = np.broadcast_to(halves.min(axis=1), shape)
    is_apart, is_across = ~is_met(low), is_met(high - ROUNDING)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        is_hit = is_met(middle)
        low, high = np.where(is_hit, middle, low), np.where(is_hit, high, middle)
    return np.where(is_apart, -FAR, np.where(is_across, np.inf, high))


def may_escape(scene: Scene, depths: Array, margin: float) -> NDArray[np.bool_]:
    """Return whether bars that deep in the grown boxes, (..., m) [m], may escape from each."""
    halves = np.array([0.5 * box.size.min() + margin for box in scene.boxes])
    found: NDArray[np.bool_] = (depths <= 0.0) | (halves - depths > LEFT)
    return found


def least_clearance(arm: ArmModel, scene: Scene, q: Array, ray_length: float) -> float:
    """Return the least distance of the arm from the boxes over the instants q, (n, dof) [m]."""
    return float(clearances(arm, scene, q, ray_length).min())


def clearances(arm: ArmModel, scene: Scene, q: Array, ray_length: float) -> Array:
    """
    Return the distance of the arm from the boxes at each of the instants q, (n, dof) -> (n,) [m].

    The square of the distance of a point of a bar from a box is convex along the bar, and between
    two crossings of planes of the box its derivative is linear: that is 0 at the closest point.
    """
    ends = bars(arm, q, ray_length)
    radii = bar_radii(arm)
    middles, lengths = ends.mean(axis=2), np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=-1)
    least, of_middles = np.full(len(q), np.inf), []
    for box in scene.boxes:
        place = (middles - box.center) @ box.rotation
        gaps = np.linalg.norm(place - np.clip(place, -0.5 * box.size, 0.5 * box.size), axis=-1)
        of_middles.append(gaps - radii)
        least = np.minimum(least, of_middles[-1].min(axis=1))
    for box, bounds in zip(scene.boxes, of_middles, strict=True):
        # No point of a bar is further from its middle than half its length.
        rows, some = np.nonzero(bounds - 0.5 * lengths <= least[:, None] + ROUNDING)
        local = (ends[rows, some] - box.center) @ box.rotation
        a, step = local[..., 0, :], local[..., 1, :] - local[..., 0, :]
        half = 0.5 * box.size

        def excess(t: Array, a: Array = a, step: Array = step, half: Array = half) -> Array:
            place = a[..., None, :] + t[..., None] * step[..., None, :]
            result: Array = place - np.clip(place, -half, half)
            return result

        with np.errstate(divide='ignore', invalid='ignore'):
            crossings = np.concatenate([(-half - a) / step, (half - a) / step], axis=-1)
        ends_of_bar = np.broadcast_to([0.0, 1.0], (*a.shape[:-1], 2))
        t = np.concatenate([np.clip(np.nan_to_num(crossings), 0.0, 1.0), ends_of_bar], axis=-1)
        t.sort(axis=-1)
        slope = (excess(t) * step[..., None, :]).sum(axis=-1)
        # The first where it rises, and the one before it.
        after = np.minimum((slope < 0.0).sum(axis=-1), t.shape[-1] - 1)[..., None]
        before = np.maximum(after - 1, 0)
        t0, t1, s0, s1 = (
            np.take_along_axis(values, at, axis=-1)
            for values in (t, slope)
            for at in (before, after)
        )
        share = np.clip(-s0 / np.where(s1 > s0, s1 - s0, 1.0), 0.0, 1.0)
        nearest = np.concatenate([t0 + share * (t1 - t0), ends_of_bar], axis=-1)
        gaps = np.linalg.norm(excess(nearest), axis=-1).min(axis=-1)
        np.minimum.at(least, rows, gaps - radii[some])
    return least


# Position, first and second derivative of a quintic at 0 and at 1, from its coefficients.
_HERMITE = np.array(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 2, 0, 0, 0],
        [1, 1, 1, 1, 1, 1],
        [0, 1, 2, 3, 4, 5],
        [0, 0, 2, 6, 12, 20],
    ]
)


def instants(trajectory: Trajectory, period: float) -> Array:
    """Return the times every `period`, and those of the points of a trajectory, (m,) [s]."""
    times = trajectory.times
    grid: Array = np.unique(np.concatenate([np.arange(0.0, times[-1], period), times]))
    return grid


def quintic_states(trajectory: Trajectory, period: float) -> tuple[Array, Array, Array, Array]:
    """
    Return what a quintic-interpolating controller commands, every `period` and at each point.

    Each piece solves the six linear equations of its boundary values. Times (m,) [s], positions,
    velocities, accelerations (m, dof) [rad, rad/s, rad/s^2].
    """
    times, positions = trajectory.times, trajectory.positions
    grid = instants(trajectory, period)
    if len(times) == 1:
        still = np.zeros_like(positions)
        return grid, positions, still, still
    q, v, a = (np.empty((len(grid), positions.shape[1])) for _ in range(3))
    for i in range(len(times) - 1):
        # In units of the piece's own length the equations are well conditioned.
        T = times[i + 1] - times[i]
        ends = [
            (positions[k], T * trajectory.velocities[k], T * T * trajectory.accelerations[k])
            for k in (i, i + 1)
        ]
        values = np.concatenate(ends)
        c = np.linalg.solve(_HERMITE, values)
        inside = (grid >= times[i]) & (grid <= times[i + 1])
        s = ((grid[inside] - times[i]) / T)[:, None]
        q[inside] = sum(c[k] * s**k for k in range(6))
        v[inside] = sum(k * c[k] * s ** (k - 1) for k in range(1, 6)) / T
        a[inside] = sum(k * (k - 1) * c[k] * s ** (k - 2) for k in range(2, 6)) / T**2
    return grid, q, v, a


@dataclass(frozen=True, slots=True)
class SeparationViolation:
    """
    A part of the arm that is faster than the contact speed, in a grown box of the wearer.

    When [s], the index of the bar in `arm.bars_of`, which box, and how much further away the bar
    would have to be [m].
    """

    time: float
    bar: int
    box: str
    depth: float


def separation_violations(
    arm: ArmModel,
    body: SeenBody,
    trajectory: Trajectory,
    rules: SeparationRules,
    margin: float,
    *,
    period: float = 1e-3,
) -> list[SeparationViolation]:
    """
    Return where a motion that begins at the instant of the body breaks the separation from it.

    At each of the `instants` that are `period` [s] apart: every bar and every box, in the order of
    time; empty: none. The pointing ray has no body and does not count; pairs of `arm.allowed` do
    not either. margin: what has to be left between the two beyond all that is assumed [m].
    """
    times, q, v, _ = quintic_states(trajectory, period)
    growths = np.array([growth_at(body, rules, margin, time) for time in times])
    distances = fast_distances(arm, body.scene, q, v, rules.contact_speed, growths)
    depths = growths[:, None, :] - distances
    return [
        SeparationViolation(
            float(times[i]), int(bar), body.scene.boxes[k].name, float(depths[i, bar, k])
        )
        for i, bar, k in np.argwhere(depths > ROUNDING)
    ]


def protrusions(before: Array, after: Array) -> Array:
    """
    Return how far boxes get out of earlier ones, (..., 15) each -> (...) [m].

    By how much the earlier one has to grow to contain the later one: the greatest distance of the
    corners of this, since the distance from a box is convex.
    """
    later = after[..., ROTATION:].reshape(*after.shape[:-1], 3, 3)
    edges = _CORNERS * after[..., None, SIZE:ROTATION]
    corners = after[..., None, :SIZE] + np.einsum('...ij,...kj->...ki', later, edges)
    earlier = before[..., ROTATION:].reshape(*before.shape[:-1], 3, 3)
    local = np.einsum('...ji,...kj->...ki', earlier, corners - before[..., None, :SIZE])
    beyond = np.maximum(np.abs(local) - 0.5 * before[..., None, SIZE:ROTATION], 0.0)
    found: Array = np.sqrt((beyond * beyond).sum(axis=-1)).max(axis=-1)
    return found


def fast_distances(
    arm: ArmModel, scene: Scene, q: Array, v: Array, contact_speed: float, within: Array
) -> Array:
    """
    Return how far the fast part of each bar is from each box, (n, n_bars - 1, m) [m].

    q, v (n, dof): states of the arm [rad, rad/s]; contact_speed: no slower place of a bar counts
    [m/s]; within (n, m): how near a box matters [m]. Bars as in `arm.bars_of`, without the
    pointing ray. Infinite where no place is fast, where the box is further away than matters, and
    for the pairs of `arm.allowed`. A bar whose axis is in the box is its own radius deep.

    The flesh round a place of the axis is as fast as the place and its radius times the sum of the
    speeds of all joints that turn the bar.
    """
    bars = bars_of(arm)[:-1]
    ends, velocities = bar_ends_at(arm, q, 0.0), bar_velocities(arm, q, v)
    result = np.full((len(q), len(bars), len(scene.boxes)), np.inf)
    for b, bar in enumerate(bars):
        turns = np.abs(v[:, : bar.body]) @ ~np.array(arm.is_prismatic[: bar.body])
        slow = contact_speed + ROUNDING - bar.radius * turns
        parts = fast_parts(velocities[:, b], slow)
        middle = ends[:, b].mean(axis=1)
        half = np.linalg.norm(ends[:, b, 1] - middle, axis=1)
        for k, box in enumerate(scene.boxes):
            if any(part == bar.name and is_called(box.name, name) for part, name in arm.allowed):
                continue
            near = _distances(middle[:, None], box)[:, 0] - half - bar.radius <= within[:, k]
            if not near.any():
                continue
            for part in (0, 1):
                rows = near & (parts[:, part, 0] <= parts[:, part, 1])
                least = _least_distances(ends[rows, b], parts[rows, part], box) - bar.radius
                result[rows, b, k] = np.minimum(result[rows, b, k], least)
    return result


def bar_velocities(arm: ArmModel, q: Array, v: Array) -> Array:
    """
    Return the velocities of both ends of the bars as in `bar_ends_at`, (n, n_bars, 2, 3) [m/s].

    q, v (n, dof): states of the arm. The ends are analytic functions of the positions: the
    imaginary part of their values at q + i h v is h times their derivative along v, to rounding.
    """
    moved: Any = q + 1j * TINY * v
    result: Array = bar_ends_at(arm, moved, 0.0).imag / TINY
    return result


def fast_parts(velocities: Array, slow: Array) -> Array:
    """
    Return the two parts of a bar, from its start and to its end, that are faster than a speed.

    velocities (n, 2, 3) of its ends, slow (n,) [m/s]; < 0: all of it is. Each part from 0, the
    start of the bar, to 1, its end; empty ones end before they begin. (n, 2, 2).
    """
    a, step = velocities[:, 0], velocities[:, 1] - velocities[:, 0]
    square = (step * step).sum(axis=1)
    is_even = square == 0.0
    square = np.where(is_even, 1.0, square)
    # The square of the speed at s is that of the least one, on the line through the bar, and
    # square (s - slowest)^2.
    slowest = -(a * step).sum(axis=1) / square
    least = np.linalg.norm(a + slowest[:, None] * step, axis=1)
    reach = np.sqrt(np.maximum(slow * slow - least * least, 0.0) / square)
    reach[is_even] = np.inf
    first, last = slowest - reach, slowest + reach
    parts = np.empty((len(a), 2, 2))
    parts[:, 0, 0], parts[:, 0, 1] = 0.0, np.minimum(first, 1.0)
    parts[:, 1, 0], parts[:, 1, 1] = np.maximum(last, 0.0), 1.0
    parts[slow < least] = [[0.0, 1.0], [1.0, 0.0]]
    return parts


def _least_distances(ends: Array, part: Array, box: Box) -> Array:
    """
    Return the least distance of the places of a part of a bar from a box, (n,) [m].

    ends (n, 2, 3) [m]; part (n, 2): from where to where, 0 to 1. The distance is convex along the
    bar: the nearest place is beside the nearest of those that are looked at.
    """
    rows, u = np.arange(len(ends)), np.linspace(0.0, 1.0, PLACES)
    begin, end = part[:, 0], part[:, 1]
    least = np.full(len(ends), np.inf)
    for _ in range(ROUNDS):
        s = begin[:, None] + (end - begin)[:, None] * u
        points = ends[:, None, 0] + s[..., None] * (ends[:, None, 1] - ends[:, None, 0])
        distances = _distances(points, box)
        best = distances.argmin(axis=1)
        least = np.minimum(least, distances[rows, best])
        begin, end = s[rows, np.maximum(best - 1, 0)], s[rows, np.minimum(best + 1, PLACES - 1)]
    return least


def _distances(points: Array, box: Box) -> Array:
    """Return the distances of points from a box, 0 inside, (n, m, 3) -> (n, m) [m]."""
    local = (points - box.center) @ box.rotation
    result: Array = np.linalg.norm(np.maximum(np.abs(local) - 0.5 * box.size, 0.0), axis=-1)
    return result
