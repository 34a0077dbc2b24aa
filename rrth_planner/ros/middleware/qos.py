# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The quality of service of what is published."""

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

# The last message counts, and whoever comes later gets it too.
LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

# Of a planner that has not said for so long that it watches over its motion, nothing is known [s].
LEASE = 0.3
_LIVELINESS = {
    'liveliness': LivelinessPolicy.MANUAL_BY_TOPIC,
    'liveliness_lease_duration': Duration(seconds=LEASE),
}
# Motions, by a planner that says again and again that it watches over them; everybody may listen.
COMMANDED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
    **_LIVELINESS,
)
# For who wants to know when such a planner is lost. Only a reliable reader hears that one lives.
SUPERVISED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
    **_LIVELINESS,
)

# Requests that wait for their turn, and answers that wait for who asked: the default drops those
# beyond ten.
SERVICE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
