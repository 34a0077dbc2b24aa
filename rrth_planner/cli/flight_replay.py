# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Decide about the events of a flight record again, and compare what is commanded."""

from pathlib import Path

from rrth_planner.execution.flight_recorder import read_flight, replay
from rrth_planner.model.errors import RecordError


def replay_flight(file: Path) -> int:
    """Replay a record, print what the monitor did, and return the exit code."""
    try:
        flight = read_flight(file.read_bytes())
    except OSError as problem:
        raise RecordError(f'{file}: {problem.strerror}, expected a flight record') from problem
    begin, shown, n_commands, other = None, '', 0, None
    for one in replay(flight):
        at = one.event.at.steady
        begin = at if begin is None else begin
        n_commands += one.command is not None
        state = ': '.join(filter(None, (one.watch.state.value, one.watch.sentence)))
        if state != shown:
            print(f'{at - begin:8.3f} s  {state}')
            shown = state
        if not one.is_same and other is None:
            other = one
    print(f'{len(flight.entries):,} events, {n_commands:,} commands')
    if other is None:
        print('reproduced: every command is the same as recorded, to the bit')
        return 0
    kind, when = type(other.event).__name__, other.event.at.steady - (begin or 0.0)
    print(
        f'not reproduced: event {other.number} ({kind}, at {when:.3f} s) gives another command '
        'than recorded'
    )
    return 1
