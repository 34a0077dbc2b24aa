# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The independent check of the separation from a wearer who moves, by python-fcl or coal."""

import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.distance_library import library_of, THINNEST
from rrth_planner.collision.second_checker import TOLERANCE
from rrth_planner.collision.violation import Violation
from rrth_planner.model.arm import ArmModel, Bar, bars_of, Capsule, forward_kinematics, is_called
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import turned_to
from rrth_planner.model.scene import Box
from rrth_planner.model.separation import growth_at, SeenBody, SeparationRules
from rrth_planner.model.trajectory import sample, Trajectory

# Spacing of the instants that are sampled: between two of them a hand at 2 m/s and a tip as fast
# come 2 cm closer [s].
SAMPLING_PERIOD = 0.005
# Speeds no further than this above the contact speed are rounding [m/s].
ROUNDING = 1e-9
# How often the part of a bar is halved in which its speed crosses a value: to 1e-9 of its length.
HALVINGS = 30


def first_separation_violation(
    arm: ArmModel,
    body: SeenBody,
    trajectory: Trajectory,
    rules: SeparationRules,
    margin: float,
    library: str = 'fcl',
) -> Violation | None:
    """
    Return where a motion that begins at the instant of the body first breaks the separation.

    Every `SAMPLING_PERIOD` and at the end: the parts of each bar that are faster than the contact
    speed, as capsules, from each box grown by all that is assumed of it and by margin [m]. The
    deepest violation of the first such instant, with its distance from the box as it was seen; or
    None.
    The pointing ray has no body and does not count; pairs of `arm.allowed` do not either. library:
    name of one of `distance_library.LIBRARIES`.
    """
    bars, boxes = bars_of(arm)[:-1], body.scene.boxes
    times = np.append(np.arange(0.0, trajectory.duration, SAMPLING_PERIOD), trajectory.duration)
    q, v, _ = sample(trajectory, times)
    if not bars or not boxes or not v.any():
        return None
    ends, velocities, turns = _motion(arm, q, v)
    radii = np.array([bar.radius for bar in bars])
    parts = _fast_parts(velocities, rules.contact_speed + ROUNDING - radii * turns)
    steps = ends[..., 1, :] - ends[..., 0, :]
    # (n, n_bars, 2 parts, 2 ends, 3)
    points = ends[:, :, None, :1] + parts[..., None] * steps[:, :, None, None]
    growths = np.array([growth_at(body, rules, margin, time) for time in times])
    limits = growths[:, None] + radii[:, None]
    # (n, n_bars, 2 parts, m)
    is_open = np.stack([_least(points, box) for box in boxes], axis=-1) < limits[:, :, None]
    is_open &= (parts[..., 0] <= parts[..., 1])[..., None] & ~_allowed(arm, boxes)[:, None]
    if not is_open.any():
        return None
    found, least, last = None, -TOLERANCE, len(times)
    distances = library_of(library)
    query, request, result = distances.query, distances.request, distances.result
    capsule, shapes = distances.capsule(0.0), [distances.placed_box(box) for box in boxes]
    # In the order of time.
    for i, b, part in np.argwhere(is_open.any(axis=-1)).tolist():
        if i > last:
            break
        begin, end = points[i, b, part]
        length = math.dist(begin, end)
        distances.stretch(capsule, length)
        capsule.item.setRotation(turned_to((end - begin) / length) if length > 0.0 else np.eye(3))
        capsule.item.setTranslation(0.5 * (begin + end))
        for k in np.flatnonzero(is_open[i, b, part]).tolist():
            # How deep a contact is the libraries do not say.
            distance = max(0.0, query(capsule.item, shapes[k].item, request, result))
            distance += THINNEST - radii[b]
            if distance - growths[i, k] < least:
                least, last = distance - growths[i, k], i
                found = Violation(float(times[i]), float(distance), bars[b].name, boxes[k].name)
    distances.release([capsule], are_boxes=False)
    distances.release(shapes, are_boxes=True)
    return found


def _motion(arm: ArmModel, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """
    Return both ends of the bars, their velocities, and how fast each bar turns at most.

    q, v (n, dof); ends [m] and velocities [m/s] (n, n_bars, 2, 3), turns (n, n_bars) [rad/s]: the
    sum of the speeds of the joints that turn it. Without the pointing ray.
    """
    bars, slides = bars_of(arm)[:-1], np.array(arm.is_prismatic)
    poses = forward_kinematics(arm, q)
    axes, origins = poses[:, :-1, :3, 2], poses[:, :-1, :3, 3]
    ends, velocities = np.empty((2, len(q), len(bars), 2, 3))
    for b, bar in enumerate(bars):
        for e, (point, n_joints) in enumerate(_ends(arm, bar, q, poses)):
            arms = point[:, None] - origins[:, :n_joints]
            per_joint = np.where(
                slides[:n_joints, None], axes[:, :n_joints], np.cross(axes[:, :n_joints], arms)
            )
            ends[:, b, e] = point
            velocities[:, b, e] = (v[:, :n_joints, None] * per_joint).sum(axis=1)
    is_turned = np.array([(np.arange(arm.dof) < bar.body) & ~slides for bar in bars])
    return ends, velocities, np.abs(v) @ is_turned.T


def _ends(arm: ArmModel, bar: Bar, q: Array, poses: Array) -> list[tuple[Array, int]]:
    """Return each end of a bar, (n, 3) [m], and how many joints move it."""
    if isinstance(bar.source, Capsule):
        pose = poses[:, bar.source.link - 1]
        points = bar.source.ends @ pose[:, :3, :3].swapaxes(1, 2) + pose[:, None, :3, 3]
        return [(points[:, 0], bar.body), (points[:, 1], bar.body)]
    row, kind = bar.source
    if kind == 'a':
        # Along x of the frame before.
        start = poses[:, row - 1, :3, 3]
        return [(start, row), (start + arm.dh[row, 1] * poses[:, row - 1, :3, 0], row)]
    # Along z of its own frame, to its origin; the start of one that slides stays with the link
    # before.
    end, slides = poses[:, row, :3, 3], arm.is_prismatic[row]
    d = arm.dh[row, 3] + (q[:, row, None] if slides else 0.0)
    return [(end - d * poses[:, row, :3, 2], row if slides else bar.body), (end, bar.body)]


def _fast_parts(velocities: Array, slow: Array) -> Array:
    """
    Return the parts of bars, from the start and to the end of each, that are faster than a speed.

    velocities (..., 2, 3) of the ends, slow (...) [m/s]. The speed is convex along a bar: it
    crosses a value once on either side of the slowest place. Parts from 0, the start of the bar,
    to 1, its end; empty ones end before they begin. (..., 2, 2).
    """
    a, step = velocities[..., 0, :], velocities[..., 1, :] - velocities[..., 0, :]
    square = (step * step).sum(axis=-1)
    slowest = np.clip(-(a * step).sum(axis=-1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)

    def is_fast(s: Array) -> NDArray[np.bool_]:
        # Of each bar two places.
        place = a[..., None, :] + s[..., None] * step[..., None, :]
        fast: NDArray[np.bool_] = np.einsum('...i,...i', place, place) > top[..., None]
        return fast

    top = np.where(slow < 0.0, -1.0, slow * slow)
    # Between the ends of the bar and its slowest place.
    outer = np.zeros((*slow.shape, 2))
    outer[..., 1] = 1.0
    inner = np.repeat(slowest[..., None], 2, axis=-1)
    is_whole = is_fast(inner)
    is_empty = ~is_fast(outer)
    fast, other = outer.copy(), inner
    for _ in range(HALVINGS):
        middle = 0.5 * (fast + other)
        is_there = is_fast(middle)
        fast, other = np.where(is_there, middle, fast), np.where(is_there, other, middle)
    # Where it is cut, a part reaches into the slow one by rounding.
    parts = np.stack([outer, other], axis=-1)
    parts[is_whole[..., 0], 0] = 0.0, 1.0
    parts[..., 1, :] = parts[..., 1, ::-1]
    parts[is_empty | (is_whole & [False, True])] = 1.0, 0.0
    return parts


def _least(points: Array, box: Box) -> Array:
    """
    Return lower bounds of the distances of lines from a box, (..., 2, 3) -> (...) [m].

    They are the distances of the boxes round them along the axes of the box.
    """
    local = (points - box.center) @ box.rotation
    half = 0.5 * box.size
    begin, end = local[..., 0, :], local[..., 1, :]
    apart = np.maximum(np.minimum(begin, end), -np.maximum(begin, end)) - half
    apart = np.maximum(apart, 0.0)
    result: Array = np.sqrt(np.einsum('...i,...i', apart, apart))
    return result


def _allowed(arm: ArmModel, boxes: tuple[Box, ...]) -> NDArray[np.bool_]:
    """Return which bars may meet which boxes, (n_bars, m), without the pointing ray."""
    return np.array(
        [
            [
                any(part == bar.name and is_called(box.name, name) for part, name in arm.allowed)
                for box in boxes
            ]
            for bar in bars_of(arm)[:-1]
        ]
    )
