# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: how fast, how near to the best, and whether every path holds, beside the peers."""
