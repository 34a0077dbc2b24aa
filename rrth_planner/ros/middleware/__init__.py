# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Subscriptions, quality of service, parameters and processes of ROS 2."""
