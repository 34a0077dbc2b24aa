# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes round a wearer of whom a tracker sees points or frames."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError, shown
from rrth_planner.model.scene import Box, Scene
from rrth_planner.wearer.joint_positions import (
    FARTHEST_POINT,
    Indices,
    joint_positions,
    joints_of,
    padded,
)
from rrth_planner.wearer.plausible_posture import are_plausible, plausible_posture
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import (
    AXES,
    BASE,
    Direction,
    FrameBase,
    JointBase,
    Skeleton,
)

# Of `Box.numbers`, (15,).
CENTER, SIZE, ROTATION = slice(0, 3), slice(3, 6), slice(6, 15)
# Joints closer than this say no direction: a tracker has mixed them up [m].
CLOSEST = 0.01
# No joint of an adult is further from the next one: more than the longest thigh [m].
LONGEST_BONE = 0.5
# The axes in which a box is kept whose own are unknown.
BASE_AXES = (Direction('up', BASE, 'up'), Direction('left', BASE, 'left'))


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """
    A skeleton as indices into the points of a posture.

    Rows of joints come first, then the origin of the base frame and a point 1 m along each of its
    axes. Shorter lists repeat their first entry.
    """

    base_point: int
    base_origin: int
    base_ends: Indices
    base_order: Indices
    base_signs: Array
    part_joints: Indices
    ends: Indices
    is_limb: NDArray[np.bool_]
    rests: Array
    rest_sides: Array
    order: Indices
    signs: Array
    margins: Array
    reaches: Array


def body_boxes(skeleton: Skeleton, posture: Posture) -> tuple[Scene, tuple[str, ...]]:
    """
    Return the boxes round a wearer in his base frame, and the names of the parts that are lost.

    What no person can have is not believed (`plausible_posture`). Each part is a box turned as
    its directions say, round its joints and its margins beyond them. Where
    joints that say a direction are in one place, it is a cube as wide as the longest bone of an
    adult either way, which contains the part however it is turned.

    Parameters
    ----------
    posture : Posture
        In any frame; of frames of which offsets or the base are taken, with rotations.

    Returns
    -------
    Scene
        A box for each part of which all joints are seen, in the order of the skeleton.
    tuple of str
        The parts of which a point is lost, missing, or not believed.

    Raises
    ------
    SceneError
        The points or the frame of the base are lost, or it is no person.

    """
    return boxes_of_plausible(skeleton, plausible_posture(skeleton, posture).posture)


def boxes_of_plausible(skeleton: Skeleton, posture: Posture) -> tuple[Scene, tuple[str, ...]]:
    """Return the same as `body_boxes` of a posture that was judged before, and filtered since."""
    layout, joints = _layout(skeleton, posture.names), joint_positions(skeleton, posture)
    rotation, origin = _base(skeleton, layout, joints, posture)
    rows = _rows(layout, _in_base(joints, rotation, origin))
    is_seen = np.isfinite(rows.sum(axis=1)).tolist()
    rows.setflags(write=False)
    names = [part.name for part in skeleton.parts]
    boxes = tuple(
        Box.of_row(name, row) for name, row, seen in zip(names, rows, is_seen, strict=True) if seen
    )
    missing = tuple(name for name, seen in zip(names, is_seen, strict=True) if not seen)
    return Scene(boxes), missing


def rows_of_postures(
    skeleton: Skeleton, names: tuple[str, ...], positions: Array, rotations: Array | None
) -> Array:
    """
    Return the numbers of the boxes of many postures, found together, (m, n_parts, 15).

    As `body_boxes`, to the bit: a box for each part of the skeleton, NaN where that is lost, all
    of them where it is no person. positions (m, n, 3), rotations (m, n, 3, 3) of the points with
    these names.
    """
    layout, joints = _layout(skeleton, names), joints_of(skeleton, names, positions, rotations)
    m, n_parts = len(positions), len(skeleton.parts)
    in_base = np.full((m, joints.shape[1] + 4, 3), np.nan)
    believed = are_plausible(skeleton, names, positions, rotations)
    others: dict[int, Array] = {}
    for i in range(m):
        turned = None if rotations is None else rotations[i]
        posture = Posture(names=names, positions=positions[i], rotations=turned)
        try:
            if believed[i]:
                rotation, origin = _base(skeleton, layout, joints[i], posture)
                in_base[i] = _in_base(joints[i], rotation, origin)
            else:
                others[i] = _found_rows(skeleton, posture)
        except SceneError:
            pass
    rows = _rows(_repeated(layout, m, in_base.shape[1]), in_base.reshape(-1, 3))
    rows[~np.isfinite(rows.sum(axis=1))] = np.nan
    rows = rows.reshape(m, n_parts, -1)
    for i, found in others.items():
        rows[i] = found
    return rows


def _found_rows(skeleton: Skeleton, posture: Posture) -> Array:
    """Return the numbers of the boxes of one posture, (n_parts, 15), NaN where a part is lost."""
    rows = np.full((len(skeleton.parts), ROTATION.stop), np.nan)
    found = {box.name: box.numbers for box in body_boxes(skeleton, posture)[0].boxes}
    for k, part in enumerate(skeleton.parts):
        if part.name in found:
            rows[k] = found[part.name]
    return rows


def _in_base(joints: Array, rotation: Array, origin: Array) -> Array:
    """Return joints in the base frame, its origin and a point 1 m along each of its axes."""
    in_base = np.empty((len(joints) + 4, 3))
    np.matmul(joints - origin, rotation, out=in_base[:-4])
    in_base[-4] = 0.0
    in_base[-3:] = np.eye(3)
    return in_base


# Of one skeleton, for the last block of a recording, too.
@lru_cache(maxsize=8)
def _repeated(layout: _Layout, m: int, n_points: int) -> _Layout:
    """Return a layout for the points of many postures, one after the other, n_points each."""
    n_parts = len(layout.signs)
    points, rows = n_points * np.arange(m), 3 * n_parts * np.arange(m)

    def shifted(indices: Indices, by: Indices) -> Indices:
        places = indices + by.reshape(-1, *(1,) * indices.ndim)
        return places.reshape(-1, *indices.shape[1:])

    def again(values: Any) -> Any:
        return np.tile(values, (m, *(1,) * (values.ndim - 1)))

    return replace(
        layout,
        part_joints=shifted(layout.part_joints, points),
        ends=shifted(layout.ends, points),
        is_limb=again(layout.is_limb),
        rests=again(layout.rests),
        rest_sides=again(layout.rest_sides),
        order=shifted(layout.order, rows),
        signs=again(layout.signs),
        margins=again(layout.margins),
        reaches=again(layout.reaches),
    )


def base_pose(skeleton: Skeleton, posture: Posture) -> Array:
    """
    Return the pose of the base frame in the frame of a tracker, (4, 4).

    Raises
    ------
    SceneError
        The points or the frame of the base are lost.

    """
    posture = plausible_posture(skeleton, posture).posture
    layout, joints = _layout(skeleton, posture.names), joint_positions(skeleton, posture)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = _base(skeleton, layout, joints, posture)
    return T


def _base(
    skeleton: Skeleton, layout: _Layout, joints: Array, posture: Posture
) -> tuple[Array, Array]:
    """Return the axes of the base frame as columns, (3, 3), and its origin, (3,)."""
    base = skeleton.base
    if base is None:
        return np.eye(3), np.zeros(3)
    if isinstance(base, FrameBase):
        if layout.base_point == len(posture.names) or posture.rotations is None:
            raise SceneError(f'base: no frame "{base.frame}" with a rotation, expected one')
        # What is left of rounding in single precision goes.
        turned = posture.rotations[layout.base_point] @ skeleton.axes
        rows, is_clear = _axes(turned.T[None, [2, 1]], layout.base_order, layout.base_signs)
        at, name = posture.positions[layout.base_point], base.frame
    else:
        ends = layout.base_ends
        spans = joints[ends[:, 1]] - joints[ends[:, 0]]
        rows, is_clear = _axes(spans[None], layout.base_order, layout.base_signs)
        at, name = joints[layout.base_origin], base.origin
    rotation = rows[0].T
    origin = at + rotation @ base.offset
    if not is_clear[0] or not np.abs(origin).max() <= FARTHEST_POINT:
        wanted = (
            dict.fromkeys([base.origin, *(j for d in base.axes for j in (d.start, d.end))])
            if isinstance(base, JointBase)
            else {}
        )
        points = [p for j in skeleton.joints if j.name in wanted for p in j.points]
        if absent := [point for point in points if point not in posture.names]:
            raise SceneError(
                f'base: no point "{absent[0]}" among {shown(list(posture.names))}, expected one'
            )
        raise SceneError(f'base: "{name}" or a joint of its axes is lost, expected all of them')
    return rotation, origin


def _axes(spans: Array, order: Indices, signs: Array) -> tuple[Array, NDArray[np.bool_]]:
    """
    Return unit axes, a row each, (m, 3, 3), of two directions, (m, 2, 3), and whether they are.

    `order` says which row of all (first, second, product) is each axis, `signs` which way the
    products point.
    """
    first, second = spans[:, 0], spans[:, 1]
    length = np.sqrt(np.einsum('ij,ij->i', first, first))
    found = np.empty((len(spans), 3, 3))
    u = np.divide(first, np.maximum(length, CLOSEST)[:, None], out=found[:, 0])
    v = second - np.einsum('ij,ij->i', second, u)[:, None] * u
    width = np.sqrt(np.einsum('ij,ij->i', v, v))
    v = np.divide(v, np.maximum(width, CLOSEST)[:, None], out=found[:, 1])
    u, v = u.T, v.T
    # Their product, written out: `np.cross` takes several times as long.
    found[:, 2, 0] = signs * (u[1] * v[2] - u[2] * v[1])
    found[:, 2, 1] = signs * (u[2] * v[0] - u[0] * v[2])
    found[:, 2, 2] = signs * (u[0] * v[1] - u[1] * v[0])
    rows = found.reshape(-1, 3)[order]
    return rows, (length >= CLOSEST) & (width >= CLOSEST)


def _rows(layout: _Layout, joints: Array) -> Array:
    """Return the numbers of the boxes, (m, 15), NaN where a joint is lost."""
    spans = joints[layout.ends[:, :, 1]] - joints[layout.ends[:, :, 0]]
    limbs = spans[layout.is_limb, 0]
    along = limbs / np.maximum(np.sqrt((limbs * limbs).sum(axis=1)), CLOSEST)[:, None]
    # A side of each limb, turned with it from its rest the shortest way.
    rests, sides = layout.rests, layout.rest_sides
    near = 1.0 + np.einsum('ij,ij->i', along, rests)
    share = np.einsum('ij,ij->i', along, sides) / np.maximum(near, 1e-12)
    spans[layout.is_limb, 1] = sides - share[:, None] * (rests + along)
    axes, is_clear = _axes(spans, layout.order, layout.signs)
    margins = layout.margins
    surrounded = joints[layout.part_joints]
    if not is_clear.all():
        # Where something is NaN, it stays so by what is surrounded.
        axes[~is_clear] = np.eye(3)
        margins = np.where(is_clear[:, None, None], margins, layout.reaches[:, None, None])
        lost = np.isnan(spans).any(axis=(1, 2))
        surrounded[lost] = np.nan
    inside = np.matmul(surrounded, axes.transpose(0, 2, 1))
    lower = inside.min(axis=1) - margins[:, :, 0]
    upper = inside.max(axis=1) + margins[:, :, 1]
    rows = np.empty((len(axes), ROTATION.stop))
    rows[:, CENTER] = np.matmul(0.5 * (lower + upper)[:, None], axes)[:, 0]
    rows[:, SIZE] = upper - lower
    rows[:, ROTATION] = axes.transpose(0, 2, 1).reshape(-1, 9)
    return rows


@lru_cache(maxsize=16)
def _layout(skeleton: Skeleton, names: tuple[str, ...]) -> _Layout:
    """Return where a skeleton finds its points in postures with these names."""
    place = {name: k for k, name in enumerate(names)}
    n = len(skeleton.joints)
    row = {joint.name: k for k, joint in enumerate(skeleton.joints)}
    row |= {BASE: n, **{axis: n + 1 + k for k, axis in enumerate(AXES)}}
    base = skeleton.base
    base_axes = base.axes if isinstance(base, JointBase) else BASE_AXES
    base_order, base_signs = _ordered([base_axes])
    kinds = [part.axes or BASE_AXES for part in skeleton.parts]
    order, signs = _ordered(kinds)
    ends = [[[row[d.start], row[d.end]] for d in (*axes, axes[0])[:2]] for axes in kinds]
    limbs = [part for part, axes in zip(skeleton.parts, kinds, strict=True) if len(axes) == 1]
    rests = np.array([part.rest / np.linalg.norm(part.rest) for part in limbs]).reshape(-1, 3)
    # Any side will do, as long as it is always the same.
    sides = [np.cross(rest, np.eye(3)[np.abs(rest).argmin()]) for rest in rests]
    margins = np.array([part.margins for part in skeleton.parts])
    return _Layout(
        base_point=place.get(base.frame, len(names)) if isinstance(base, FrameBase) else 0,
        base_origin=row[base.origin] if isinstance(base, JointBase) else 0,
        base_ends=np.array([[row[d.start], row[d.end]] for d in base_axes]),
        base_order=base_order,
        base_signs=base_signs,
        part_joints=padded([[row[name] for name in part.joints] for part in skeleton.parts]),
        ends=np.array(ends),
        is_limb=np.array([len(axes) == 1 for axes in kinds]),
        rests=rests,
        rest_sides=np.array([side / np.linalg.norm(side) for side in sides]).reshape(-1, 3),
        order=order,
        signs=signs,
        margins=margins,
        reaches=LONGEST_BONE + np.sqrt((margins.max(axis=2) ** 2).sum(axis=1)),
    )


def _ordered(kinds: list[tuple[Direction, ...]]) -> tuple[Indices, Array]:
    """Return, for `_axes`, which direction is which axis, and the sign of the third one."""
    order: list[list[int]] = []
    signs = []
    for axes in kinds:
        first = AXES.index(axes[0].axis)
        # The second axis of a limb is its left, or its top where it lies along its left.
        second = AXES.index(axes[1].axis) if len(axes) == 2 else (first - 1) % 3
        third = 3 - first - second
        found = {first: 0, second: 1, third: 2}
        order.append([3 * len(order) + found[k] for k in range(3)])
        signs.append(1.0 if (second - first) % 3 == 1 else -1.0)
    return np.array(order), np.array(signs)
