# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `replay`."""

import argparse
from pathlib import Path

from rrth_planner.cli.program import command_parser

DESCRIPTION = """\
Replay an incident of the planner: a certified motion in which the second checker found a clearance
violation, or an unexpected error. Neither is ever published; the node answers FAILURE and names
the file that this command reads. The command plans again from the same inputs with the same seed,
reports whether the motion is identical to the bit, and checks each piece of the recorded motion
by three collision checkers: the certificate, the second checker (python-fcl or coal), and the
reference checker, which is plain numpy and shares nothing with the others. It needs no ROS.
"""
EPILOG = """\
Of a flight record (*.flight, the last half minute of the monitor) each event is decided about
again: what the monitor did is printed, and whether each command is the same, to the bit.

exit codes: 0  reproduced as recorded
            1  not reproduced (the difference is printed)
            2  the file is no record (the reason is printed)

A plan that reached a time limit (time_limit, improve_time) may differ on another machine, and
other versions of the libraries may round differently; differing versions are printed.

example:    %(prog)s ~/.ros/log/rrth_planner/incident-20261121T213655123456-1f0c2a.yaml
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('replay', DESCRIPTION, EPILOG)
    command.add_argument(
        'file', type=Path, metavar='FILE', help='incident (YAML) or flight record'
    )
    return command
