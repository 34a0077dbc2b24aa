# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What values and kernels agree about; apart from the kernels, which take a second to load."""

# Joints and bars of an arm that kernels have room for; boxes in five levels of groups of eight.
MAX_DOF, MAX_BARS, MAX_BOXES = 64, 63, 32768

# Centre (3), size (3), rotation row by row (9).
SIZE, ROTATION, NUMBERS = 3, 6, 15
# A rotation is orthogonal up to this.
ORTHOGONAL = 1e-6

# Columns of `robot`, a row for each DH row of the arm; then dof columns with the reach of the end
# of the row's `a` offset and dof with that of its `d` offset.
COS_ALPHA, SIN_ALPHA, A, OFFSET, D, KIND, RADIUS_A, RADIUS_D, REACH = range(9)
REVOLUTE, PRISMATIC, FIXED = 0.0, 1.0, 2.0
NO_BAR = -1.0

# `boxes`: a row for each group of LANES boxes, their numbers side by side, so that the compiler
# works on them all at once: number r of box l stands in column LANES r + l. The numbers: the
# rotation into the box's own axes (9), the position of the arm's base in them (3), the half
# extents grown by margin and slack (3). The groups form a tree: lane l of group g bounds the whole
# group LANES g + l + 1, if there is such a row; the last ones hold the boxes themselves. Unused
# lanes have half extents of minus infinity: they never collide.
LANES = 8
BOX_OFFSET, BOX_HALF, BOX_ROWS = 9, 12, 15
