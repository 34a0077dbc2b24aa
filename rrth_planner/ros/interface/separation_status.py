# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the running motion is executed beside a wearer who moves, and why, as a message."""

from dataclasses import dataclass, replace
from enum import Enum
import math

from diagnostic_msgs.msg import DiagnosticStatus
from rrth_planner.model.errors import MessageError, one_line
from rrth_planner.ros.messages.diagnostics import status_to_msg


class SeparationState(Enum):
    """How the running motion is executed; the names are those of `~/state`."""

    NORMAL = 0
    SLOWED = 1
    PROTECTIVE_STOP = 2
    FAULT = 3
    UNSEPARATED = 4


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

    @property
    def text(self) -> str:
        """The name of the state, and its cause."""
        return f'{self.state.name}: {self.cause}' if self.cause else self.state.name


# What a motion beside a body that stands still comes without, and how to have it.
NO_PROMISE = (
    'nothing is promised of a wearer who moves, since his body came as one that stands still: '
    'publish bodies as a stream, stamped, at 30 Hz or more'
)
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
