# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The types of messages of trackers whose packages need not be installed; None: it is not."""

from typing import Any

try:
    from zed_msgs.msg import ObjectsStamped as _ObjectsStamped
except ImportError:  # not among the wheels
    _ObjectsStamped = None
try:
    from mocap4r2_msgs.msg import RigidBodies as _RigidBodies
except ImportError:  # not among the wheels
    _RigidBodies = None

ObjectsStamped: Any = _ObjectsStamped
RigidBodies: Any = _RigidBodies
