# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The only place that knows ROS 2: translation, nodes and the demo."""
