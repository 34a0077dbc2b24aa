# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What commands have in common: name, arguments, output, and how they end."""

import argparse
from collections.abc import Callable
import os
from pathlib import Path
import signal
import sys
from typing import NoReturn

from rrth_planner.cli.numbers import number
from rrth_planner.model.errors import one_line, RrthError

INTERRUPTED = 130
# As a shell reports a program that SIGPIPE has ended.
OUTPUT_CLOSED = 141
# Help of the option that names the file of the wearer.
BODY_HELP = 'the wearer, laid out as config/body.yaml, the default, or as msg_examples/body.yaml'


def program(name: str) -> str:
    """Return what users call a command: its name, or `rrth NAME` where `rrth` started it."""
    return f'rrth {name}' if Path(sys.argv[0]).stem == 'rrth' else name


def say(name: str, sentence: str) -> None:
    """Print a sentence of a command to standard error, at once."""
    print(f'{program(name)}: {sentence}', file=sys.stderr, flush=True)


def command_parser(
    name: str, description: str | None, epilog: str | None = None
) -> argparse.ArgumentParser:
    """Return the parser of a command; with an epilog, lines are printed as they are."""
    return argparse.ArgumentParser(
        prog=program(name),
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter if epilog else argparse.HelpFormatter,
    )


def add_files(parser: argparse.ArgumentParser, **helps: str) -> None:
    """Add an option for each file of a command, with its help."""
    for name, text in helps.items():
        parser.add_argument(f'--{name}', type=Path, metavar='FILE', help=text)


def add_size(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how large a recorded person is."""
    parser.add_argument(
        '--stature',
        type=number('m'),
        nargs='+',
        default=(1.4, 2.0),
        metavar='M',
        help='of the person, or of the smallest and the largest one [m] (1.4 2.0)',
    )
    parser.add_argument(
        '--hand-size',
        type=number('m'),
        default=0.0,
        metavar='M',
        help='edge of the boxes of hands without finger points [m] (as in the skeleton)',
    )
    parser.add_argument(
        '--unit',
        metavar='UNIT',
        help='of its lengths: m, cm, mm, inch, foot, or how long it is [m] (what it says, or an '
        'adult measures)',
    )


def add_target(parser: argparse.ArgumentParser, text: str, required: bool = True) -> None:
    """Add the option of a target, with its help."""
    xyz = ('X', 'Y', 'Z')
    parser.add_argument(
        '--target', type=number('m'), nargs=3, required=required, metavar=xyz, help=text
    )


def add_mount(parser: argparse.ArgumentParser, text: str) -> None:
    """Add the option that says where an arm is worn, with its help."""
    pose = ('X', 'Y', 'Z', 'QX', 'QY', 'QZ', 'QW')
    parser.add_argument('--mount', type=number('m'), nargs=7, metavar=pose, help=text)


def run(name: str, action: Callable[[], int | None], failed: int) -> int:
    """Run a command; return its exit code: `failed` where it raises RrthError or OSError."""
    try:
        code = action()
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader, `head` say, has ended; Python must not fail as it flushes the rest at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OUTPUT_CLOSED
    except (RrthError, OSError) as problem:
        say(name, one_line(' '.join(str(problem).split())))
        return failed
    except KeyboardInterrupt:
        say(name, 'interrupted')
        return INTERRUPTED
    return code or 0


def interrupt_on_signals() -> None:
    """Turn the signals that end a process into an interrupt, so that everything is cleaned up."""

    def interrupt(*_: object) -> NoReturn:
        raise KeyboardInterrupt

    for one in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(one, interrupt)
