# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
A dense check of many edges, compiled, for an arm of revolute joints.

Nothing is shared with the kernels: frames are multiplied out, bars are clipped by the slabs of the
boxes. An interval of an edge is passed at once where the arm at its middle does not collide with
the boxes grown by the most that any of its points moves until the ends.
"""

from numba import njit
import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene


def colliding_edges(
    arm: ArmModel,
    scene: Scene,
    ray_length: float,
    margin: float,
    edges: tuple[Array, Array],
    spacing: float,
) -> Array:
    """
    Return which edges collide with a box at any of their samples, shape (n,).

    Parameters
    ----------
    arm : ArmModel
        Of revolute joints.
    scene : Scene
    ray_length : float
        How much of the pointing ray counts as arm [m].
    margin : float
        Growth of each box on every side [m].
    edges : tuple of ndarray, shape (n, dof)
        Starts and ends [rad].
    spacing : float
        Between two instants [rad].

    """
    assert not any(arm.is_prismatic)
    reach = float(np.abs(arm.dh[1:, [1, 3]]).sum() + ray_length)
    flags = np.zeros(len(edges[0]), dtype=np.bool_)
    _check(
        arm.dh,
        arm.T_base_mount,
        ray_length,
        arm.radii,
        reach,
        np.array([box.center for box in scene.boxes]),
        np.array([box.rotation for box in scene.boxes]),
        np.array([0.5 * box.size + margin for box in scene.boxes]),
        np.ascontiguousarray(edges[0]),
        np.ascontiguousarray(edges[1]),
        spacing,
        flags,
    )
    return flags


@njit(nogil=True)
def _check(dh, T, ray, radii, reach, centers, rotations, halves, starts, ends, spacing, flags):
    stack = np.empty((128, 2), np.int64)
    for e in range(starts.shape[0]):
        step = ends[e] - starts[e]
        n = max(1, int(np.ceil(np.sqrt((step * step).sum()) / spacing)))
        # No point moves faster than the farthest one would round every axis at once.
        speed = reach * np.abs(step).sum() / n
        size, stack[0, 0], stack[0, 1] = 1, 0, n
        while size > 0 and not flags[e]:
            size -= 1
            first, last = stack[size, 0], stack[size, 1]
            middle = (first + last) // 2
            q = starts[e] + middle / n * step
            growth = speed * max(last - middle, middle - first)
            if not _collides(dh, T, ray, radii, centers, rotations, halves, q, growth):
                continue
            if first == last:
                flags[e] = True
                break
            stack[size, 0], stack[size, 1] = first, middle
            stack[size + 1, 0], stack[size + 1, 1] = middle + 1, last
            size += 2


@njit(nogil=True)
def _collides(dh, T, ray, radii, centers, rotations, halves, q, growth):
    dof = q.shape[0]
    R, p = T[:3, :3].copy(), T[:3, 3].copy()
    turned, corner, end = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(dof + 1):
        alpha, a = dh[i, 0], dh[i, 1]
        theta = dh[i, 2] + (q[i] if i < dof else 0.0)
        d = dh[i, 3] if i < dof else ray
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
        for r in range(3):
            y, z = ca * R[r, 1] + sa * R[r, 2], ca * R[r, 2] - sa * R[r, 1]
            corner[r] = p[r] + a * R[r, 0]
            turned[r, 0], turned[r, 1] = ct * R[r, 0] + st * y, ct * y - st * R[r, 0]
            turned[r, 2] = z
            end[r] = corner[r] + d * z
        # The bars before the first joint are the mount's.
        if i > 0:
            if a != 0.0 and _bar_collides(
                p, corner, radii[i] + growth, centers, rotations, halves
            ):
                return True
            if _bar_collides(corner, end, radii[i] + growth, centers, rotations, halves):
                return True
        R[:] = turned
        p[:] = end
    return False


@njit(nogil=True)
def _bar_collides(first, last, growth, centers, rotations, halves):
    for j in range(centers.shape[0]):
        enter, leave = 0.0, 1.0
        for axis in range(3):
            at, step = 0.0, 0.0
            for r in range(3):
                at += (first[r] - centers[j, r]) * rotations[j, r, axis]
                step += (last[r] - first[r]) * rotations[j, r, axis]
            half = halves[j, axis] + growth
            if step == 0.0:
                if abs(at) > half:
                    enter = 2.0
            else:
                s, t = (-half - at) / step, (half - at) / step
                enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
            if enter > leave:
                break
        if enter <= leave:
            return True
    return False
