# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Random motions that tests share, and how far points are beside one."""

import numpy as np
from rrth_planner.model.path import Path
from rrth_planner.model.trajectory import piece_coefficients, sample, Trajectory
from rrth_planner.timing.corner_blends import Blend
from rrth_planner.timing.parameterization import parameterize
from worlds import limits

LIMITS = limits()


def planned_motion(rng):
    """Return a motion with rounded corners, stops, and straights of any length."""
    n = int(rng.integers(2, 7))
    steps = rng.standard_normal((n - 1, 4)) * rng.choice([0.02, 0.2, 1.0])
    q = np.vstack([np.zeros(4), np.cumsum(steps, axis=0)])
    lengths = np.linalg.norm(steps, axis=1)
    directions = steps / lengths[:, None]
    blends = tuple(
        Blend(
            corner=q[i],
            u_in=directions[i - 1],
            u_out=directions[i],
            half_length=float(
                rng.choice([0.0, rng.uniform(0.02, 0.45)]) * min(lengths[i - 1], lengths[i])
            ),
        )
        for i in range(1, n - 1)
    )
    return parameterize(Path(q), blends, LIMITS)


def foreign_motion(rng):
    """Return a motion of another planner: through any states, with any jerk, to rest."""
    n, reach = int(rng.integers(2, 5)), rng.choice([0.2, 0.6])
    states = rng.uniform(-reach, reach, (3, n, 4))
    states[1:, -1] = 0.0
    if rng.random() < 0.5:
        states[1:, 0] = 0.0
    if rng.random() < 0.3:
        # One that turns back in all joints at once.
        states[1, n // 2] = 0.0
    return Trajectory(
        times=np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.5, n - 1))]),
        positions=states[0],
        velocities=states[1],
        accelerations=2.0 * states[2],
    )


def any_motion(rng):
    """Return a motion of either kind."""
    return planned_motion(rng) if rng.random() < 0.6 else foreign_motion(rng)


def motion_of(rng, arm):
    """Return a motion of an arm that has any number of joints."""
    motion = any_motion(rng)
    mix = rng.standard_normal((4, arm.dof)) * (rng.random((4, arm.dof)) < 0.6)
    middle = arm.bounds.mean(axis=0)
    q, v, a = (row @ mix for row in motion.states)
    return Trajectory(motion.times, middle + q, v, a)


def path_distance(points, trajectory, begin, end):
    """
    Return how far points, (n, dof), are from a stretch of a motion, joint by joint [rad].

    Only the samples round the nearest one count: what is returned may be greater, not less.
    """
    path = sample(trajectory, np.linspace(begin, end, 3001))[0]
    squares = (path**2).sum(axis=1) - 2.0 * points @ path.T
    nearest = np.clip(squares.argmin(axis=1)[:, None] + np.arange(-8, 8), 0, len(path) - 2)
    a, along = path[nearest], np.diff(path, axis=0)[nearest]
    off = points[:, None] - a
    share = np.clip((off * along).sum(axis=2) / ((along**2).sum(axis=2) + 1e-300), 0.0, 1.0)
    best: np.ndarray = np.abs(off - share[..., None] * along).max(axis=2).min(axis=1)
    return best


def jerks_at(trajectory, times):
    """Return the jerks at some times within a motion, (m, dof); at a point that of the later."""
    grid = trajectory.times
    if len(grid) == 1:
        return np.zeros((len(times), trajectory.positions.shape[1]))
    i = np.searchsorted(grid[1:-1], times, side='right')
    width = (grid[i + 1] - grid[i])[:, None]
    u = np.clip((times - grid[i])[:, None] / width, 0.0, 1.0)
    c = piece_coefficients(trajectory)[i]
    return ((60 * c[:, 5] * u + 24 * c[:, 4]) * u + 6 * c[:, 3]) / width**3
