# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The state of a node as diagnostics."""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rrth_planner.model.errors import one_line

# What the planner's diagnostics have of the request whose motion was published last: its number,
# and why its goal was given up.
REQUEST_KEY, GIVEN_UP_KEY = 'request', 'given up'


def status_to_msg(
    name: str, level: bytes, message: str, values: Mapping[str, object]
) -> DiagnosticStatus:
    """Return a state by its name, one of the levels of DiagnosticStatus, and values in a line."""
    return DiagnosticStatus(
        level=level,
        name=name,
        hardware_id='rrth_planner',
        message=message,
        values=[KeyValue(key=k, value=one_line(str(v))) for k, v in values.items()],
    )
