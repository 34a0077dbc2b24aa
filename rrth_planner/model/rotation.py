# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Unit quaternions (x, y, z, w) and poses, as ROS messages carry them."""

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.model.arrays import Array


def rotation_matrix(quaternion_xyzw: ArrayLike) -> Array:
    """Return the rotation of a quaternion of any positive length, shape (3, 3)."""
    q = np.asarray(quaternion_xyzw, dtype=np.float64)
    return _matrix(*(q / np.linalg.norm(q)))


def rotation_matrices(quaternions_xyzw: ArrayLike) -> Array:
    """Return the rotations of quaternions of any positive lengths, (n, 4) -> (n, 3, 3)."""
    q = np.asarray(quaternions_xyzw, dtype=np.float64)
    return np.moveaxis(_matrix(*(q.T / np.linalg.norm(q, axis=1))), -1, 0)


def _matrix(x: Array, y: Array, z: Array, w: Array) -> Array:
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_xyzw(rotation: Array) -> Array:
    """Return unit quaternions of rotations, (..., 3, 3) -> (..., 4), w >= 0 (Shepperd 1978)."""
    r = np.moveaxis(rotation, (-2, -1), (0, 1))
    xx, yy, zz = r[0, 0], r[1, 1], r[2, 2]
    xy, xz, yz = r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1]
    wx, wy, wz = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    # Four times each product of two components.
    table = np.array(
        [
            [1 + xx - yy - zz, xy, xz, wx],
            [xy, 1 - xx + yy - zz, yz, wy],
            [xz, yz, 1 - xx - yy + zz, wz],
            [wx, wy, wz, 1 + xx + yy + zz],
        ]
    )
    # The largest of the four squares is far from zero, so the division below is safe.
    largest = np.argmax(np.einsum('ii...->i...', table), axis=0)
    q = np.take_along_axis(table, largest[None, None], axis=0)[0]
    q = q / np.linalg.norm(q, axis=0)
    return np.moveaxis(np.where(q[3] < 0, -q, q), 0, -1)


def roll_pitch_yaw(rotation: Array) -> Array:
    """
    Return the angles of a rotation about the fixed axes x, y and z, in that order, (3,) [rad].

    They are those of URDF: `Rz(yaw) Ry(pitch) Rx(roll)`. Where roll and yaw turn about the same
    axis, the yaw is 0.
    """
    r = rotation
    is_upright = np.hypot(r[0, 0], r[1, 0]) < 1e-12
    yaw = 0.0 if is_upright else np.arctan2(r[1, 0], r[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    # What the yaw leaves is a roll and a pitch, precise even where the yaw is not.
    pitch = np.arctan2(-r[2, 0], c * r[0, 0] + s * r[1, 0])
    roll = np.arctan2(s * r[0, 2] - c * r[1, 2], c * r[1, 1] - s * r[0, 1])
    return np.array([roll, pitch, yaw])


def pose_matrix(position: ArrayLike, quaternion: ArrayLike) -> Array:
    """Return the pose of a frame from its position [m] and quaternion (x, y, z, w), (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = rotation_matrix(quaternion)
    T[:3, 3] = position
    return T


def turned_to(z: Array) -> Array:
    """Return a rotation, (3, 3), whose z axis is a unit vector, (3,)."""
    # Any axis that is not along z will do for the others.
    x = np.cross(np.eye(3)[int(np.abs(z).argmin())], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)
