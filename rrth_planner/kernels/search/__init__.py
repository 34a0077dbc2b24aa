# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled growth of trees, and the shortening of paths."""
