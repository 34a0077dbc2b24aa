# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm that a chain of a URDF is."""

from dataclasses import dataclass, replace

import numpy as np
from rrth_planner.io.urdf.chain import UrdfChain
from rrth_planner.io.urdf.dh_parameters import rows_of_axes
from rrth_planner.io.urdf.link_radii import cover_radii
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError

# Configurations at which an arm is compared with its URDF.
N_COMPARED = 50


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ImportedArm:
    """
    An arm and where it comes from.

    Parameters
    ----------
    arm : ArmModel
    chain : UrdfChain
    T_base_link : ndarray, shape (4, 4)
        Pose of the chain's first link in the wearer's base frame [m].
    ray_lead : float
        How far the arm's ray begins before the tool's origin, on the same line [m]; negative: so
        far beyond it, and the radii make up for that.
    radius : float
        Of the links [m]; the arm's radii are greater where its bars do not follow the links.

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


def import_chain(chain: UrdfChain, T_base_link: Array, radius: float) -> ImportedArm:
    """
    Return the arm of a chain.

    Parameters
    ----------
    chain : UrdfChain
    T_base_link : ndarray, shape (4, 4)
        Where the wearer wears its first link: pose in the base frame [m].
    radius : float
        Of the links, >= 0 [m].

    Raises
    ------
    ModelError
        A radius or a pose that is none.

    """
    if not 0.0 <= radius < np.inf:
        raise ModelError(f'radius: {radius}, expected a length >= 0 [m]')
    rows = rows_of_axes(chain.points, chain.directions, chain.x_first)
    arm = ArmModel(
        joint_names=chain.joint_names,
        is_prismatic=chain.is_prismatic,
        dh=rows.dh,
        bounds=chain.bounds,
        radii=np.full(len(rows.dh), radius),
        T_base_mount=T_base_link @ rows.T_0,
    )
    points = chain.points @ T_base_link[:3, :3].T + T_base_link[:3, 3]
    return ImportedArm(
        arm=replace(arm, radii=cover_radii(arm, points, radius)),
        chain=chain,
        T_base_link=T_base_link,
        ray_lead=rows.ray_lead,
        radius=radius,
    )
