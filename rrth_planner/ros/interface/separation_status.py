# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the running motion is executed beside a wearer who moves, and why, as a message."""

from dataclasses import replace
import math

from diagnostic_msgs.msg import DiagnosticStatus
from rrth_planner.execution.separation_status import SeparationState, SeparationStatus
from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.ros.messages.diagnostics import status_to_msg

RATE_KEY, BAR_KEY, BOX_KEY = 'rate [-]', 'part of the arm', 'box'
LEVELS = {
    SeparationState.NORMAL: DiagnosticStatus.OK,
    SeparationState.SLOWED: DiagnosticStatus.OK,
    SeparationState.PROTECTIVE_STOP: DiagnosticStatus.WARN,
    SeparationState.FAULT: DiagnosticStatus.ERROR,
    SeparationState.UNSEPARATED: DiagnosticStatus.WARN,
}


def separation_to_msg(
    name: str, status: SeparationStatus, trouble: tuple[bytes, str] = (DiagnosticStatus.OK, '')
) -> DiagnosticStatus:
    """
    Return the message of `~/state`; its message begins with the name of the state.

    trouble: a level and a sentence, which count where the level is higher than that of the state.
    """
    state = status.state
    level, cause = max((LEVELS[state], status.cause), trouble, key=lambda found: found[0])
    text = replace(status, cause=cause).text
    values = {RATE_KEY: f'{status.rate:.3f}', BAR_KEY: status.bar, BOX_KEY: status.box}
    return status_to_msg(name, level, text, values)


def separation_from_msg(msg: DiagnosticStatus) -> SeparationStatus:
    """Return what a message of `~/state` says, or raise MessageError where it is none."""
    values = {pair.key: pair.value for pair in msg.values}
    name, _, cause = msg.message.partition(': ')
    try:
        state, rate = SeparationState[name], float(values[RATE_KEY])
    except (KeyError, ValueError):
        rate = math.nan
    if not math.isfinite(rate):
        raise MessageError(
            f'message "{one_line(msg.message)}" with "{RATE_KEY}" '
            f'{one_line(values.get(RATE_KEY, "missing"))}, expected one of '
            f'{", ".join(SeparationState.__members__)} and a number [-]'
        )
    # A profile of limited jerk may go beyond by rounding.
    rate = min(max(rate, 0.0), 1.0)
    return SeparationStatus(state, cause, rate, values.get(BAR_KEY, ''), values.get(BOX_KEY, ''))
