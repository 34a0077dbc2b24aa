# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motions executed by an arm with masses and servos, judged by the geometry of MuJoCo."""
