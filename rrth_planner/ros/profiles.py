# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The quality of service of what is published."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

# The last message counts, and whoever comes later gets it too.
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
