# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Types of the numbers of commands: a bad one is answered by what was expected, and its unit."""

import argparse
from collections.abc import Callable
import math


def number(unit: str = '', above: float = -math.inf) -> Callable[[str], float]:
    """Return the type of a finite number in a unit, such as `m`, above a bound if there is one."""
    expected = 'a finite number' if above == -math.inf else f'a number > {above:g}'
    if unit:
        expected += f' [{unit}]'

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f'"{text}", expected {expected}') from None
        if not math.isfinite(value) or value <= above:
            raise argparse.ArgumentTypeError(f'{text}, expected {expected}')
        return value

    return read


def integer(text: str) -> int:
    """Return an integer that an argument says."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}", expected an integer') from None


def _count(what: str) -> Callable[[str], int]:
    """Return the type of a number of at least one thing, such as `runs`."""

    def read(text: str) -> int:
        if not text.isdecimal() or int(text) < 1:
            raise argparse.ArgumentTypeError(f'"{text}", expected a number of {what} of 1 or more')
        return int(text)

    return read


number_of_runs, number_of_workers = _count('runs'), _count('workers')
