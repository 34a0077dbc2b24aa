# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of plans and motions, and the viewer in a browser."""
