# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What values and kernels agree about; apart from the kernels, which take a second to load."""

# Joints and bars of an arm that kernels have room for; boxes in five levels of groups of eight.
MAX_DOF, MAX_BARS, MAX_BOXES = 64, 63, 32768

# Centre (3), size (3), rotation row by row (9).
SIZE, ROTATION, NUMBERS = 3, 6, 15
# A rotation is orthogonal up to this.
ORTHOGONAL = 1e-6
