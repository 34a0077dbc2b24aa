# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The same course in real time, through nodes, and in virtual time."""
