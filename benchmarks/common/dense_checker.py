# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
A dense check of many edges, compiled, for an arm of revolute joints.

Nothing is shared with the kernels: frames are multiplied out, bars are clipped by the slabs of the
boxes, and the distance of two bars is that of their ends from the other bar, or of their lines. An
interval of an edge is passed at once where the arm at its middle does not collide with the boxes
grown by the most that any of its points moves until the ends.
"""

from dataclasses import dataclass

from numba import njit
import numpy as np
from rrth_planner.model.arm import ArmModel, NO_BARS
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene


@dataclass(frozen=True, slots=True, eq=False)
class Bars:
    """
    The moving bars of an arm, and the capsules of its mount, each in a frame.

    Parameters
    ----------
    frames : ndarray of int, shape (n,)
        0: that of the mount, i: that which joint i moves; the tool's row has one of its own.
    ends : ndarray, shape (n, 2, 3)
        In that frame [m].
    radii : ndarray, shape (n,)
        [m].
    bodies : ndarray of int, shape (n,)
        How many joints move it.
    names : tuple of str
        Of capsules; empty for other bars.

    """

    frames: Array
    ends: Array
    radii: Array
    bodies: Array
    names: tuple[str, ...]


def bars_in_frames(arm: ArmModel, ray_length: float) -> Bars:
    """Return the bars of an arm of revolute joints; the last one is the pointing ray."""
    assert not any(arm.is_prismatic)
    found = [(c.link, c.ends, c.radius, c.name) for c in arm.capsules]
    for row in range(1, arm.dof + 1):
        radius, (_, a, _, d) = float(arm.radii[row]), arm.dh[row]
        is_ray = row == arm.dof
        if radius != NO_BARS and a != 0.0:
            found.append((row, np.array([[0.0, 0.0, 0.0], [a, 0.0, 0.0]]), radius, ''))
        if is_ray:
            line = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, ray_length]])
            found.append((row + 1, line, radius, ''))
        elif radius != NO_BARS and d != 0.0:
            found.append((row + 1, np.array([[0.0, 0.0, -d], [0.0, 0.0, 0.0]]), radius, ''))
    frames, ends, radii, names = zip(*found, strict=True)
    return Bars(
        frames=np.array(frames),
        ends=np.array(ends),
        radii=np.array(radii),
        bodies=np.minimum(frames, arm.dof),
        names=names,
    )


def colliding_edges(
    arm: ArmModel,
    scene: Scene,
    ray_length: float,
    margin: float,
    edges: tuple[Array, Array],
    spacing: float,
    pairs: Array | None = None,
) -> Array:
    """
    Return which edges collide with a box, or the arm with itself, at any of their samples, (n,).

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
    pairs : ndarray of int, shape (m, 2), optional
        Of `bars_in_frames`, which must not collide.

    """
    bars = bars_in_frames(arm, ray_length)
    reach = float(np.abs(arm.dh[1:, [1, 3]]).sum() + np.linalg.norm(bars.ends, axis=2).max())
    flags = np.zeros(len(edges[0]), dtype=np.bool_)
    _check(
        arm.dh,
        arm.T_base_mount,
        bars.frames,
        bars.ends,
        bars.radii,
        bars.bodies,
        np.empty((0, 2), np.int64) if pairs is None else pairs,
        reach,
        np.array([box.center for box in scene.boxes]).reshape(-1, 3),
        np.array([box.rotation for box in scene.boxes]).reshape(-1, 3, 3),
        np.array([0.5 * box.size + margin for box in scene.boxes]).reshape(-1, 3),
        np.ascontiguousarray(edges[0]),
        np.ascontiguousarray(edges[1]),
        spacing,
        flags,
    )
    return flags


# Loops, not expressions of whole arrays: those take many times as long to compile.
@njit(nogil=True, cache=True)
def _check(
    dh, T, frames, ends, radii, bodies, pairs, reach, centers, rotations, halves, q0, q1, spacing,
    flags,
):  # fmt: skip
    stack = np.empty((128, 2), np.int64)
    placed, speeds = np.empty((frames.shape[0], 2, 3)), np.empty(dh.shape[0])
    dof = q0.shape[1]
    step, q, room = np.empty(dof), np.empty(dof), np.empty((3, 3, 3))
    for e in range(q0.shape[0]):
        square = 0.0
        for i in range(dof):
            step[i] = q1[e, i] - q0[e, i]
            square += step[i] * step[i]
        n = max(1, int(np.ceil(np.sqrt(square) / spacing)))
        # No point moves faster than the farthest one would round every axis below it at once.
        speeds[0] = 0.0
        for i in range(dof):
            speeds[i + 1] = speeds[i] + reach * abs(step[i]) / n
        size, stack[0, 0], stack[0, 1] = 1, 0, n
        while size > 0 and not flags[e]:
            size -= 1
            first, last = stack[size, 0], stack[size, 1]
            middle = (first + last) // 2
            length = max(last - middle, middle - first)
            for i in range(dof):
                q[i] = q0[e, i] + middle / n * step[i]
            _place(dh, T, frames, ends, q, placed, room)
            is_free = True
            for k in range(frames.shape[0]):
                # What no joint moves is worn.
                if bodies[k] > 0:
                    growth = radii[k] + length * speeds[bodies[k]]
                    if _bar_collides(
                        placed[k, 0], placed[k, 1], growth, centers, rotations, halves
                    ):
                        is_free = False
                        break
            if is_free:
                for m in range(pairs.shape[0]):
                    i, j = pairs[m, 0], pairs[m, 1]
                    # Only the joints between them move one bar to the other.
                    moved = length * abs(speeds[bodies[j]] - speeds[bodies[i]])
                    if _distance(placed[i], placed[j]) <= radii[i] + radii[j] + moved:
                        is_free = False
                        break
            if is_free:
                continue
            if first == last:
                flags[e] = True
                break
            stack[size, 0], stack[size, 1] = first, middle
            stack[size + 1, 0], stack[size + 1, 1] = middle + 1, last
            size += 2


@njit(nogil=True, cache=True)
def _place(dh, T, frames, ends, q, placed, room):
    dof = q.shape[0]
    R, turned, p = room[0], room[1], room[2, 0]
    for r in range(3):
        p[r] = T[r, 3]
        for c in range(3):
            R[r, c] = T[r, c]
    for i in range(dof + 2):
        for k in range(frames.shape[0]):
            if frames[k] == i:
                for end in range(2):
                    for r in range(3):
                        placed[k, end, r] = p[r]
                        for c in range(3):
                            placed[k, end, r] += R[r, c] * ends[k, end, c]
        if i > dof:
            break
        alpha, a = dh[i, 0], dh[i, 1]
        theta = dh[i, 2] + (q[i] if i < dof else 0.0)
        d = dh[i, 3]
        ca, sa, ct, st = np.cos(alpha), np.sin(alpha), np.cos(theta), np.sin(theta)
        for r in range(3):
            y, z = ca * R[r, 1] + sa * R[r, 2], ca * R[r, 2] - sa * R[r, 1]
            p[r] += a * R[r, 0] + d * z
            turned[r, 0], turned[r, 1] = ct * R[r, 0] + st * y, ct * y - st * R[r, 0]
            turned[r, 2] = z
        for r in range(3):
            for c in range(3):
                R[r, c] = turned[r, c]


@njit(nogil=True, cache=True)
def _distance(one, other):
    least = min(
        min(_to_line(one[0], other[0], other[1]), _to_line(one[1], other[0], other[1])),
        min(_to_line(other[0], one[0], one[1]), _to_line(other[1], one[0], one[1])),
    )
    # The lines are nearest between the ends of both, or an end is what is nearest.
    square, s, t, across = 0.0, 0.0, 0.0, 0.0
    for r in range(3):
        i, j = (r + 1) % 3, (r + 2) % 3
        ui, uj = one[1, i] - one[0, i], one[1, j] - one[0, j]
        vi, vj = other[1, i] - other[0, i], other[1, j] - other[0, j]
        wi, wj = one[0, i] - other[0, i], one[0, j] - other[0, j]
        normal = ui * vj - uj * vi
        square += normal * normal
        s -= (wi * vj - wj * vi) * normal
        t -= (wi * uj - wj * ui) * normal
        across += (one[0, r] - other[0, r]) * normal
    if square > 1e-18 and 0.0 <= s <= square and 0.0 <= t <= square:
        least = min(least, abs(across) / np.sqrt(square))
    return least


@njit(nogil=True, cache=True)
def _to_line(point, begin, end):
    square, along = 0.0, 0.0
    for r in range(3):
        square += (end[r] - begin[r]) ** 2
        along += (point[r] - begin[r]) * (end[r] - begin[r])
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    gap = 0.0
    for r in range(3):
        gap += (point[r] - begin[r] - share * (end[r] - begin[r])) ** 2
    return np.sqrt(gap)


@njit(nogil=True, cache=True)
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
