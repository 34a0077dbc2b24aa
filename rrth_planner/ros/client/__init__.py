# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes that talk with planner and arm from outside."""
