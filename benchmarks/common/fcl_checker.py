# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What python-fcl says of a motion, asked instant by instant: nothing shared with the planner."""

import fcl
import numpy as np
from rrth_planner.collision.reference_checker import bars
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene

# Between two instants [s].
SAMPLE_PERIOD = 1e-3
# The library is not asked about what is further apart than this on top of the margin [m].
FAR = 0.02
# Bars are asked about as capsules this thin, their radius taken off: of thick ones the library
# overestimates the distance by up to half a millimetre [m].
THIN = 1e-6


def least_distance(
    arm: ArmModel, scene: Scene, q: Array, ray_length: float, margin: float
) -> float:
    """
    Return the least distance of the arm from the wearer by python-fcl.

    Parameters
    ----------
    arm : ArmModel
        Of revolute joints.
    scene : Scene
    q : ndarray, shape (n, dof)
        The instants [rad].
    ray_length : float
        How much of the ray counts as arm [m].
    margin : float
        What is clearly further apart is not checked [m].

    Returns
    -------
    float
        Infinite where nothing came near [m].

    """
    ends, radii = bars(arm, q, ray_length), np.repeat(arm.radii[1:], 2)
    boxes = [
        fcl.CollisionObject(fcl.Box(*box.size), fcl.Transform(box.rotation, box.center))
        for box in scene.boxes
    ]
    least = np.inf
    for k, radius in enumerate(radii):
        lengths = np.linalg.norm(ends[:, k, 1] - ends[:, k, 0], axis=1)
        # A bar of no length is the end of its neighbour.
        if lengths.max() < THIN:
            continue
        capsule = fcl.CollisionObject(fcl.Capsule(THIN, float(lengths[0])))
        centers, rotations = ends[:, k].mean(axis=1), _along_z(ends[:, k, 1] - ends[:, k, 0])
        for i, near in enumerate(_near(ends[:, k], scene, radius + margin + FAR)):
            if not near.any():
                continue
            capsule.setRotation(rotations[i])
            capsule.setTranslation(centers[i])
            for j in np.flatnonzero(near):
                least = min(least, fcl.distance(capsule, boxes[j]) + THIN - radius)
    return float(least)


def _near(ends: Array, scene: Scene, distance: float) -> Array:
    """
    Return which boxes may be this near to a bar, (n, 2, 3) -> (n, m).

    A face of a box whose plane is further away than that from both ends parts them.
    """
    flags = []
    for box in scene.boxes:
        local = (ends - box.center) @ box.rotation
        half = 0.5 * box.size + distance
        flags.append(~((local > half).all(axis=1) | (local < -half).all(axis=1)).any(axis=1))
    return np.stack(flags, axis=1)


def _along_z(directions: Array) -> Array:
    """Return rotations whose z axis points along some directions, (n, 3) -> (n, 3, 3)."""
    z = directions / np.linalg.norm(directions, axis=1)[:, None]
    # The axis of space that is most square to z.
    other = np.eye(3)[np.abs(z).argmin(axis=1)]
    x = np.cross(other, z)
    x /= np.linalg.norm(x, axis=1)[:, None]
    return np.stack([x, np.cross(z, x), z], axis=2)
