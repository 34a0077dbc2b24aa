# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Arguments of the command `rehearse`."""

import argparse
from pathlib import Path

from rrth_planner.cli.numbers import integer, number
from rrth_planner.cli.program import command_parser

DESCRIPTION = """\
Rehearse a scenario in virtual time, without ROS: a wearer, his tracker, the planner, the monitor
of the node, a controller and an arm. Times are numbers: the same scenario has the same course,
and the same digest of all decisions of the monitor, whatever else the machine does. Printed is
what became of each target, where time was lost, and the contacts of the arm with the wearer as he
really is.
"""
EPILOG = """\
scenarios that come along, by name or as a file to be copied (config/scenarios):
  recorded_person    targets low in front of a person at work
  intercepting_hand  a hand goes for the tool of the arm
  lagging_arm        an arm far behind its command
  lost_hand          a tracker loses a hand, and frames
  dead_planner       a planner gives no answers for a while

exit codes: 0  no contact faster than contact_speed with a part that got no further than assumed
            1  there was one
            2  the scenario cannot be rehearsed (the reason is printed)

examples:   %(prog)s recorded_person
            %(prog)s my_scenario.yaml --seed 3 --seconds 600 --plot course.svg
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all arguments."""
    command = command_parser('rehearse', DESCRIPTION, EPILOG)
    add = command.add_argument
    add('scenario', metavar='SCENARIO', help='a file (YAML), or the name of one that comes along')
    add('--seed', type=integer, metavar='N', help='another seed than that of the scenario')
    add(
        '--seconds',
        type=number('s', above=0.0),
        metavar='S',
        help='another length in virtual time [s]',
    )
    add(
        '--plot',
        type=Path,
        metavar='FILE',
        help='draw distance, rate and state over time: .png, .svg or .pdf',
    )
    return command
