# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the numbers of a box stand; apart from the kernels, which take a second to load."""

# Centre (3), size (3), rotation row by row (9).
SIZE, ROTATION, NUMBERS = 3, 6, 15
# A rotation is orthogonal up to this.
ORTHOGONAL = 1e-6
