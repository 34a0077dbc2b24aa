# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Plan motions of real arms, and have pinocchio and coal judge the meshes of their URDFs.

python -m benchmarks.real_arms --robots FOLDER: the folder `robots` of example-robot-data.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
import sys
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from rrth_planner.collision.bar_pairs import pair_names, pairs_of
from rrth_planner.collision.world import arm_world
from rrth_planner.io.settings import load_settings
from rrth_planner.io.urdf.allowed_pairs import colliding_pairs
from rrth_planner.io.urdf.chain import read_chain
from rrth_planner.io.urdf.import_chain import import_chain, with_capsules
from rrth_planner.io.urdf.link_capsules import enclose_links
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.rotation import pose_matrix
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import positions_at, Trajectory
from rrth_planner.pipeline.plan_motion import plan_motion, warm_up

from benchmarks.common.random_draws import free_configurations, random_target
from benchmarks.real_arms.costs import costs
from benchmarks.real_arms.edges import count_colliding

MARGIN, RAY = 0.02, 0.5
# Between two instants that are judged [rad].
SPACING = 0.02
# No point of a mesh is further from an axis that moves it [m].
FARTHEST = 2.0
# File below the folder of robots, tool link and its ray.
ARMS = {
    'panda': ('panda_description/urdf/panda.urdf', 'panda_hand', '+z'),
    'z1': ('z1_description/urdf/z1.urdf', 'gripperStator', '+x'),
    'kinova': ('kinova_description/robots/kinova.urdf', 'j2s6s200_end_effector', '+z'),
    'xarm7': ('xarm_description/urdf/xarm7.urdf', 'link7', '+z'),
    'ur5': ('ur_description/urdf/ur5_robot.urdf', 'ee_link', '+x'),
}
# Where the first link is worn, in the wearer's base frame [m].
MOUNTS = {'back': (-0.42, 0.0, 0.25), 'chest': (0.42, 0.0, 0.1)}


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """An arm's own meshes in pinocchio, with the wearer's boxes beside them."""

    model: Any
    geometry: Any
    q: Array
    columns: tuple[tuple[int, int], ...]
    n_boxes: int

    def judge(self, trajectory: Trajectory) -> tuple[float, list[str]]:
        """Return the least distance of a mesh from a box [m], and which links collide."""
        length = np.abs(np.diff(trajectory.positions, axis=0)).sum(axis=1).sum()
        times = np.linspace(0.0, trajectory.duration, int(length / SPACING) + 2)
        data, shapes = self.model.createData(), pin.GeometryData(self.geometry)
        least, colliding, before = np.inf, set(), None
        # Lower bounds of the distances from boxes: what cannot be the least is not asked.
        bounds = np.full(self.n_boxes, -np.inf)
        for positions in positions_at(trajectory, times):
            if before is not None:
                bounds -= FARTHEST * np.abs(positions - before).sum()
            before, q = positions, self._values(positions)
            pin.updateGeometryPlacements(self.model, data, self.geometry, shapes, q)
            for k, pair in enumerate(self.geometry.collisionPairs):
                if k < self.n_boxes:
                    if bounds[k] < least:
                        bounds[k] = pin.computeDistance(self.geometry, shapes, k).min_distance
                        least = min(least, bounds[k])
                elif pin.computeCollision(self.geometry, shapes, k):
                    objects = self.geometry.geometryObjects
                    colliding.add(f'{objects[pair.first].name} and {objects[pair.second].name}')
        return float(least), sorted(colliding)

    def _values(self, positions: Array) -> Array:
        """Return pinocchio's values of all joints; a continuous one has its cosine and sine."""
        q = self.q.copy()
        for (column, width), position in zip(self.columns, positions, strict=True):
            q[column : column + width] = (
                position if width == 1 else (np.cos(position), np.sin(position))
            )
        return q


def arm_of(file: Path, tool: str, ray: str, mount: tuple[float, ...]) -> ArmModel:
    """Return an arm as read_urdf makes it."""
    T = pose_matrix(np.array(mount), np.array([0.0, 0.0, 0.0, 1.0]))
    found = import_chain(read_chain(file, None, tool, ray), T, 0.03)
    found = with_capsules(found, enclose_links(found).capsules, 0.0)
    return replace(found.arm, allowed=colliding_pairs(found.arm))


def judge_of(file: Path, arm: ArmModel, scene: Scene, mount: tuple[float, ...]) -> Judge:
    """Return the judge of an arm's motions: its meshes against boxes, and those that must keep."""
    model = pin.buildModelFromUrdf(str(file))
    folders = [str(folder) for folder in file.parents]
    kind = pin.GeometryType.COLLISION
    geometry = pin.buildGeomFromUrdf(model, str(file), kind, package_dirs=folders)
    names = {capsule.name for capsule in arm.capsules}
    objects = [
        (k, model.frames[shape.parentFrame].name)
        for k, shape in enumerate(geometry.geometryObjects)
    ]
    checked = [(k, name) for k, name in objects if name in names]
    moved = {capsule.name for capsule in arm.capsules if capsule.link > 0}
    n_boxes = 0
    for box in scene.boxes:
        placement = pin.SE3(box.rotation, box.center - np.array(mount))
        shape = pin.GeometryObject(box.name, 0, 0, placement, coal.Box(*box.size))
        number = geometry.addGeometryObject(shape)
        for k, name in checked:
            if name in moved:
                geometry.addCollisionPair(pin.CollisionPair(k, number))
                n_boxes += 1
    pairs = {frozenset(pair_names(arm, pair)) for pair in pairs_of(arm)}
    for i, (k, one) in enumerate(checked):
        for j, other in checked[i + 1 :]:
            if frozenset((one, other)) in pairs:
                geometry.addCollisionPair(pin.CollisionPair(k, j))
    joints = [model.joints[model.getJointId(name)] for name in arm.joint_names]
    columns = tuple((joint.idx_q, joint.nq) for joint in joints)
    return Judge(model, geometry, pin.neutral(model), columns, n_boxes)


def main() -> None:
    """Print a row for each arm and mount."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robots', type=Path, required=True, metavar='FOLDER')
    parser.add_argument('--motions', type=int, default=100, metavar='N', help='each (100)')
    parser.add_argument('--arms', nargs='*', default=list(ARMS), choices=ARMS)
    parser.add_argument(
        '--edges',
        type=int,
        metavar='N',
        help='instead of motions: certify N random edges of each arm, and check them densely',
    )
    text = 'instead of motions: what proving two parts of an arm apart costs'
    parser.add_argument('--costs', action='store_true', help=text)
    options = parser.parse_args()
    if options.costs:
        print_costs(options.robots, options.arms)
        return
    if options.edges is not None:
        print_edges(options.robots, options.arms, options.edges)
        return
    print(
        '| arm | worn on | free configurations | solved | nearer than the margin | least [mm] | '
        'collide with themselves |'
    )
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for name in options.arms:
        file, tool, ray = ARMS[name]
        for mount, place in MOUNTS.items():
            print(_row(name, mount, options.robots / file, tool, ray, place, options.motions))
            sys.stdout.flush()


def print_edges(robots: Path, names: Sequence[str], n: int) -> None:
    """Print a row for each arm and mount: how many certified edges collide."""
    print('| arm | worn on | random edges | certified | collide |')
    print('| --- | --- | --- | --- | --- |')
    for name in names:
        file, tool, ray = ARMS[name]
        for mount, place in MOUNTS.items():
            arm, scene = arm_of(robots / file, tool, ray, place), load_body()
            world, rng = arm_world(arm, scene, MARGIN, RAY), np.random.default_rng(0)
            counts = count_colliding(rng, arm, scene, world, MARGIN, n)
            print(f'| {name} | {mount} | {" | ".join(map(str, counts))} |', flush=True)


def print_costs(robots: Path, names: Sequence[str]) -> None:
    """Print a row for each arm and length of edges."""
    print('| arm | pairs | edge [rad] | edge [us] | a pair [us] | a bar, 8 boxes [us] | ratio |')
    print('| --- | --- | --- | --- | --- | --- | --- |')
    for name in names:
        file, tool, ray = ARMS[name]
        arm = arm_of(robots / file, tool, ray, MOUNTS['back'])
        for length in (0.5, 1.0):
            n, whole, pair, bar = costs(np.random.default_rng(5), arm, RAY, length)
            print(
                f'| {name} | {n} | {length:g} | {1e6 * whole:.1f} | {1e6 * pair:.3f} | '
                f'{1e6 * bar:.3f} | {pair / bar:.2f} |',
                flush=True,
            )


def _row(
    name: str, mount: str, file: Path, tool: str, ray: str, place: tuple[float, ...], n: int
) -> str:
    arm, scene = arm_of(file, tool, ray, place), load_body()
    settings, rng = load_settings(arm.dof), np.random.default_rng(0)
    world, judge = arm_world(arm, scene, MARGIN, RAY), judge_of(file, arm, scene, place)
    low, high = arm.bounds
    tried = rng.uniform(low, high, (2000, arm.dof))
    share = float(np.mean([world.is_valid(q) for q in tried]))
    warm_up(arm, settings.options)
    n_solved = n_near = n_colliding = 0
    least = np.inf
    for k, q_start in enumerate(free_configurations(rng, world, n)):
        plan = plan_motion(
            arm,
            scene,
            q_start,
            PointingGoal(random_target(rng)),
            settings.limits,
            settings.options,
            margin=MARGIN,
            ray_guard_length=RAY,
            seed=k,
        )
        if plan.trajectory is None:
            continue
        n_solved += 1
        distance, colliding = judge.judge(plan.trajectory)
        least = min(least, distance)
        n_near += distance < MARGIN
        n_colliding += bool(colliding)
    return (
        f'| {name} | {mount} | {100.0 * share:.1f} % | {n_solved} of {n} | {n_near} | '
        f'{1e3 * least:.1f} | {n_colliding} |'
    )


if __name__ == '__main__':
    main()
