# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What values and kernels agree about; apart from the kernels, which take a second to load."""

# Joints and bars of an arm that kernels have room for; boxes in five levels of groups of eight.
MAX_DOF, MAX_BARS, MAX_BOXES = 64, 63, 32768

# Centre (3), size (3), rotation row by row (9).
SIZE, ROTATION, NUMBERS = 3, 6, 15
# A rotation is orthogonal up to this.
ORTHOGONAL = 1e-6

# `robot` holds an arm in four blocks of rows. First its dof + 1 DH rows, the tool's last, whose D
# is the length of the pointing ray; RADIUS_A and RADIUS_D are those of the bars that its offsets
# are.
COS_ALPHA, SIN_ALPHA, A, OFFSET, D, KIND, RADIUS_A, RADIUS_D = range(8)
REACH = 9
REVOLUTE, PRISMATIC, FIXED = 0.0, 1.0, 2.0
NO_BAR = -1.0
# Then one row of sizes: the bars that are checked against boxes; the numbers that `chain` writes
# of a configuration; where among them the frames of links begin; the first of the pairs.
N_BARS, STRIDE, FRAMES, FIRST_PAIR = range(4)
# Then a row for each bar, those of the mount last. Of a capsule: the frame of its link (0: the
# mount's, dof + 1: the tool's), its radius, its two ends in that frame; of an offset: NO_BAR.
# From REACH on, dof columns with the reach of its start and dof with that of its end.
LINK, RADIUS, ENDS = 0, 1, 2
# Then a row for each pair of bars that must not collide: the inner and the outer one, where among
# the frames that of the inner one's link is, and how many joints move that link.
INNER, OUTER, FRAME, BODY = range(4)
# Room in `points` for a bar (start, half its length, end, radius), and for a frame (origin, then
# its axes).
BAR_SIZE, FRAME_SIZE = 8, 12
# Most pairs of an arm's bars, and most links whose frames they need.
MAX_PAIRS, MAX_FRAMES = 2048, 64

# `boxes`: a row for each group of LANES boxes, their numbers side by side, so that the compiler
# works on them all at once: number r of box l stands in column LANES r + l. The numbers: the
# rotation into the box's own axes (9), the position of the arm's base in them (3), the half
# extents grown by margin and slack (3), and which bars may meet the box (2): bar k where bit
# k % ALLOWED_BITS of number k // ALLOWED_BITS is set. Then, in the first lane of one more, a
# number other than 0 where a bar may meet any box of the group. The groups form a tree: lane l of
# group g bounds the whole group LANES g + l + 1, if there is such a row; the last ones hold the
# boxes themselves. Unused lanes have half extents of minus infinity: they never collide.
LANES, ALLOWED_BITS = 8, 32
BOX_OFFSET, BOX_HALF, BOX_ALLOWED, ANY_ALLOWED, BOX_ROWS = 9, 12, 15, 17, 18
