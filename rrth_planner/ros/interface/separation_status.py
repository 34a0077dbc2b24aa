# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the running motion is executed beside a wearer who moves, and why, as a message."""

from dataclasses import dataclass
from enum import Enum

from diagnostic_msgs.msg import DiagnosticStatus
from rrth_planner.ros.messages.diagnostics import status_to_msg


class SeparationState(Enum):
    """How the running motion is executed; the names are those of `~/state`."""

    NORMAL = 0
    SLOWED = 1
    PROTECTIVE_STOP = 2
    FAULT = 3


@dataclass(frozen=True, slots=True)
class SeparationStatus:
    """
    The state, and its cause.

    Parameters
    ----------
    rate : float
        At which the motion is executed, of the planned one [-].
    bar, box : str
        What is not proven apart where the arm stops; empty: nothing.

    """

    state: SeparationState = SeparationState.NORMAL
    cause: str = ''
    rate: float = 1.0
    bar: str = ''
    box: str = ''


RATE_KEY = 'rate [-]'
LEVELS = {
    SeparationState.NORMAL: DiagnosticStatus.OK,
    SeparationState.SLOWED: DiagnosticStatus.OK,
    SeparationState.PROTECTIVE_STOP: DiagnosticStatus.WARN,
    SeparationState.FAULT: DiagnosticStatus.ERROR,
}


def separation_to_msg(name: str, status: SeparationStatus) -> DiagnosticStatus:
    """Return the message of `~/state`; its message begins with the name of the state."""
    state = status.state
    text = f'{state.name}: {status.cause}' if status.cause else state.name
    values = {RATE_KEY: f'{status.rate:.3f}', 'part of the arm': status.bar, 'box': status.box}
    return status_to_msg(name, LEVELS[state], text, values)
