# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a controller makes of the messages with which the planner replaces a motion."""
