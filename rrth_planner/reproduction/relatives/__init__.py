# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Relatives of RRT-H that the paper names, and references, on maps in the plane."""
