# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm: a chain of modified Denavit-Hartenberg rows, its shape, and its pointing ray."""

from dataclasses import dataclass
import functools
import math

import numpy as np
from numpy.typing import ArrayLike
from rrth_planner.kernels.layout import MAX_BARS, MAX_DOF, NO_BAR
from rrth_planner.model.arrays import Array, FARTHEST, float_array, float_number, frozen_array
from rrth_planner.model.errors import check_type, ModelError, printable
from rrth_planner.model.frozen import Frozen

# Radius of a row whose offsets are no bars.
NO_BARS = NO_BAR
# Keys of the rows of an arm's file, and their units.
ROW = {'alpha': 'rad', 'a': 'm', 'offset': 'rad', 'd': 'm'}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Capsule(Frozen):
    """
    All points within a radius of a straight line that is fixed to a link.

    Parameters
    ----------
    name : str
        What messages call it: the link's name.
    link : int
        0: the mount, i: the link that joint i moves (i = 1 ... dof), both in Craig's frame i;
        dof + 1: the last link again, in the frame of the tool.
    ends : array_like, shape (2, 3)
        Of the line, in that frame [m].
    radius : float
        >= 0 [m].

    Raises
    ------
    ModelError
        Names that cannot be printed, numbers that are none, a radius below 0, beyond 1e4 m.

    """

    name: str
    link: int
    ends: Array
    radius: float

    def __post_init__(self) -> None:
        """Validate and freeze."""
        printable(self.name, 'capsule: name', ModelError)
        label = f'capsule "{self.name}"'
        ends = frozen_array(self.ends, (2, 3), f'{label}: ends', 'm', ModelError, FARTHEST)
        object.__setattr__(self, 'ends', ends)
        radius = float_number(self.radius, f'{label}: radius', 'm', 0.0, FARTHEST, ModelError)
        object.__setattr__(self, 'radius', radius)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ArmModel(Frozen):
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
        Radius of the bars that the offsets `a` and `d` of each row are; -1: the offsets of that
        row are no bars; the last one is that of the pointing ray, >= 0 [m].
    T_base_mount : array_like, shape (4, 4)
        Pose of the arm's frame 0 in the wearer's base frame [m].
    capsules : tuple of Capsule
        What else the links are made of. Those of the mount, which is worn on the body, are checked
        against the rest of the arm only.
    allowed : tuple of (str, str)
        Pairs that may meet: a part of the arm, by the name that messages give it, and another
        part or a box.
    is_continuous : tuple of bool
        Which revolute joints have no stop: their limits only say how far their cables may wind;
        empty: none.

    Raises
    ------
    ModelError
        Inconsistent rows, names, limits or capsules, or an angle or extent beyond 1e4 rad or m.

    """

    joint_names: tuple[str, ...]
    is_prismatic: tuple[bool, ...]
    dh: Array
    bounds: Array
    radii: Array
    T_base_mount: Array
    capsules: tuple[Capsule, ...] = ()
    allowed: tuple[tuple[str, str], ...] = ()
    is_continuous: tuple[bool, ...] = ()

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
        continuous = tuple(bool(flag) for flag in self.is_continuous) or (False,) * dof
        if len(continuous) != dof or any(np.array(continuous) & prismatic):
            raise ModelError(
                f'is_continuous: {list(continuous)}, expected {dof} values, True for revolute '
                'joints only'
            )
        object.__setattr__(self, 'is_continuous', continuous)
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
        if (self.radii[-1] < 0.0) or ((self.radii < 0.0) & (self.radii != NO_BARS)).any():
            raise ModelError(
                f'radii: {self.radii.tolist()}, expected lengths >= 0, or {NO_BARS:g}: no bars; '
                'that of the pointing ray >= 0 [m]'
            )
        if self.dh[-1, 3] != 0.0:
            raise ModelError(f'dh: d = {self.dh[-1, 3]} in the row of the tool, expected 0 [m]')
        self._check_capsules(dof)
        n_bars = len(bar_ends(self)) + len(self.capsules)
        if n_bars > MAX_BARS:
            raise ModelError(
                f'dh: {n_bars} bars and capsules, expected at most {MAX_BARS}: each a and d after '
                'the first joint that is not 0, each joint that slides, and the pointing ray [-]'
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
            + max(
                self.radii.max(),
                *(np.linalg.norm(c.ends, axis=1).max() + c.radius for c in self.capsules),
                0.0,
            )
        )
        if extent > FARTHEST:
            raise ModelError(
                f'arm: {extent:g}, its mount, a, d and radius added up, expected at most '
                f'{FARTHEST:g} [m]'
            )

    def _check_capsules(self, dof: int) -> None:
        """Validate and freeze capsules and the pairs that may meet."""
        object.__setattr__(self, 'capsules', tuple(self.capsules))
        object.__setattr__(self, 'allowed', tuple((str(a), str(b)) for a, b in self.allowed))
        for capsule in self.capsules:
            if not 0 <= capsule.link <= dof + 1:
                raise ModelError(
                    f'capsule "{capsule.name}": link {capsule.link}, expected 0 to {dof + 1} [-]'
                )
        for pair in self.allowed:
            for name in pair:
                printable(name, 'allowed', ModelError)
            known = {*bar_names(self), *(capsule.name for capsule in self.capsules)}
            if pair[0] not in known:
                raise ModelError(
                    f'allowed: no part of the arm is called "{pair[0]}", expected one of '
                    f'{sorted(known)} first'
                )

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def units(self) -> tuple[str, ...]:
        """The units of its joint positions: rad, or m where one slides."""
        return tuple(['m' if slides else 'rad' for slides in self.is_prismatic])


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """
    A straight part of the arm with a radius: a capsule, an offset of a row, or the pointing ray.

    Parameters
    ----------
    body : int
        How many joints move it. Bars of the same body keep their places to each other.
    source : Capsule or (int, str)
        The capsule, or the row of the offset and which one it is, 'a' or 'd'.

    """

    name: str
    body: int
    radius: float
    source: Capsule | tuple[int, str]


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
        if arm.radii[row] == NO_BARS:
            continue
        if is_moved and a != 0.0:
            bars.append((row, 'a'))
        if is_ray or arm.is_prismatic[row] or (is_moved and d != 0.0):
            bars.append((row, 'd'))
    return tuple(bars)


@functools.lru_cache(maxsize=16)
def bars_of(arm: ArmModel) -> tuple[Bar, ...]:
    """Return all bars of an arm that its joints move: its capsules first, the ray last."""
    moved = [
        Bar(capsule.name, min(capsule.link, arm.dof), capsule.radius, capsule)
        for capsule in arm.capsules
        if capsule.link > 0
    ]
    for row, end in bar_ends(arm):
        # `a` leads from the link before; so does a `d` that slides, but its end is what matters.
        body = row if end == 'a' else min(row + 1, arm.dof)
        name = 'pointing ray' if row == arm.dof else f'link {row + 1}'
        moved.append(Bar(name, body, float(arm.radii[row]), (row, end)))
    return tuple(moved)


@functools.lru_cache(maxsize=16)
def mount_bars(arm: ArmModel) -> tuple[Bar, ...]:
    """Return the capsules of the mount, which no joint moves."""
    return tuple(Bar(c.name, 0, c.radius, c) for c in arm.capsules if c.link == 0)


@functools.lru_cache(maxsize=16)
def bar_names(arm: ArmModel) -> tuple[str, ...]:
    """Return what messages call the bars of `bars_of`."""
    return tuple(bar.name for bar in bars_of(arm))


def is_called(box: str, name: str) -> bool:
    """Return whether a box has a name, or is one of those that have it: `name/0`, `name[1]`."""
    return box == name or (box.startswith(name) and box[len(name)] in '/[')


def forward_kinematics(arm: ArmModel, q: ArrayLike) -> Array:
    """
    Return the poses of the link frames and of the tool in the base frame.

    (..., dof) [rad or m] -> (..., dof + 1, 4, 4) [m]; the last one is the tool's: the pointing ray
    leaves its origin along its +z. Numbers that are not finite, and another number of joints,
    raise an RrthError.
    """
    check_type(arm, ArmModel, 'arm')
    poses = link_poses(arm, float_array(q, (..., arm.dof), 'q', 'rad or m'))
    T = arm.T_base_mount
    for i in range(arm.dof + 1):
        T = poses[..., i, :, :] = T @ poses[..., i, :, :]
    return poses


def link_poses(arm: ArmModel, q: Array) -> Array:
    """Return the pose of each link frame in the one before, as `forward_kinematics` [m]."""
    offset, slides, parts, tool = _link_parts(arm)
    theta, terms = q + offset, np.empty((*q.shape, 1, 3))
    terms[..., 0] = 1.0
    np.cos(theta, out=terms[..., 0, 1])
    np.sin(theta, out=terms[..., 0, 2])
    if slides:
        terms[..., slides, 0, 1] = q[..., slides]
    poses = np.empty((*q.shape[:-1], arm.dof + 1, 16))
    np.matmul(terms, parts, out=poses[..., :-1, None, :])
    poses[..., -1, :] = tool
    return poses.reshape(*poses.shape[:-1], 4, 4)


@functools.lru_cache(maxsize=16)
def _link_parts(arm: ArmModel) -> tuple[Array, list[int], Array, Array]:
    """
    Return what `link_poses` adds up: offsets (dof,), which joints slide, parts, the tool's pose.

    The pose of link frame i in frame i - 1 (Craig 2005, eq. 3.6) is the sum of its parts, of shape
    (dof, 3, 16), times 1, cos(theta) and sin(theta), or times 1, q and 0 of a joint that slides.
    That of the tool, (16,), is constant.
    """
    alpha, a, offset, d = arm.dh.T
    ca, sa = np.cos(alpha), np.sin(alpha)
    fixed, cosine, sine, along = np.zeros((4, arm.dof + 1, 4, 4))
    fixed[:, 0, 3], fixed[:, 3, 3] = a, 1.0
    fixed[:, 1, 2], fixed[:, 2, 2] = -sa, ca
    cosine[:, 0, 0], cosine[:, 1, 1], cosine[:, 2, 1] = 1.0, ca, sa
    sine[:, 0, 1], sine[:, 1, 0], sine[:, 2, 0] = -1.0, ca, sa
    along[:, 1, 3], along[:, 2, 3] = -sa, ca
    fixed += d[:, None, None] * along
    turned = np.cos(offset)[:, None, None] * cosine + np.sin(offset)[:, None, None] * sine
    slides = [i for i, is_prismatic in enumerate(arm.is_prismatic) if is_prismatic]
    rows = [*slides, arm.dof]
    fixed[rows] += turned[rows]
    cosine[rows], sine[rows] = along[rows], 0.0
    parts = np.stack([fixed, cosine, sine], axis=1).reshape(-1, 3, 16)
    parts.setflags(write=False)
    return arm.dh[:-1, 2], slides, parts[:-1], parts[-1, 0]


def tool_in_last_link(arm: ArmModel, points: Array) -> Array:
    """Return points of the tool's frame in that of the last link, (..., 3) -> (..., 3) [m]."""
    T = link_poses(arm, np.zeros(arm.dof))[-1]
    result: Array = points @ T[:3, :3].T + T[:3, 3]
    return result


def tool_pose(arm: ArmModel, q: ArrayLike) -> Array:
    """Return the tool's pose in the base frame, its +z the ray, (..., dof) -> (..., 4, 4) [m]."""
    pose: Array = forward_kinematics(arm, q)[..., -1, :, :]
    return pose


def reach_to(arm: ArmModel, target: ArrayLike, q: ArrayLike) -> float:
    """Return the distance from the tool to a target of the base frame [m]."""
    return float(np.linalg.norm(_point(target) - tool_pose(arm, q)[:3, 3]))


def capsule_ends(arm: ArmModel, q: Array) -> Array:
    """Return the lines of the arm's capsules in the base frame, (n, 2, 3) [m]."""
    poses = np.concatenate([arm.T_base_mount[None], forward_kinematics(arm, q)])
    ends = [c.ends @ poses[c.link, :3, :3].T + poses[c.link, :3, 3] for c in arm.capsules]
    return np.array(ends).reshape(-1, 2, 3)


def pointing_angle(arm: ArmModel, q: ArrayLike, target: ArrayLike) -> float:
    """Return the angle between the ray and the direction from tool to target [rad]."""
    T = tool_pose(arm, q)
    v, z = _point(target) - T[:3, 3], T[:3, 2]
    return math.atan2(float(np.linalg.norm(np.cross(z, v))), float(v @ z))


def pointing_error(arm: ArmModel, q: ArrayLike, target: ArrayLike) -> float:
    """Return the distance of the pointing ray from a target of the base frame [m]."""
    T = tool_pose(arm, q)
    v = _point(target) - T[:3, 3]
    reach = max(0.0, float(v @ T[:3, 2]))
    return float(np.linalg.norm(v - reach * T[:3, 2]))


def _point(target: ArrayLike) -> Array:
    return float_array(target, (3,), 'target', 'm')
