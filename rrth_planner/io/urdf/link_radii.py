# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How thick the bars of DH rows must be to enclose the links that they stand for."""

import math

import numpy as np
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array

# Number of sampled points of a link; radii are rounded up to this [m].
POINTS, STEP = 1025, 1e-4


def cover_radii(arm: ArmModel, points: Array, radius: float) -> Array:
    """
    Return the radii with which the bars enclose the links.

    Bars follow common normals and axes; a link need not. It is taken as a bar of some radius from
    each joint straight to the next, and on to where the ray begins.

    Parameters
    ----------
    arm : ArmModel
    points : ndarray, shape (dof + 1, 3)
        Where the joints are with all positions at 0, and the beginning of the ray, in the frame
        that `T_base_mount` leads to [m].
    radius : float
        Of the links [m].

    Returns
    -------
    ndarray, shape (dof + 1,)
        A radius for the bars of each row, the link's own where they lie on it [m].

    """
    T = forward_kinematics(arm, np.zeros(arm.dof))
    extra = np.zeros(arm.dof + 1)
    _, a, _, d = arm.dh.T
    has_bar = (a != 0.0) | (d != 0.0) | np.array([*arm.is_prismatic, False])
    for i in range(arm.dof):
        begin, end = (points[i : i + 2] - T[i, :3, 3]) @ T[i, :3, :3]
        share = np.linspace(0.0, 1.0, POINTS)[:, None]
        link = begin + share * (end - begin)
        distances = [_distances(link, *bar) for bar in _bars(arm, i, end)]
        farthest = float(np.min(distances, axis=0).max())
        if farthest < 1e-9:
            continue
        # No point of the link is farther from a sample than half their spacing.
        farthest += 0.5 * float(np.linalg.norm(end - begin)) / (POINTS - 1)
        rows = {i, i + 1}
        # Where neither row has a bar, the last one before ends there.
        rows.update(np.flatnonzero(has_bar[: i + 1])[-1:].tolist())
        for row in rows:
            extra[row] = max(extra[row], STEP * math.ceil(farthest / STEP))
    return np.asarray(np.round(radius + extra, 6))


def _bars(arm: ArmModel, i: int, tip: Array) -> list[tuple[Array, Array]]:
    """Return the bars next to link i as they are shortest, in its frame."""
    alpha, a, _, _ = arm.dh[i + 1]
    zero, corner = np.zeros(3), np.array([a, 0.0, 0.0])
    outwards = np.array([0.0, -math.sin(alpha), math.cos(alpha)])
    behind = _shortest(arm, i)
    if i + 1 < arm.dof:
        ahead = _shortest(arm, i + 1)
    else:
        # As much of the ray as there is of the tool.
        ahead = max(0.0, float((tip - corner) @ outwards))
    return [
        (np.array([0.0, 0.0, -behind]), zero),
        (zero, corner),
        (corner, corner + ahead * outwards),
    ]


def _shortest(arm: ArmModel, row: int) -> float:
    """Return the `d` of a row when its bar is shortest: longer ones contain it."""
    d = float(arm.dh[row, 3])
    if not arm.is_prismatic[row]:
        return d
    return d + float(np.clip(-d, *arm.bounds[:, row]))


def _distances(points: Array, begin: Array, end: Array) -> Array:
    """Return the distances of points, (n, 3), from the line between two others, (n,) [m]."""
    along = end - begin
    share = np.clip((points - begin) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - begin - share[:, None] * along, axis=1))
