# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""While a motion runs: localization of the arm on it, and checks of the remaining motion."""
