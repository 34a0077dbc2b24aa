# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm that a chain of a URDF is, its bars thick enough to enclose the links."""

from dataclasses import dataclass, replace
import math

import numpy as np
from rrth_planner.io.arm_file import MAX_TURNS, turn_bounds
from rrth_planner.io.urdf.capsules import line_distances
from rrth_planner.io.urdf.chain import UrdfChain
from rrth_planner.io.urdf.dh_parameters import rows_of_axes
from rrth_planner.model.arm import ArmModel, Capsule, forward_kinematics, NO_BARS, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError

# Configurations at which an arm is compared with its URDF.
N_COMPARED = 50
# Number of sampled points of a link; radii are rounded up to this [m].
POINTS, STEP = 1025, 1e-4


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ImportedArm:
    """
    An arm and where it comes from.

    Parameters
    ----------
    T_base_link : ndarray, shape (4, 4)
        Pose of the chain's first link in the wearer's base frame [m].
    ray_lead : float
        How far the arm's ray begins before the tool's origin, on the same line [m]; negative: so
        far beyond it, and the radii make up for that.
    radius : float
        Of the links, >= 0 [m]; the arm's radii are greater where its bars do not follow the links.

    """

    arm: ArmModel
    chain: UrdfChain
    T_base_link: Array
    ray_lead: float
    radius: float

    def ray_at(self, q: Array) -> tuple[Array, Array]:
        """Return the tool's origin and the ray's direction in the base frame, by the arm [m]."""
        T = tool_pose(self.arm, q)
        return T[:3, 3] + self.ray_lead * T[:3, 2], T[:3, 2]

    def urdf_ray_at(self, q: Array) -> tuple[Array, Array]:
        """Return the same by the URDF's own kinematics."""
        T = self.T_base_link @ self.chain.tool_pose(q)
        return T[:3, 3], T[:3, :3] @ self.chain.ray

    def deviation(self) -> tuple[float, float]:
        """Return the greatest differences between both, of position [m] and direction [rad]."""
        rng = np.random.default_rng(0)
        found = []
        low, high = self.arm.bounds
        for q in rng.uniform(low, high, (N_COMPARED, self.arm.dof)):
            (p, z), (p_urdf, z_urdf) = self.ray_at(q), self.urdf_ray_at(q)
            found.append((np.linalg.norm(p - p_urdf), np.linalg.norm(z - z_urdf)))
        far, tilt = np.max(found, axis=0)
        return float(far), float(tilt)


def import_chain(
    chain: UrdfChain, T_base_link: Array, radius: float, max_turns: float = MAX_TURNS
) -> ImportedArm:
    """
    Return the arm of a chain; T_base_link, shape (4, 4), and radius [m] as in `ImportedArm`.

    max_turns: how often continuous joints may turn, either way from 0.

    Raises
    ------
    ModelError
        A radius that is negative or not finite, a pose that is none, or no number of turns.

    """
    if not 0.0 <= radius < np.inf:
        raise ModelError(f'radius: {radius}, expected a length >= 0 [m]')
    is_continuous = tuple(joint.type == 'continuous' for joint in chain.moving)
    T_0, dh, ray_lead = rows_of_axes(chain.points, chain.directions, chain.x_first)
    arm = ArmModel(
        joint_names=tuple(joint.name for joint in chain.moving),
        is_prismatic=tuple(joint.type == 'prismatic' for joint in chain.moving),
        dh=dh,
        bounds=np.where(is_continuous, turn_bounds(max_turns), chain.bounds),
        radii=np.full(len(dh), radius),
        T_base_mount=T_base_link @ T_0,
        is_continuous=is_continuous,
    )
    points = chain.points @ T_base_link[:3, :3].T + T_base_link[:3, 3]
    return ImportedArm(
        arm=replace(arm, radii=_cover_radii(arm, points, radius)),
        chain=chain,
        T_base_link=T_base_link,
        ray_lead=ray_lead,
        radius=radius,
    )


def with_ray_radius(found: ImportedArm, radius: float) -> ImportedArm:
    """Return an arm whose pointing ray has another radius [m], or raise ModelError."""
    if not 0.0 <= radius < np.inf:
        raise ModelError(f'ray radius: {radius}, expected a length >= 0 [m]')
    radii = np.array([*found.arm.radii[:-1], radius])
    return replace(found, arm=replace(found.arm, radii=radii))


def with_capsules(
    found: ImportedArm, capsules: tuple[Capsule, ...], ray_radius: float
) -> ImportedArm:
    """Return an arm made of capsules instead of bars, but for its ray, of a radius [m]."""
    bare = replace(found.arm, radii=np.array([*np.full(found.arm.dof, NO_BARS), 0.0]))
    fleshed = replace(found, arm=replace(bare, capsules=capsules))
    return with_ray_radius(fleshed, ray_radius)


def _cover_radii(arm: ArmModel, points: Array, radius: float) -> Array:
    """
    Return the radii with which the bars enclose the links.

    Bars follow common normals and axes; a link need not. It is taken as a bar of some radius from
    each joint straight to the next, and on to where the ray begins.

    Parameters
    ----------
    points : ndarray, shape (dof + 1, 3)
        Where the joints are with all positions at 0, and the beginning of the ray, in the frame
        that `T_base_mount` leads to [m].

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
        distances = [line_distances(link, bar) for bar in _bars(arm, i, end)]
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


def _bars(arm: ArmModel, i: int, tip: Array) -> Array:
    """Return the bars next to link i as they are shortest, in its frame, (3, 2, 3) [m]."""
    alpha, a, _, _ = arm.dh[i + 1]
    zero, corner = np.zeros(3), np.array([a, 0.0, 0.0])
    outwards = np.array([0.0, -math.sin(alpha), math.cos(alpha)])
    behind = _shortest(arm, i)
    if i + 1 < arm.dof:
        ahead = _shortest(arm, i + 1)
    else:
        # As much of the ray as there is of the tool.
        ahead = max(0.0, float((tip - corner) @ outwards))
    return np.array(
        [[[0.0, 0.0, -behind], zero], [zero, corner], [corner, corner + ahead * outwards]]
    )


def _shortest(arm: ArmModel, row: int) -> float:
    """Return the `d` of a row when its bar is shortest: longer ones contain it."""
    d = float(arm.dh[row, 3])
    if not arm.is_prismatic[row]:
        return d
    return d + float(np.clip(-d, *arm.bounds[:, row]))
