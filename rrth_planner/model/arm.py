# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm: a chain of modified Denavit-Hartenberg rows that ends in a pointing ray."""

from dataclasses import dataclass
import functools

import numpy as np
from numpy.typing import NDArray
from rrth_planner.kernels.layout import MAX_BARS, MAX_DOF
from rrth_planner.model.arrays import Array, FARTHEST, frozen_array
from rrth_planner.model.errors import ModelError, printable

# Keys of the rows of an arm's file, and their units.
ROW = {'alpha': 'rad', 'a': 'm', 'offset': 'rad', 'd': 'm'}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ArmModel:
    """
    A serial arm in Craig's convention, `T = Rx(alpha) Tx(a) Rz(theta + offset) Tz(d)`.

    Parameters
    ----------
    joint_names : tuple of str
        One name a joint, from the mount outwards.
    is_prismatic : array_like of bool, shape (dof,)
        A prismatic joint adds its position to `d`, a revolute one to `offset`.
    dh : array_like, shape (dof + 1, 4)
        Rows `alpha` [rad], `a` [m], `offset` [rad], `d` [m]; the last row is the tool, whose
        `d` is the length of the pointing ray and must be 0 here.
    bounds : array_like, shape (2, dof)
        Lowest and highest joint positions [rad or m].
    radii : array_like, shape (dof + 1,)
        Thickness of the bars of each row, ray included [m].
    T_base_mount : array_like, shape (4, 4)
        Pose of the arm's frame 0 in the wearer's base frame [m].

    Raises
    ------
    ModelError
        Inconsistent rows, names or limits, or an angle or extent beyond 1e4 rad or m.

    """

    joint_names: tuple[str, ...]
    is_prismatic: tuple[bool, ...]
    dh: Array
    bounds: Array
    radii: Array
    T_base_mount: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        names = tuple(self.joint_names)
        dof = len(names)
        for i, name in enumerate(names):
            printable(name, f'joint_names[{i}]', ModelError)
        if dof < 1 or len(set(names)) != dof:
            raise ModelError(f'joint_names: {list(names)}, expected at least one, all different')
        if dof > MAX_DOF:
            raise ModelError(f'joint_names: {dof} joints, expected at most {MAX_DOF}')
        prismatic = tuple(bool(flag) for flag in self.is_prismatic)
        if len(prismatic) != dof:
            raise ModelError(f'is_prismatic: {len(prismatic)} values, expected {dof}')
        object.__setattr__(self, 'joint_names', names)
        object.__setattr__(self, 'is_prismatic', prismatic)
        for field, shape, unit in (
            ('dh', (dof + 1, 4), 'rad and m'),
            ('bounds', (2, dof), 'rad or m'),
            ('radii', (dof + 1,), 'm'),
            ('T_base_mount', (4, 4), 'm'),
        ):
            value = frozen_array(getattr(self, field), shape, field, unit, ModelError, FARTHEST)
            object.__setattr__(self, field, value)
        if not (self.bounds[0] < self.bounds[1]).all():
            raise ModelError(f'bounds: {self.bounds.tolist()}, expected lower < upper [rad or m]')
        if (self.radii < 0.0).any():
            raise ModelError(f'radii: {self.radii.tolist()}, expected lengths >= 0 [m]')
        if self.dh[-1, 3] != 0.0:
            raise ModelError(f'dh: d = {self.dh[-1, 3]} in the row of the tool, expected 0 [m]')
        n_bars = len(bar_ends(self))
        if n_bars > MAX_BARS:
            raise ModelError(
                f'dh: {n_bars} bars, expected at most {MAX_BARS}: each a and d behind the first '
                'joint that is not 0, each joint that slides, and the pointing ray [-]'
            )
        if not np.array_equal(self.T_base_mount[3], [0.0, 0.0, 0.0, 1.0]):
            raise ModelError(f'mount: last row {self.T_base_mount[3].tolist()}, expected 0 0 0 1')
        r = self.T_base_mount[:3, :3]
        if np.abs(r @ r.T - np.eye(3)).max() > 1e-6 or np.linalg.det(r) < 0.0:
            raise ModelError(f'mount: rotation {r.tolist()}, expected a rotation matrix [-]')
        # Upper bound of the distance of any frame of the arm, in all configurations.
        slides = np.array(prismatic)
        extent = (
            np.linalg.norm(self.T_base_mount[:3, 3])
            + np.abs(self.dh[:, [1, 3]]).sum()
            + np.abs(self.bounds[:, slides]).max(axis=0).sum()
            + self.radii.max()
        )
        if extent > FARTHEST:
            raise ModelError(
                f'arm: {extent:g}, its mount, a, d and radius added up, expected at most '
                f'{FARTHEST:g} [m]'
            )

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joint_names)


@functools.lru_cache(maxsize=16)
def bar_ends(arm: ArmModel) -> tuple[tuple[int, str], ...]:
    """
    Return the offsets of an arm that are bars, (row, 'a' or 'd'), from the mount outwards.

    Offsets of length zero are no bars. Those that no joint moves belong to the mount, which is
    worn on the body and therefore not checked against it.
    """
    bars = []
    for row, (_, a, _, d) in enumerate(arm.dh):
        is_moved, is_ray = row > 0, row == arm.dof
        if is_moved and a != 0.0:
            bars.append((row, 'a'))
        if is_ray or arm.is_prismatic[row] or (is_moved and d != 0.0):
            bars.append((row, 'd'))
    return tuple(bars)


@functools.lru_cache(maxsize=16)
def bar_names(arm: ArmModel) -> tuple[str, ...]:
    """Return what messages call the bars of `bar_ends`."""
    return tuple(
        'pointing ray' if row == arm.dof else f'link {row + 1}' for row, _ in bar_ends(arm)
    )


def forward_kinematics(arm: ArmModel, q: Array) -> Array:
    """
    Return the poses of the link frames and of the tool in the base frame.

    (..., dof) [rad or m] -> (..., dof + 1, 4, 4) [m]; the last one is the tool's: the pointing ray
    leaves its origin along its +z.
    """
    poses = link_poses(arm, q)
    T = arm.T_base_mount
    for i in range(arm.dof + 1):
        T = poses[..., i, :, :] = T @ poses[..., i, :, :]
    return poses


def link_poses(arm: ArmModel, q: Array) -> Array:
    """Return the pose of each link frame in the one before, as `forward_kinematics` [m]."""
    q = np.asarray(q, dtype=np.float64)
    constant, slides, parts = _link_parts(arm)
    values = np.zeros((*q.shape[:-1], arm.dof + 1))
    values[..., :-1] = q
    theta = constant[0] + np.where(slides, 0.0, values)
    terms = np.ones((*theta.shape, 1, 4))
    np.cos(theta, out=terms[..., 0, 1])
    np.sin(theta, out=terms[..., 0, 2])
    terms[..., 0, 3] = constant[1] + np.where(slides, values, 0.0)
    poses: Array = (terms @ parts).reshape(*theta.shape, 4, 4)
    return poses


@functools.lru_cache(maxsize=16)
def _link_parts(arm: ArmModel) -> tuple[Array, NDArray[np.bool_], Array]:
    """
    Return offsets and lengths (2, dof + 1), which joints slide, and the parts of the link poses.

    The pose of link frame i in frame i - 1 (Craig 2005, eq. 3.6) is the sum of its parts, of shape
    (dof + 1, 4, 16), times 1, cos(theta), sin(theta) and d.
    """
    alpha, a, offset, d = arm.dh.T
    ca, sa = np.cos(alpha), np.sin(alpha)
    parts = np.zeros((arm.dof + 1, 4, 4, 4))
    parts[:, 0, 0, 3], parts[:, 0, 3, 3] = a, 1.0
    parts[:, 0, 1, 2], parts[:, 0, 2, 2] = -sa, ca
    parts[:, 1, 0, 0], parts[:, 1, 1, 1], parts[:, 1, 2, 1] = 1.0, ca, sa
    parts[:, 2, 0, 1], parts[:, 2, 1, 0], parts[:, 2, 2, 0] = -1.0, ca, sa
    parts[:, 3, 1, 3], parts[:, 3, 2, 3] = -sa, ca
    slides = np.array([*arm.is_prismatic, False])
    return np.stack([offset, d]), slides, parts.reshape(-1, 4, 16)


def tool_pose(arm: ArmModel, q: Array) -> Array:
    """Return the tool's pose in the base frame, its +z the ray, (..., dof) -> (..., 4, 4) [m]."""
    pose: Array = forward_kinematics(arm, q)[..., -1, :, :]
    return pose


def reach_to(arm: ArmModel, target: Array, q: Array) -> float:
    """Return the distance from the tool to a target of the base frame [m]."""
    return float(np.linalg.norm(target - tool_pose(arm, q)[:3, 3]))


def pointing_error(arm: ArmModel, q: Array, target: Array) -> float:
    """Return the distance of the pointing ray from a target of the base frame [m]."""
    T = tool_pose(arm, q)
    v = target - T[:3, 3]
    reach = max(0.0, float(v @ T[:3, 2]))
    return float(np.linalg.norm(v - reach * T[:3, 2]))
