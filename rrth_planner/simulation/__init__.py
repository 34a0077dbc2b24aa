# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm and its wearer as bodies with masses, by MuJoCo, an optional library."""
