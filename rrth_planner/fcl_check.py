# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The second opinion: the same trajectory judged by the Flexible Collision Library."""

from dataclasses import dataclass

import fcl
import numpy as np
from rrth_planner.arm import ArmModel, forward_kinematics
from rrth_planner.arrays import Array
from rrth_planner.reach import bar_ends, bar_names, reach_table
from rrth_planner.scene import Scene
from rrth_planner.trajectory import sample, Trajectory

# Shortest time between two looks [s]; they are longer where the distance allows it.
PERIOD = 0.001
# Bars become capsules this thin, and their radius is taken off the distance: of thick ones the
# library overestimates it by up to half a millimetre. Then it is good to a few micrometres, rarely
# worse, so a look comes this much earlier than the distance allows [m].
THINNEST, TOLERANCE, EARLIER = 1e-6, 3e-6, 1e-3


@dataclass(frozen=True, slots=True)
class Touch:
    """
    Where a trajectory comes nearer to the wearer than the margin.

    Parameters
    ----------
    time : float
        [s].
    distance : float
        From the body itself [m].
    bar, box : str
        Which part of the arm, which box.

    """

    time: float
    distance: float
    bar: str
    box: str


class _Body:
    """The boxes of a scene and the capsules of an arm as objects of the library."""

    def __init__(self, arm: ArmModel, scene: Scene) -> None:
        self.arm, self.bars, self.names = arm, bar_ends(arm), bar_names(arm)
        self.radii = [float(arm.radii[row]) for row, _ in self.bars]
        # Each object carries its geometry's identity, by which a result names the box.
        geometries = [fcl.Box(*box.size) for box in scene.boxes]
        self.box_of = {
            id(geometry): box.name for geometry, box in zip(geometries, scene.boxes, strict=True)
        }
        self.boxes = fcl.DynamicAABBTreeCollisionManager()
        self.objects = [
            fcl.CollisionObject(geometry, fcl.Transform(box.rotation, box.center))
            for geometry, box in zip(geometries, scene.boxes, strict=True)
        ]
        self.boxes.registerObjects(self.objects)
        self.boxes.setup()
        self.geometries = geometries
        self.capsules: dict[int, tuple[float, fcl.CollisionObject]] = {}

    def nearest(self, k: int, poses: Array, length: float) -> tuple[float, str]:
        """
        Return the distance of bar k from the nearest box [m], and that box.

        poses (dof + 1, 4, 4): the frames of the arm; length: that of the bar [m].
        """
        row, end = self.bars[k]
        # A capsule lies along its own z, centred. `a` leads along x of the frame before; `d` ends
        # at its frame's origin, but the ray begins there.
        pose = poses[row] if end == 'd' else poses[row - 1]
        rotation = pose[:3, :3] if end == 'd' else pose[:3, [1, 2, 0]]
        ahead = 0.5 * length if end == 'a' or row == self.arm.dof else -0.5 * length
        capsule = self._capsule(k, abs(length))
        capsule.setTransform(fcl.Transform(rotation, pose[:3, 3] + ahead * rotation[:, 2]))
        data = fcl.DistanceData()
        self.boxes.distance(capsule, data, fcl.defaultDistanceCallback)
        found = data.result
        box = self.box_of.get(id(found.o1)) or self.box_of.get(id(found.o2), 'a box')
        return float(found.min_distance) + THINNEST - self.radii[k], box

    def length(self, k: int, q: Array, ray_length: float) -> float:
        """Return the signed length of bar k at q, shape (dof,) [m]."""
        row, end = self.bars[k]
        if row == self.arm.dof and end == 'd':
            return ray_length
        if end == 'a':
            return float(self.arm.dh[row, 1])
        return float(self.arm.dh[row, 3] + (q[row] if self.arm.is_prismatic[row] else 0.0))

    def _capsule(self, k: int, length: float) -> fcl.CollisionObject:
        """Return the object of bar k with a length [m]."""
        kept, capsule = self.capsules.get(k, (-1.0, None))
        if kept != length:
            capsule = fcl.CollisionObject(fcl.Capsule(THINNEST, length))
            self.capsules[k] = (length, capsule)
        return capsule


def nearest(arm: ArmModel, scene: Scene, q: Array, ray_length: float) -> Touch:
    """Return the part of the arm and the box that are closest at q, shape (dof,)."""
    body = _Body(arm, scene)
    poses = forward_kinematics(arm, q)
    looks = [
        (*body.nearest(k, poses, body.length(k, q, ray_length)), k) for k in range(len(body.bars))
    ]
    distance, box, k = min(looks, key=lambda look: look[0])
    return Touch(0.0, distance, body.names[k], box)


def first_touch(
    arm: ArmModel,
    scene: Scene,
    trajectory: Trajectory,
    margin: float,
    ray_guard_length: float,
    reach: float,
) -> Touch | None:
    """
    Return where a trajectory first comes nearer than the margin, or None.

    Conservative advancement: from one look to the next no point of the arm moves further than the
    distance seen, but a look comes at the latest after `PERIOD` where the arm passes close.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    trajectory : Trajectory
    margin : float
        Distance to keep from every box [m].
    ray_guard_length : float
        How much of the ray is guarded in motion [m].
    reach : float
        How much of it must be clear at the end [m].

    """
    body = _Body(arm, scene)
    n = max(2, int(np.ceil(trajectory.duration / PERIOD)) + 1)
    times = np.linspace(0.0, trajectory.duration, n)
    positions, velocities, _ = sample(trajectory, times)
    poses = forward_kinematics(arm, positions)
    reaches = reach_table(arm, ray_guard_length)
    touches = []
    for k in range(len(body.bars)):
        # Both ends of a bar bound the speed of all its points. Between two instants the speed may
        # be higher than at both: 5 % covers a quintic of 1 ms.
        speeds = np.abs(velocities) @ reaches[max(0, k - 1) : k + 1].max(axis=0)
        way = np.zeros(n)
        way[1:] = np.cumsum(1.05 * times[1] * np.maximum(speeds[:-1], speeds[1:]))
        i = 0
        while True:
            ray = max(ray_guard_length, reach) if i == n - 1 else ray_guard_length
            distance, box = body.nearest(k, poses[i], body.length(k, positions[i], ray))
            if distance < margin - TOLERANCE:
                touches.append(Touch(float(times[i]), distance, body.names[k], box))
                break
            if i == n - 1:
                break
            free = distance - margin - EARLIER
            ahead = int(np.searchsorted(way, way[i] + free, side='right')) - 1
            i = min(max(i + 1, ahead), n - 1)
    return min(touches, key=lambda touch: touch.time, default=None)
