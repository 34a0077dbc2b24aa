# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How deep a bar is in a box: the kernel against plain numpy."""

from hypothesis import given, strategies
import numpy as np
from rrth_planner.kernels.collision.bar_box import depths, PARALLEL
from worlds import examples, random_rotation

SEEDS = strategies.integers(0, 2**31)


def plain_depths(axes, offsets, halves, ends, radii):
    """Return the depths of (n, 2, 3) bars in m boxes, (n, m), all at once."""
    local = np.einsum('mij,nkj->nkmi', axes, ends) + offsets
    middle, f = 0.5 * (local[:, 1] + local[:, 0]), 0.5 * (local[:, 1] - local[:, 0])
    half = halves + radii[:, None, None]
    found = (half + np.abs(f) - np.abs(middle)).min(axis=-1)
    for i, j in ((1, 2), (2, 0), (0, 1)):
        a, b = np.abs(f[..., i]), np.abs(f[..., j])
        offset = np.abs(middle[..., i] * f[..., j] - middle[..., j] * f[..., i])
        overlap = half[..., i] * b + half[..., j] * a - offset
        across = np.full_like(overlap, np.inf)
        np.divide(overlap, a + b, out=across, where=a + b > PARALLEL)
        found = np.minimum(found, across)
    return found


@examples(200)
@given(SEEDS)
def test_the_kernel_is_plain_numpy(seed):
    rng = np.random.default_rng(seed)
    n, n_bars, m = rng.integers(1, 4), rng.integers(1, 4), rng.integers(0, 6)
    axes = np.array([random_rotation(rng) if rng.uniform() < 0.7 else np.eye(3) for _ in range(m)])
    axes = axes.reshape(m, 3, 3)
    offsets, halves = rng.uniform(-0.5, 0.5, (m, 3)), rng.uniform(0.01, 0.4, (m, 3))
    points = rng.uniform(-0.6, 0.6, (n, n_bars, 2, 4))
    if rng.uniform() < 0.3:
        # Along an axis, or of no length.
        along = rng.choice([0.0, 0.3]) * np.eye(3)[rng.integers(3)]
        points[:, 0, 1, :3] = points[:, 0, 0, :3] + along
    points[..., 3] = rng.choice([0.0, 0.02], points.shape[:3])
    boxes = np.concatenate([axes.reshape(m, 9).T, offsets.T, halves.T])
    found = np.empty((n, n_bars, m))
    depths(np.ascontiguousarray(boxes), points.reshape(n, n_bars, 8), found)
    ends, radii = points[..., :3].reshape(-1, 2, 3), points[:, :, 1, 3].reshape(-1)
    expected = plain_depths(axes, offsets, halves, ends, radii)
    np.testing.assert_allclose(found.reshape(n * n_bars, m), expected, rtol=0, atol=1e-9)
