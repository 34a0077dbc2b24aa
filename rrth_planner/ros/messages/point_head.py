# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The type of the action control_msgs/action/PointHead, where control_msgs is installed."""

from typing import Any

try:
    from control_msgs.action import PointHead as _PointHead
except ImportError:  # not among the wheels: no such action is served then
    _PointHead = None

# The type of the action; None where it is not installed.
PointHead: Any = _PointHead
