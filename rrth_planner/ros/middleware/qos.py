# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The quality of service of what is published."""

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

_LAST = {'depth': 1, 'reliability': ReliabilityPolicy.RELIABLE}
_FOR_LATE = {**_LAST, 'durability': DurabilityPolicy.TRANSIENT_LOCAL}
# The last message counts, for late subscribers too.
LATCHED = QoSProfile(**_FOR_LATE)

# A planner that has not asserted its liveliness for so long is lost [s].
LEASE = 0.3
_LIVELINESS = {
    'liveliness': LivelinessPolicy.MANUAL_BY_TOPIC,
    'liveliness_lease_duration': Duration(seconds=LEASE),
}
# Motions, whose planner asserts its liveliness while it monitors them; any subscriber matches.
COMMANDED = QoSProfile(**_FOR_LATE, **_LIVELINESS)
# Motions that each are safe by themselves: nobody has to supervise their planner.
COMMITTED = QoSProfile(**_LAST, durability=DurabilityPolicy.VOLATILE)
# For subscribers that supervise the planner: liveliness needs a reliable reader.
SUPERVISED = QoSProfile(**_LAST, durability=DurabilityPolicy.VOLATILE, **_LIVELINESS)

# Whether the pointing ray is clear: where that does not come any more, its reader notices [s].
DEADLINE = 0.1
RAY_CLEAR = QoSProfile(**_LAST, **_LIVELINESS, deadline=Duration(seconds=DEADLINE))

# Answers, those to others included, until they are read.
ANSWERED = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
# Requests may queue, and their responses: the default drops those beyond ten.
SERVICE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
