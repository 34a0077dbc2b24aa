# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""While a motion runs: where the arm is on it, and whether the rest of it is free."""
