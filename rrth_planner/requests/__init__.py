# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Requests for motions, from the question to the answer, in real time and in virtual time."""
