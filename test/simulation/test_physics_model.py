# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The model of MuJoCo is the arm of the planner, and its wearer is within his boxes."""

from dataclasses import replace

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import least_clearance
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.arm import forward_kinematics, NO_BARS
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.rotation import rotation_matrices
from rrth_planner.model.scene import Scene
from rrth_planner.simulation.arm_dynamics import ArmDynamics
from rrth_planner.simulation.body_shapes import capsules_within, whole_box
from rrth_planner.simulation.mechanics import Inertia, usual_mechanics
from rrth_planner.simulation.moving_body import recorded_body, scene_at, standing_body, state_at
from rrth_planner.simulation.physics_model import physics_model, stretch
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import excerpt, posture_at
from worlds import capsule_arm, random_boxes, random_chain, table_1_arm

mujoco = pytest.importorskip('mujoco')
THICK = 0.02
G = np.array([0.0, 0.0, -9.81])


def arms(n):
    """Return arms of all kinds, bars and capsules, some with a joint that slides."""
    rng = np.random.default_rng(5)
    found = [random_chain(rng, has_tail=bool(k % 2)) for k in range(n)]
    assert any(any(arm.is_prismatic) for arm in found)
    return [table_1_arm(), *found, capsule_arm(rng), capsule_arm(rng, 4)]


def at(physics, q):
    """Return the data of a model with its arm at a configuration."""
    data = mujoco.MjData(physics.model)
    data.qpos[: len(q)] = q
    stretch(physics, q)
    mujoco.mj_forward(physics.model, data)
    return data


@pytest.mark.parametrize('arm', arms(8), ids=lambda arm: f'{arm.dof} joints')
def test_frames_are_those_of_the_arm(arm):
    rng = np.random.default_rng(1)
    physics = physics_model(arm, usual_mechanics(arm.dof))
    bodies = [physics.model.body(f'link {i + 1}').id for i in range(arm.dof)] + [physics.tool]
    for q in rng.uniform(*arm.bounds, size=(20, arm.dof)):
        data = at(physics, q)
        for body, T in zip(bodies, forward_kinematics(arm, q), strict=True):
            np.testing.assert_allclose(data.xpos[body], T[:3, 3], atol=1e-9)
            np.testing.assert_allclose(data.xmat[body].reshape(3, 3), T[:3, :3], atol=1e-9)


@pytest.mark.parametrize('arm', arms(8), ids=lambda arm: f'{arm.dof} joints')
def test_distances_are_those_of_the_reference_checker(arm):
    rng = np.random.default_rng(2)
    # Of one radius: the reference checker has a point at each joint, whose bars are of length 0,
    # and the ray, of length 0, at the tool.
    arm = replace(arm, radii=np.where(arm.radii == NO_BARS, NO_BARS, THICK), allowed=())
    n_seen = 0
    for _ in range(4):
        scene = Scene(random_boxes(rng, 1, largest=0.3).boxes)
        physics = physics_model(arm, usual_mechanics(arm.dof), standing_body(scene), whole_box)
        shapes = [k for k, name in physics.names.items() if name != scene.boxes[0].name]
        (box,) = physics.names.keys() - set(shapes)
        for q in rng.uniform(*arm.bounds, size=(10, arm.dof)):
            data = at(physics, q)
            found = [
                mujoco.mj_geomDistance(physics.model, data, shape, box, 10.0, None)
                for shape in shapes
            ]
            box_there = scene.boxes[0]
            local = box_there.rotation.T @ (data.xpos[physics.tool] - box_there.center)
            gap = np.linalg.norm(np.maximum(np.abs(local) - 0.5 * box_there.size, 0.0)) - THICK
            expected = least_clearance(arm, scene, q[None], 0.0)
            if expected > 1e-3:
                assert min([*found, gap]) == pytest.approx(expected, abs=1e-6)
                n_seen += 1
    assert n_seen > 10


def test_weight_and_inertia_are_those_of_a_pendulum():
    arm = table_1_arm()
    mechanics = replace(usual_mechanics(4), payload=0.0)
    dynamics = ArmDynamics(arm, mechanics)
    rng = np.random.default_rng(3)
    for q in rng.uniform(*arm.bounds, size=(5, 4)):
        # The gradient of the potential energy, by the frames of the planner: link 3 is a bar of
        # 0.386 m, link 4 one of 0.038 m, each with its mass in its middle, the others at joints.
        def energy(q):
            T = forward_kinematics(arm, q)
            places = [T[0, :3, 3], T[1, :3, 3]]
            places += [T[2, :3, 3] - 0.193 * T[2, :3, 2], T[3, :3, 3] - 0.019 * T[3, :3, 2]]
            return -np.array(places) @ G @ mechanics.link_mass

        step = 1e-6 * np.eye(4)
        expected = [(energy(q + s) - energy(q - s)) / 2e-6 for s in step]
        np.testing.assert_allclose(dynamics.weight(q, G), expected, atol=1e-7)
        inertia = dynamics.inertia(q)
        np.testing.assert_allclose(inertia, inertia.T, atol=1e-12)
        assert np.linalg.eigvalsh(inertia)[0] > 0.0
    assert not dynamics.weight(np.zeros(4), np.zeros(3)).any()


def test_given_inertias_take_the_place_of_masses():
    arm = table_1_arm()
    given = tuple(
        Inertia(mass=k + 0.5, center=[0.01 * k, 0.02, 0.03], tensor=np.diag([0.1, 0.11, 0.12]))
        for k in range(4)
    )
    physics = physics_model(arm, replace(usual_mechanics(4), payload=0.3, inertias=given))
    masses = [physics.model.body(f'link {k + 1}').mass[0] for k in range(4)]
    assert masses == [0.5, 1.5, 2.5, 3.5]
    # The payload is all that is not of a link.
    assert physics.model.body_mass.sum() == pytest.approx(8.3)
    with pytest.raises(OptionsError, match='principal moments'):
        Inertia(mass=1.0, center=np.zeros(3), tensor=np.diag([0.1, 0.1, 0.3]))
    with pytest.raises(OptionsError, match='inertias: 2'):
        replace(usual_mechanics(4), inertias=given[:2])


def test_masses_are_those_given():
    for arm in arms(4):
        mechanics = replace(usual_mechanics(arm.dof), link_mass=1.0 + np.arange(arm.dof))
        model = physics_model(arm, mechanics).model
        expected = mechanics.link_mass.sum() + mechanics.payload
        assert model.body_mass.sum() == pytest.approx(expected)


@pytest.mark.parametrize('size', [(0.3, 0.46, 0.6), (0.1, 0.1, 0.1), (0.4, 0.13, 0.13)])
def test_capsules_fill_a_box_and_stay_within(size):
    size = np.array(size)
    lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
    for capsule in capsules_within(size):
        lower = np.minimum(lower, capsule.ends.min(axis=0) - capsule.radius)
        upper = np.maximum(upper, capsule.ends.max(axis=0) + capsule.radius)
    np.testing.assert_allclose(lower, -0.5 * size)
    np.testing.assert_allclose(upper, 0.5 * size)


@pytest.fixture(scope='module')
def person():
    """Return a second of the person who comes along, and his skeleton."""
    return excerpt(load_person(), 2.0, 3.0), load_skeleton('cmu_bvh')


def test_a_recorded_person_is_where_his_boxes_are_and_within_them(person):
    body = recorded_body(*person)
    for time in (0.0, 0.41, 0.5, 1.0, 1.3, 2.0):
        expected, _ = body_boxes(person[1], posture_at(person[0], time))
        boxes = {box.name: box for box in expected.boxes}
        for box in scene_at(body, time).boxes:
            other = boxes[box.name]
            # Between two frames straight on, where the boxes go round bones.
            np.testing.assert_allclose(box.center, other.center, atol=2e-3)
            np.testing.assert_allclose(box.rotation, other.rotation, atol=0.02)
            assert (box.size <= other.size + 2e-3).all()


def test_velocities_of_a_recorded_person_are_those_of_his_poses(person):
    body = recorded_body(*person)
    for time in (0.215, 0.744, 1.512):
        before, now, after = (state_at(body, time + dt) for dt in (-1e-4, 0.0, 1e-4))
        np.testing.assert_allclose(
            now.velocities, (after.positions - before.positions) / 2e-4, atol=1e-6
        )
        R = [rotation_matrices(s.quaternions) for s in (before, now, after)]
        rates = np.swapaxes(R[1], 1, 2) @ (R[2] - R[0]) / 2e-4
        spins = np.stack([rates[:, 2, 1], rates[:, 0, 2], rates[:, 1, 0]], axis=1)
        np.testing.assert_allclose(now.spins, spins, atol=1e-5)
        assert np.linalg.norm(now.gravity) == pytest.approx(9.81)
        # He stands, bent forward a little.
        assert now.gravity[2] < -6.0
