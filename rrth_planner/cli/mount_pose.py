# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The option that says where the wearer has an arm."""

from collections.abc import Sequence

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix


def mount_pose(numbers: Sequence[float]) -> Array:
    """Return the pose that --mount gives, x y z qx qy qz qw -> (4, 4) [m], or raise ModelError."""
    values = frozen_array(numbers, (7,), '--mount', 'm and -', ModelError)
    if np.linalg.norm(values[3:]) < 1e-6:
        raise ModelError('--mount: quaternion all zero, expected qx qy qz qw, not all 0 [-]')
    return pose_matrix(values[:3], values[3:])
