# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far the points of an arm can be from the axes of its joints."""

import functools
import math

import numpy as np
from rrth_planner.model.arm import ArmModel, Bar, bars_of, Capsule, mount_bars, tool_in_last_link
from rrth_planner.model.arrays import Array
from rrth_planner.model.joint_range import start_bounds

# A chain of offsets from one axis to one point: (row, 'a' or 'd'), in the order of the chain.
Offsets = list[tuple[int, str]]


def reach_bound(arm: ArmModel, ray_length: float, joint: int, row: int, end: str) -> float:
    """
    Return a bound of the distance of a point of the arm from the axis of a joint.

    The point is the `end` of the `a` or of the `d` offset of a DH row. Neighbouring offsets keep
    fixed angles whatever the joints do, so the norm of their sum is known exactly; the best split
    of the chain into such groups bounds the whole by the triangle inequality
    (`docs/algorithms.md`, section 2).

    It is the greatest distance from a revolute joint's axis [m]; for a prismatic joint 1 where it
    moves the point [-]; 0 where the joint does not move it.
    """
    if row < joint or (row == joint and end == 'a'):
        return 0.0
    if arm.is_prismatic[joint]:
        return 1.0
    offsets: Offsets = []
    for i in range(joint + 1, row + 1):
        offsets.append((i, 'a'))
        if i < row or end == 'd':
            offsets.append((i, 'd'))
    # best[n]: bound of the sum of the offsets from the n-th on.
    best = [math.inf] * (len(offsets) + 1)
    best[-1] = 0.0
    for first in range(len(offsets) - 1, -1, -1):
        for size in range(1, min(3, len(offsets) - first) + 1):
            group = offsets[first : first + size]
            length = _group_norm(arm, ray_length, group, is_first=first == 0)
            if length is not None:
                best[first] = min(best[first], length + best[first + size])
    return best[0]


def capsule_reach(arm: ArmModel, joint: int, capsule: Capsule, end: int) -> float:
    """Return `reach_bound` for one end of the line of a capsule, 0 or 1 [m]."""
    link, point = capsule.link, capsule.ends[end]
    if link > arm.dof:
        link, point = arm.dof, tool_in_last_link(arm, point)
    if link <= joint:
        return 0.0
    if arm.is_prismatic[joint]:
        return 1.0
    row = link - 1
    if row == joint:
        return math.hypot(point[0], point[1])
    # The last offsets and the point, whose place to each other only the last joint changes; or
    # all but the point, and the point.
    a, across = abs(float(arm.dh[row, 1])), math.hypot(point[0], point[1])
    places = [(across, float(point[2]) + d) for d in _extremes(arm, 0.0, row)]
    last_d = max(math.hypot(*place) for place in places)
    last_a = max(math.sqrt(a * a + 2.0 * a * r + r * r + z * z) for r, z in places)
    return min(
        reach_bound(arm, 0.0, joint, row, 'd') + float(np.linalg.norm(point)),
        reach_bound(arm, 0.0, joint, row, 'a') + last_d,
        _before(arm, joint, row) + last_a,
    )


def _before(arm: ArmModel, joint: int, row: int) -> float:
    """Return `reach_bound` for the point where the `a` offset of a row begins [m]."""
    return reach_bound(arm, 0.0, joint, row - 1, 'd')


def _group_norm(
    arm: ArmModel, ray_length: float, group: Offsets, *, is_first: bool
) -> float | None:
    """Return the norm of neighbouring offsets (the first ones: across the axis) or None."""
    kinds = ''.join(kind for _, kind in group)
    row = group[0][0]
    alphas, lengths = arm.dh[:, 0], arm.dh[:, 1]
    if kinds == 'a':
        return abs(float(lengths[row]))
    if kinds == 'd':
        return max(abs(d) for d in _extremes(arm, ray_length, row))
    if kinds == 'ad':
        # x(i-1) is square to z(i); only the part of d square to the joint's own axis counts.
        tilt = abs(math.sin(alphas[row])) if is_first else 1.0
        return max(math.hypot(lengths[row], d * tilt) for d in _extremes(arm, ray_length, row))
    if kinds == 'da':
        return max(math.hypot(d, lengths[row + 1]) for d in _extremes(arm, ray_length, row))
    if kinds == 'dad':
        # z(i) and z(i+1) enclose alpha(i+1), and x(i) is square to both. Convex in either d, so
        # the greatest value is at an end of its range.
        cosine = math.cos(alphas[row + 1])
        return max(
            math.sqrt(max(0.0, lengths[row + 1] ** 2 + d * d + e * e + 2.0 * d * e * cosine))
            for d in _extremes(arm, ray_length, row)
            for e in _extremes(arm, ray_length, row + 1)
        )
    return None


def _extremes(arm: ArmModel, ray_length: float, row: int) -> tuple[float, ...]:
    """Return the least and greatest d of a row [m]."""
    if row == arm.dof:
        return (ray_length,)
    d = float(arm.dh[row, 3])
    if arm.is_prismatic[row]:
        low, high = start_bounds(arm)[:, row].tolist()
        return (d + low, d + high)
    return (d,)


@functools.lru_cache(maxsize=16)
def reach_table(arm: ArmModel, ray_length: float) -> Array:
    """
    Return `reach_bound` for both ends of every bar and every joint, (n_bars, 2, dof) [m].

    Bars as in `arm.bars_of`, and those of the mount after them.
    """
    bars = (*bars_of(arm), *mount_bars(arm))
    table = np.array([_bar_reach(arm, ray_length, bar) for bar in bars])
    table.setflags(write=False)
    return table


def _bar_reach(arm: ArmModel, ray_length: float, bar: Bar) -> list[list[float]]:
    joints = range(arm.dof)
    if isinstance(bar.source, Capsule):
        return [[capsule_reach(arm, j, bar.source, end) for j in joints] for end in (0, 1)]
    row, end = bar.source
    before = (row - 1, 'd') if end == 'a' else (row, 'a')
    return [[reach_bound(arm, ray_length, j, *at) for j in joints] for at in (before, (row, end))]
