# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Modified Denavit-Hartenberg rows of any serial chain, from the lines of its axes."""

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import ModelError

# Directions this near to parallel are made parallel: the common normal of axes that only rounding
# tilts would be kilometres away [rad].
PARALLEL = 5e-5
# Lines this near to each other meet [m].
MEETING = 1e-9


def rows_of_axes(points: Array, directions: Array, x_0: Array) -> tuple[Array, Array, float]:
    """
    Return the rows of a chain at rest, in Craig's convention.

    Parameters
    ----------
    points : ndarray, shape (n_axes + 1, 3)
        A point of each axis, from the mount outwards, and where the pointing ray begins [m].
    directions : ndarray, shape (n_axes + 1, 3)
        Unit vectors along the axes and along the ray.
    x_0 : ndarray, shape (3,)
        Where the x axis of frame 0 shall point, as far as the first axis lets it.

    Returns
    -------
    T_0 : ndarray, shape (4, 4)
        Pose of frame 0 in the frame of the lines: at the first axis's point, its z along that
        axis [m].
    dh : ndarray, shape (n_axes + 1, 4)
        As in `ArmModel`, the tool's row last.
    ray_lead : float
        How far the origin of the tool's row lies before the given point of the ray, on the ray
        [m]. A row without `d` can end only where the ray is nearest to the last axis.

    Raises
    ------
    ModelError
        Numbers that are not finite.

    """
    p = np.array(frozen_array(points, (None, 3), 'points of the axes', 'm', ModelError))
    z = np.array(frozen_array(directions, (len(p), 3), 'directions', '-', ModelError))
    x = _across(x_0, z[0])
    T_0 = np.eye(4)
    T_0[:3, :3] = np.stack([x, np.cross(z[0], x), z[0]], axis=1)
    T_0[:3, 3] = corner = p[0].copy()
    dh = np.zeros((len(p), 4))
    for i in range(len(p) - 1):
        _straighten(p, z, i)
        before = x
        x, foot, far_foot = _common_normal(p, z, i, before)
        dh[i, 2] = _angle(before, x, z[i])
        dh[i, 3] = _rounded(float((foot - corner) @ z[i]))
        dh[i + 1, 0] = _angle(z[i], z[i + 1], x)
        dh[i + 1, 1] = _rounded(float((far_foot - foot) @ x))
        corner = far_foot
    return T_0, dh, _rounded(float((p[-1] - corner) @ z[-1]))


def _straighten(p: Array, z: Array, i: int) -> None:
    """Turn what comes after axis i so that an axis next to parallel is parallel to it."""
    target = np.copysign(1.0, z[i] @ z[i + 1]) * z[i]
    cross = np.cross(z[i + 1], target)
    sine = float(np.linalg.norm(cross))
    if not 0.0 < sine < PARALLEL:
        return
    # Rodrigues 1840, about the cross product.
    k = np.array(
        [[0.0, -cross[2], cross[1]], [cross[2], 0.0, -cross[0]], [-cross[1], cross[0], 0.0]]
    )
    turn = np.eye(3) + k + k @ k / (1.0 + np.sqrt(1.0 - sine * sine))
    p[i + 1 :] = p[i + 1] + (p[i + 1 :] - p[i + 1]) @ turn.T
    z[i + 1 :] = z[i + 1 :] @ turn.T
    z[i + 1] = target


def _common_normal(p: Array, z: Array, i: int, before: Array) -> tuple[Array, Array, Array]:
    """Return the direction of the normal from axis i to the next, and its feet on the two."""
    between = p[i + 1] - p[i]
    cross = np.cross(z[i], z[i + 1])
    square = float(cross @ cross)
    if square < PARALLEL**2:
        # Any normal will do; this one begins beside the next point.
        foot, far_foot = p[i] + (between @ z[i]) * z[i], p[i + 1]
        length = float(np.linalg.norm(far_foot - foot))
        # Of one line every normal is one of the two; the former turns by no angle.
        return ((far_foot - foot) / length if length > MEETING else before), foot, far_foot
    foot = p[i] + (np.cross(between, z[i + 1]) @ cross / square) * z[i]
    far_foot = p[i + 1] + (np.cross(between, z[i]) @ cross / square) * z[i + 1]
    x = cross / np.sqrt(square)
    length = float((far_foot - foot) @ x)
    if length < -MEETING or (abs(length) <= MEETING and x @ before < -MEETING):
        x = -x
    return x, foot, far_foot


def _angle(u: Array, v: Array, axis: Array) -> float:
    """Return the angle from u to v about an axis square to both [rad]."""
    angle = float(np.arctan2(np.cross(u, v) @ axis, u @ v))
    quarters = angle / (0.5 * np.pi)
    # What only rounding keeps from a right angle is one: arms that are square plan faster.
    return 0.5 * np.pi * round(quarters) if abs(quarters - round(quarters)) < 1e-12 else angle


def _rounded(length: float) -> float:
    return 0.0 if abs(length) < MEETING else round(length, 12)


def _across(wish: Array, axis: Array) -> Array:
    """Return the unit vector square to an axis that is nearest to a wish, or any."""
    # Tried in turn, since one of the first two may lie along the axis.
    for vector in (wish, np.eye(3)[0], np.eye(3)[1]):
        rest = vector - (vector @ axis) * axis
        length = float(np.linalg.norm(rest))
        if length > 0.1:
            break
    return np.asarray(rest / length)
