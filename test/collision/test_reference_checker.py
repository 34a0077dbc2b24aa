# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The reference checker against points along the bar, and the polynomials it solves for."""

from hypothesis import assume, given, settings, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.reference_checker import (
    bar_box_contact,
    bar_radii,
    bars,
    clearances,
    Contact,
    first_contact,
    frames,
    quintic_states,
)
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import forward_kinematics
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import sample, Trajectory

ARM = load_arm()
COORDINATES = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
QUATERNIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1)


@settings(max_examples=300)
@given(
    a=COORDINATES,
    b=COORDINATES,
    center=COORDINATES,
    half=st.tuples(*[st.floats(0.01, 0.8)] * 3),
    quaternion=QUATERNIONS,
)
def test_a_bar_meets_a_box_where_one_of_its_points_is_inside(a, b, center, half, quaternion):
    rotation, half = rotation_matrix(quaternion), np.array(half)
    t = np.linspace(0.0, 1.0, 4001)[:, None]
    points = np.array(a) + t * np.subtract(b, a)
    # The largest coordinate over its half size: below 1 is inside.
    depth = (np.abs((points - center) @ rotation) - half).max(axis=1).min()
    # Between two points the bar may still enter by less than their distance.
    assume(not -1e-9 < depth < np.linalg.norm(np.subtract(b, a)) / 4000 + 1e-9)
    touches = bar_box_contact(np.array([a, b]), np.array(center), rotation, half)
    assert bool(touches) == (depth < 0.0)


def test_frames_are_those_of_the_arm():
    q = np.random.default_rng(0).uniform(ARM.bounds[0], ARM.bounds[1], (50, 4))
    for one, poses in zip(q, frames(ARM, q), strict=True):
        np.testing.assert_allclose(poses, forward_kinematics(ARM, one), atol=1e-12)


def test_bars_hang_together_and_end_in_the_ray():
    q = np.random.default_rng(1).uniform(ARM.bounds[0], ARM.bounds[1], (50, 4))
    ends = bars(ARM, q, 1.5)
    np.testing.assert_allclose(ends[:, 1:, 0], ends[:, :-1, 1], atol=1e-12)
    T = frames(ARM, q)[:, -1]
    np.testing.assert_allclose(ends[:, -1, 1], T[:, :3, 3] + 1.5 * T[:, :3, 2], atol=1e-12)


def test_states_of_a_controller_are_samples_of_the_trajectory():
    rng = np.random.default_rng(2)
    times = np.cumsum(np.append(0.0, rng.uniform(0.05, 1.0, 6)))
    p, v, a = rng.normal(size=(3, 7, 4))
    trajectory = Trajectory(times=times, positions=p, velocities=v, accelerations=a)
    grid, *states = quintic_states(trajectory, 0.003)
    for one, other in zip(states, sample(trajectory, grid), strict=True):
        # At the points both pieces give position, velocity and acceleration.
        np.testing.assert_allclose(one, other, atol=1e-6)


def motion_beside_boxes(seed, n):
    """Return a random motion of so many instants, and boxes about it."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(*ARM.bounds, (2, ARM.dof))
    centers = ARM.T_base_mount[:3, 3] + rng.uniform(-0.5, 0.5, (16, 3))
    boxes = [
        Box(f'box {k}', center, rng.uniform(0.02, 0.3, 3), rotation_matrix(rng.normal(size=4)))
        for k, center in enumerate(centers)
    ]
    return q[0] + np.linspace(0.0, 0.6, n)[:, None] * (q[1] - q[0]), Scene(tuple(boxes))


def test_the_first_contact_is_found_among_all_bars_boxes_and_instants():
    n_contacts = 0
    for seed in range(40):
        q, scene = motion_beside_boxes(seed, 333)
        ends = bars(ARM, q, 0.3)
        hits = np.stack(
            [
                [
                    bar_box_contact(ends[:, k], b.center, b.rotation, 0.5 * b.size + radius)
                    for k, radius in enumerate(bar_radii(ARM))
                ]
                for b in scene.boxes
            ]
        )
        # From the first of all instants on, and from the first one without contact.
        touched = hits.any(axis=(0, 1))
        for begin in {0, int(np.argmin(touched))}:
            expected = None
            if touched[begin:].any():
                index = int(np.argmax(touched[begin:]))
                box, bar = np.argwhere(hits[..., begin + index])[0]
                expected = Contact(index, int(bar), scene.boxes[box].name)
                n_contacts += index > 0
            assert first_contact(ARM, scene, q[begin:], 0.3, 0.0) == expected
    assert n_contacts > 10
    assert first_contact(ARM, scene, q[:0], 0.3, 0.0) is None


def test_clearances_are_the_least_distances_of_points_of_bars():
    t = np.linspace(0.0, 1.0, 301)[:, None]
    for seed in range(12):
        q, scene = motion_beside_boxes(seed, 15)
        ends, least = bars(ARM, q, 0.6), np.full(len(q), np.inf)
        points = ends[:, :, 0, None] + t * (ends[:, :, 1] - ends[:, :, 0])[:, :, None]
        for box in scene.boxes:
            beyond = np.abs((points - box.center) @ box.rotation) - 0.5 * box.size
            gaps = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1).min(axis=-1)
            least = np.minimum(least, (gaps - bar_radii(ARM)).min(axis=1))
        found = clearances(ARM, scene, q, 0.6)
        assert (found <= least + 1e-12).all()
        # No bar is longer, and a point of it is no further from the next one.
        np.testing.assert_allclose(found, least, rtol=0.0, atol=0.6 / 300)
    assert clearances(ARM, Scene(()), q, 0.6) == pytest.approx(np.inf)
