# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Starts of an arm at thin boxes: whether the checkers of its motions agree there."""
