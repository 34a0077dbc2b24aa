# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Campaigns of many planner runs: what was asked, one row a run, spread over cores."""
