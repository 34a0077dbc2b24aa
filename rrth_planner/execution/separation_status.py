# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the running motion is executed beside a wearer who moves, and why."""

from dataclasses import dataclass
from enum import Enum

# What a motion beside a body that stands still comes without, and how to have it.
NO_PROMISE = (
    'nothing is promised of a wearer who moves, since his body came as one that stands still: '
    'publish bodies as a stream, stamped, at 30 Hz or more'
)


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
