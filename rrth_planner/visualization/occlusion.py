# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which parts of the arm the wearer hides from a distant camera."""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.reference_checker import bar_box_contact
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene

# Segments that a line is cut into; each is hidden or visible as a whole.
N_SEGMENTS = 40
FAR = 50.0
# A view along an axis would show no depth.
ELEVATIONS = np.radians([18.0, 24.0, 30.0])
AZIMUTHS = np.radians([q + a for q in (0.0, 90.0, 180.0, 270.0) for a in (25.0, 45.0, 65.0)])


def best_view(scene: Scene, outlines: Array, ray: Array) -> Array:
    """Return the direction to the camera that shows most of the arm and of the ray."""
    arm_points, ray_points = outlines.reshape(-1, 3), cut(ray).mean(axis=1)
    best, score = np.array([0.0, -1.0, 0.0]), -np.inf
    for elevation, azimuth in product(ELEVATIONS, AZIMUTHS):
        level = np.cos(elevation)
        towards = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        shown = 0.0
        for points, weight in ((arm_points, 1.2), (ray_points, 0.3)):
            across = points - np.outer(points @ towards, towards)
            spread = np.linalg.norm(across - across.mean(axis=0), axis=1).mean()
            shown += weight * spread - is_hidden(scene, points, towards).mean()
        if shown > score:
            best, score = towards, shown
    return best


def is_hidden(scene: Scene, points: Array, towards: Array) -> NDArray[np.bool_]:
    """Return which points, (n, 3), the wearer hides from a camera in some direction."""
    line = np.stack([points, points + FAR * towards], axis=1)
    hidden: NDArray[np.bool_] = np.zeros(len(points), dtype=bool)
    for box in scene.boxes:
        hidden |= bar_box_contact(line, box.center, box.rotation, 0.5 * box.size) > 0
    return hidden


def cut(points: Array) -> Array:
    """Return the short segments of a polyline, (n, 2, 3) [m]."""
    n = max(1, N_SEGMENTS // (len(points) - 1))
    t = np.linspace(0.0, 1.0, n + 1)[:, None]
    lines = points[:-1, None] + t * (points[1:, None] - points[:-1, None])
    return np.stack([lines[:, :-1], lines[:, 1:]], axis=2).reshape(-1, 2, 3)
