# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Frozen values: arm, scene, goal, path and trajectory, with all arithmetic on them."""
