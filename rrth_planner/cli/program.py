# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Name and output of a command."""

from pathlib import Path
import sys


def program(name: str) -> str:
    """Return what a command is called: its name, or `rrth NAME` where `rrth` started it."""
    return f'rrth {name}' if Path(sys.argv[0]).stem == 'rrth' else name


def say(name: str, sentence: str) -> None:
    """Print a sentence of a command to standard error, at once."""
    print(f'{program(name)}: {sentence}', file=sys.stderr, flush=True)
