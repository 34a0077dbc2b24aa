# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What ROS 2 is used through: subscriptions, quality of service, processes."""
