# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The reference checker: slow and simple numpy code to validate kernels and planners.

It shares nothing with them: kinematics are products of matrices, contact is clipping the bar
against the slabs of the box, and a motion is checked instant by instant.
"""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arm import ArmModel
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

    Each DH row gives two, `a` along the x axis before it and `d` along its own z axis; the last
    is the pointing ray. Bars of the mount (before the first joint) are left out.
    """
    T = frames(arm, q)
    result = []
    for i in range(arm.dof + 1):
        origin, z = T[:, i, :3, 3], T[:, i, :3, 2]
        if i == arm.dof:
            corner, end = origin, origin + ray_length * z
        else:
            d = arm.dh[i, 3] + (q[:, i, None] if arm.is_prismatic[i] else 0.0)
            corner, end = origin - d * z, origin
        if i > 0:
            result.append(np.stack([T[:, i - 1, :3, 3], corner], axis=1))
        if i > 0 or arm.is_prismatic[0]:
            result.append(np.stack([corner, end], axis=1))
    return np.stack(result, axis=1)


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
    radii: Array = np.repeat(arm.radii, 2)[1 if arm.is_prismatic[0] else 2 :]
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
