# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""No point of a bar moves further than its bound, by the kinematics of the reference checker."""

from hypothesis import given, strategies as st
import numpy as np
from rrth_planner.collision.second_checker import displacements
from rrth_planner.model.trajectory import sample, Trajectory
from worlds import examples, oracle_bars, random_chain, table_1_arm

RAY = 0.8


@examples(80)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_point_of_a_bar_moves_further_than_its_bound(seed):
    rng = np.random.default_rng(seed)
    arm = table_1_arm() if rng.random() < 0.5 else random_chain(rng, rng.random() < 0.5)
    n, scale = int(rng.integers(2, 6)), rng.choice([0.1, 1.0, 10.0])
    states = rng.standard_normal((3, n, arm.dof)) * scale
    times = np.cumsum(rng.uniform(0.01, 0.5, n))
    # Bounds of reach hold as far as the joints may slide.
    slides = np.array(arm.is_prismatic)
    middle, span = arm.bounds.mean(axis=0), np.ptp(arm.bounds, axis=0)
    states[:, :, slides] *= (0.02 * span / scale)[slides]
    states[0][:, slides] += middle[slides]
    trajectory = Trajectory(
        times=times - times[0], positions=states[0], velocities=states[1], accelerations=states[2]
    )
    instants = np.linspace(0.0, trajectory.duration, 400)
    ways = displacements(arm, trajectory, instants, RAY)
    q, _, _ = sample(trajectory, instants)
    assert ((q >= arm.bounds[0]) & (q <= arm.bounds[1]))[:, slides].all()
    bars = oracle_bars(arm, q, RAY)
    assert ways.shape == (bars.shape[1], len(instants))
    assert (np.diff(ways) >= 0.0).all()
    for _ in range(200):
        i, j = sorted(rng.integers(0, len(instants), 2))
        moved = np.linalg.norm(bars[j] - bars[i], axis=-1).max(axis=1)
        assert (moved <= ways[:, j] - ways[:, i] + 1e-9).all()
    # Along the way, not only from end to end.
    steps = np.linalg.norm(np.diff(bars, axis=0), axis=-1).max(axis=2)
    assert (ways[:, 1:] + 1e-9 >= np.cumsum(steps, axis=0).T).all()


def test_the_way_of_a_joint_that_turns_alone_is_its_arc():
    arm = table_1_arm()
    q = np.zeros((2, 4))
    q[1, 3] = 1.0
    still = np.zeros((2, 4))
    turn = Trajectory(times=[0.0, 2.0], positions=q, velocities=still, accelerations=still)
    ways = displacements(arm, turn, np.array([0.0, 2.0]), RAY)
    assert ways[:2].max() == 0.0
    assert RAY <= ways[2, 1] <= 1.8 * RAY


def test_an_arm_that_holds_still_has_no_displacement():
    arm = table_1_arm()
    one = np.zeros((1, 4))
    hold = Trajectory(times=[0.0], positions=one, velocities=one, accelerations=one)
    assert not displacements(arm, hold, np.zeros(2), RAY).any()
