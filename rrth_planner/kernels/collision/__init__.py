# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled distances between bars and boxes, and checks of edges and trajectories."""
