# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The reference checker: slow and simple numpy code to validate kernels and planners.

It shares nothing with them: kinematics are products of matrices, contact is clipping the bar
against the slabs of the box, and a motion is checked instant by instant.
"""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arm import ArmModel, bar_ends, Capsule, NO_BARS
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Contact:
    """A bar of the arm in contact with a box at an instant of a motion."""

    index: int
    bar: int
    box: str


def frames(arm: ArmModel, q: Array) -> Array:
    """Return the poses of all link frames and of the tool, q (n, dof) -> (n, dof + 1, 4, 4)."""
    n = len(q)
    T = np.tile(arm.T_base_mount, (n, 1, 1))
    result = np.empty((n, arm.dof + 1, 4, 4))
    for i, (alpha, a, offset, d) in enumerate(arm.dh):
        value = q[:, i] if i < arm.dof else np.zeros(n)
        slides = i < arm.dof and arm.is_prismatic[i]
        theta = np.full(n, offset) if slides else offset + value
        rx = np.eye(4)
        rx[1:3, 1:3] = [[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]]
        rx[0, 3] = a
        rz = np.tile(np.eye(4), (n, 1, 1))
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
    T = frames(arm, q)
    mount = [_capsule_ends(arm, T, c)[:, None] for c in arm.capsules if c.link == 0]
    return np.concatenate([ends[:, wanted], *mount], axis=1)


def bar_distances(one: Array, other: Array) -> Array:
    """
    Return the distances of the lines of two bars, (n, 2, 3) each -> (n,) [m].

    The distance of a point of one line from the other line is convex along the first: its least
    value is found by golden section.
    """
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    a, step = one[:, 0], one[:, 1] - one[:, 0]
    b, along = other[:, 0], other[:, 1] - other[:, 0]
    square = np.maximum((along * along).sum(axis=1), 1e-300)

    def distance(s: Array) -> Array:
        p = a + s[:, None] * step
        t = np.clip(((p - b) * along).sum(axis=1) / square, 0.0, 1.0)
        result: Array = np.linalg.norm(p - b - t[:, None] * along, axis=1)
        return result

    low, high = np.zeros(len(a)), np.ones(len(a))
    for _ in range(60):
        left, right = high - golden * (high - low), low + golden * (high - low)
        is_left = distance(left) <= distance(right)
        low, high = np.where(is_left, low, left), np.where(is_left, right, high)
    return np.minimum(distance(0.5 * (low + high)), np.minimum(distance(low), distance(high)))


def bar_box_contact(ends: Array, center: Array, rotation: Array, half: Array) -> Array:
    """Return which bars, (..., 2, 3), meet a closed box: clipping against its slabs."""
    local = (ends - center) @ rotation
    a, step = local[..., 0, :], local[..., 1, :] - local[..., 0, :]
    with np.errstate(divide='ignore', invalid='ignore'):
        t0, t1 = (-half - a) / step, (half - a) / step
    is_parallel = step == 0.0
    is_between = np.abs(a) <= half
    enter = np.where(is_parallel, np.where(is_between, -np.inf, np.inf), np.minimum(t0, t1))
    leave = np.where(is_parallel, np.where(is_between, np.inf, -np.inf), np.maximum(t0, t1))
    first = np.maximum(enter.max(axis=-1), 0.0)
    last = np.minimum(leave.min(axis=-1), 1.0)
    result: Array = first <= last
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
    found: Contact | None = None
    for box in scene.boxes:
        for k, radius in enumerate(bar_radii(arm)):
            half = 0.5 * box.size + margin + radius
            hit = np.flatnonzero(bar_box_contact(ends[:, k], box.center, box.rotation, half))
            if len(hit) and (found is None or hit[0] < found.index):
                found = Contact(int(hit[0]), k, box.name)
    return found


def bar_radii(arm: ArmModel) -> Array:
    """Return the radius of each of the `bars` [m]."""
    offsets = np.repeat(arm.radii, 2)[1 if arm.is_prismatic[0] else 2 :]
    capsules = [capsule.radius for capsule in arm.capsules if capsule.link > 0]
    radii: Array = np.concatenate([capsules, offsets[offsets != NO_BARS]])
    return radii


def least_clearance(arm: ArmModel, scene: Scene, q: Array, ray_length: float) -> float:
    """
    Return the least distance of the arm from the boxes over the instants q, (n, dof) [m].

    The closest point of each bar is found by golden section: its distance from a box is convex.
    """
    ends = bars(arm, q, ray_length)
    radii = bar_radii(arm)
    least = np.inf
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    for box in scene.boxes:
        local = (ends - box.center) @ box.rotation
        a, step = local[..., 0, :], local[..., 1, :] - local[..., 0, :]
        half = 0.5 * box.size

        def distance(t: Array, a: Array = a, step: Array = step, half: Array = half) -> Array:
            excess = np.maximum(np.abs(a + t[..., None] * step) - half, 0.0)
            result: Array = np.linalg.norm(excess, axis=-1)
            return result

        low, high = np.zeros(a.shape[:-1]), np.ones(a.shape[:-1])
        for _ in range(48):
            left, right = high - golden * (high - low), low + golden * (high - low)
            is_left = distance(left) <= distance(right)
            low, high = np.where(is_left, low, left), np.where(is_left, right, high)
        least = min(least, float((distance(0.5 * (low + high)) - radii).min()))
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


def quintic_states(trajectory: Trajectory, period: float) -> tuple[Array, Array, Array, Array]:
    """
    Return what a quintic-interpolating controller commands, every `period` and at each point.

    Each piece solves the six linear equations of its boundary values. Times (m,) [s], positions,
    velocities, accelerations (m, dof) [rad, rad/s, rad/s^2].
    """
    times, positions = trajectory.times, trajectory.positions
    grid = np.unique(np.concatenate([np.arange(0.0, times[-1], period), times]))
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
