# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far parts of recorded people get within a time, and lines that bound it."""
