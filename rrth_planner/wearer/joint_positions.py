# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the joints of a skeleton are in a posture of a tracker."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import LONGEST, Skeleton

Indices = NDArray[np.intp]

# A point further from the tracker's origin is lost [m].
FARTHEST_POINT = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """Of each joint its points as indices into those of a posture, and its offset."""

    points: Indices
    weights: Array
    offset_joints: Indices
    offset_points: Indices
    offsets: Array


def joint_positions(skeleton: Skeleton, posture: Posture) -> Array:
    """Return where the joints are in the frame of the tracker, (n_joints, 3) [m], NaN: lost."""
    return joints_of(skeleton, posture.names, posture.positions, posture.rotations)


def joints_of(
    skeleton: Skeleton, names: tuple[str, ...], positions: Array, rotations: Array | None
) -> Array:
    """
    Return the same of one posture, or of many at once, (..., n_joints, 3).

    positions (..., n, 3) and rotations (..., n, 3, 3) of the points with these names.
    """
    layout = _layout(skeleton, names)
    points = np.empty((*positions.shape[:-2], len(names) + 1, 3))
    points[..., :-1, :] = positions
    points[..., -1, :] = np.nan
    points[~(np.abs(points) <= FARTHEST_POINT)] = np.nan
    joints: Array = (points[..., layout.points, :] * layout.weights).sum(axis=-2)
    if layout.offset_joints.size:
        if rotations is None or not names:
            joints[..., layout.offset_joints, :] = np.nan
        else:
            turned = rotations[..., layout.offset_points, :, :] @ layout.offsets
            turned[~(np.abs(turned) <= LONGEST * 2)] = np.nan
            joints[..., layout.offset_joints, :] += turned[..., 0]
    return joints


@lru_cache(maxsize=16)
def _layout(skeleton: Skeleton, names: tuple[str, ...]) -> _Layout:
    """Return where the joints of a skeleton find their points in postures with these names."""
    place = {name: k for k, name in enumerate(names)}
    points = padded([[place.get(p, len(names)) for p in j.points] for j in skeleton.joints])
    weights = np.zeros(points.shape)
    for weight, joint in zip(weights, skeleton.joints, strict=True):
        weight[: len(joint.points)] = 1.0 / len(joint.points)
    # Frames that are missing have no place: their joints are lost by their positions.
    placed = [(k, j.offset) for k, j in enumerate(skeleton.joints) if j.offset is not None]
    with_offset = [k for k, _ in placed]
    offset_points = points[with_offset, 0] if with_offset else np.zeros(0, dtype=np.intp)
    offsets = [skeleton.axes @ offset for _, offset in placed]
    return _Layout(
        points=points,
        weights=weights[:, :, None],
        offset_joints=np.array(with_offset, dtype=np.intp),
        offset_points=np.minimum(offset_points, len(names) - 1),
        offsets=np.array(offsets).reshape(-1, 3, 1),
    )


def padded(lists: list[list[int]]) -> Indices:
    """Return lists of indices as rows, (n, longest), the shorter ones ended by their first."""
    longest = max(map(len, lists), default=1)
    rows = [[*row, *row[:1] * (longest - len(row))] for row in lists]
    return np.array(rows, dtype=np.intp).reshape(len(lists), longest)
