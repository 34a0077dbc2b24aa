# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is drawn at random: configurations, edges, wearers, targets."""

import numpy as np
from rrth_planner.collision.world import World
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene


def free_configurations(rng: np.random.Generator, world: World, n: int) -> Array:
    """Return some free configurations, (n, dof) [rad]."""
    found: list[Array] = []
    while len(found) < n:
        found.extend(
            q for q in rng.uniform(*world.bounds, (n, len(world.bounds[0]))) if world.is_valid(q)
        )
    return np.array(found[:n])


def random_edges(
    rng: np.random.Generator, world: World, starts: Array, lengths: Array
) -> tuple[Array, Array]:
    """
    Return edges into random directions that stay within the limits.

    Parameters
    ----------
    rng : numpy.random.Generator
    world : World
    starts : ndarray, shape (n, dof)
        [rad].
    lengths : ndarray, shape (n,)
        [rad].

    """
    directions = rng.standard_normal(starts.shape)
    ends = starts + directions * (lengths / np.linalg.norm(directions, axis=1))[:, None]
    is_inside = ((ends >= world.bounds[0]) & (ends <= world.bounds[1])).all(axis=1)
    return starts[is_inside], ends[is_inside]


def random_target(rng: np.random.Generator) -> Array:
    """Return a point 0.7 to 4 m from the centre of the torso, in any direction [m]."""
    direction = rng.standard_normal(3)
    target: Array = rng.uniform(0.7, 4.0) * direction / np.linalg.norm(direction)
    return target


def random_wearer(rng: np.random.Generator) -> Scene:
    """Return a wearer of another build and posture: limbs raised and bent, the head turned."""
    boxes = []

    def add(name: str, center: Array, size: tuple[float, ...], rotation: Array) -> None:
        center = center + rng.uniform(-0.01, 0.01, 3)
        boxes.append(Box(name, center, np.array(size) * rng.uniform(0.9, 1.15, 3), rotation))

    add('torso', np.zeros(3), (0.3, 0.46, 0.6), _turn(2, rng.uniform(-0.1, 0.1)))
    nod = _turn(2, rng.uniform(-1.0, 1.0)) @ _turn(1, rng.uniform(-0.3, 0.5))
    add('head', np.array([0.02, 0.0, 0.45]), (0.26, 0.24, 0.3), nod)
    for side, word in ((-1.0, 'right'), (1.0, 'left')):
        # A limb at rest hangs along -z.
        upper = _turn(0, side * rng.uniform(0.0, 1.4)) @ _turn(1, -rng.uniform(-0.3, 2.6))
        fore = upper @ _turn(1, -rng.uniform(0.1, 2.2))
        thigh = _turn(1, -rng.uniform(0.0, 1.5))
        shoulder, hip = np.array([0.0, side * 0.3, 0.24]), np.array([0.04, side * 0.12, -0.3])
        elbow = shoulder - 0.32 * upper[:, 2]
        add(f'upper_arm_{word}', shoulder - 0.16 * upper[:, 2], (0.16, 0.16, 0.38), upper)
        add(f'forearm_{word}', elbow - 0.17 * fore[:, 2], (0.13, 0.13, 0.4), fore)
        add(f'thigh_{word}', hip - 0.28 * thigh[:, 2], (0.22, 0.21, 0.56), thigh)
    return Scene(tuple(boxes))


def split_boxes(scene: Scene, per_axis: int) -> Scene:
    """Return the same wearer, each box cut into equal parts, per_axis along each of its axes."""
    ratios = (np.arange(per_axis) + 0.5) / per_axis - 0.5
    grid = np.stack(np.meshgrid(ratios, ratios, ratios), axis=-1).reshape(-1, 3)
    return Scene(
        tuple(
            Box(
                f'{box.name}_{k}',
                box.center + box.rotation @ (at * box.size),
                box.size / per_axis,
                box.rotation,
            )
            for box in scene.boxes
            for k, at in enumerate(grid)
        )
    )


def _turn(axis: int, angle: float) -> Array:
    """Return the rotation about x, y or z (0, 1, 2) by an angle [rad], shape (3, 3)."""
    quaternion = np.zeros(4)
    quaternion[axis], quaternion[3] = np.sin(0.5 * angle), np.cos(0.5 * angle)
    return rotation_matrix(quaternion)
