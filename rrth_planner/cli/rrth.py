# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The one command of an installation by pip: every other command is a subcommand of it."""

import argparse
from collections.abc import Sequence
from importlib import import_module
from itertools import takewhile
import sys
from typing import Any, NamedTuple

from rrth_planner import __version__
from rrth_planner.cli.program import command_parser, say
from rrth_planner.io.extras import require, ROS
from rrth_planner.io.resources import resource_path
from rrth_planner.model.errors import NotInstalledError

HELP = ('-h', '--help')
# What follows is no option of a command.
ENDS = ('--ros-args', '--')
WRONG = 2
NODE_HELP = """\
Arguments after --ros-args are passed to ROS: parameters (-p seed:=1, --params-file FILE), remaps,
the namespace. All parameters, with units, ranges and defaults, are in
  {}
"""


class Command(NamedTuple):
    """A command: what it does, for the list of all, and what it requires."""

    summary: str
    # With its `main`; its parser is in the module of `cli.parsers` that has its name.
    module: str
    # Libraries that it requires before it is loaded, and the extras that install them.
    needs: tuple[str, ...] = ()
    extras: str = ''
    # The parameters of a node, which has no arguments of its own.
    settings: str = ''


COMMANDS = {
    'plan': Command('plan a motion from files, without ROS', 'cli.plan'),
    'campaign': Command('plan files of many queries on a cluster', 'cli.campaign'),
    'plot': Command('draw a motion or a recording', 'cli.plot'),
    'viewer': Command('show the planner in the browser', 'cli.viewer'),
    'read_urdf': Command('import an arm from a URDF', 'cli.read_urdf'),
    'write_urdf': Command('write the arm as a URDF', 'cli.write_urdf'),
    'replay': Command('replay an incident', 'cli.replay'),
    'rehearse': Command('rehearse a scenario in virtual time', 'cli.rehearse'),
    'reproduce': Command("regenerate the paper's comparison", 'cli.reproduce'),
    'planner_node': Command(
        'run the planner as a ROS node', 'ros.planner_node', (ROS,), 'ros', 'config/planner.yaml'
    ),
    'playback_node': Command(
        'run a kinematic arm as a ROS node',
        'ros.playback_node',
        (ROS,),
        'ros',
        'config/playback.yaml',
    ),
    'simulation_node': Command(
        'run a simulated arm with masses as a ROS node',
        'ros.simulation_node',
        (ROS, 'mujoco'),
        'ros,simulation',
        'config/simulation.yaml',
    ),
    'body_boxes_node': Command(
        'make boxes of a tracked wearer as a ROS node',
        'ros.body_boxes_node',
        (ROS,),
        'ros',
        'config/body_boxes.yaml',
    ),
    'point_at': Command(
        'point the arm and wait until it has arrived', 'cli.point_at', (ROS, 'tqdm'), 'ros,tools'
    ),
    'wearer': Command('publish a recorded person as the wearer', 'cli.wearer', (ROS,), 'ros'),
    'simulate': Command(
        'run planner, simulated arm, person and moving target',
        'cli.simulate',
        (ROS, 'mujoco'),
        'ros,simulation',
    ),
    'record': Command(
        'record a run of the nodes in an MCAP file',
        'cli.record',
        (ROS, 'mcap', 'tqdm'),
        'ros,tools',
    ),
    'demo': Command(
        'run both nodes beside a person at work; check and draw the motions',
        'cli.demo',
        (ROS, 'matplotlib'),
        'ros',
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] not in COMMANDS:
        # Exits here: --help, --version or a usage error.
        _parser().parse_args(given[:1] or ['--help'])
    name, rest = given[0], given[1:]
    command = COMMANDS[name]
    own = list(takewhile(lambda word: word not in ENDS, rest))
    if not set(own).isdisjoint(HELP):
        # Exits here, and nothing beyond the standard library has been loaded.
        _parser_of(name).parse_args(own)
    try:
        require(command.extras, *command.needs)
    except NotInstalledError as problem:
        say(name, str(problem))
        return WRONG
    module: Any = import_module(f'rrth_planner.{command.module}')
    return int(module.main(rest))


def _parser_of(name: str) -> argparse.ArgumentParser:
    """Return the parser of a command, without loading what the command needs."""
    command = COMMANDS[name]
    parser: argparse.ArgumentParser
    if not command.settings:
        parser = import_module(f'rrth_planner.cli.parsers.{name}').parser()
        return parser
    help_of_node = NODE_HELP.format(resource_path(command.settings))
    parser = command_parser(
        name, f'{command.summary[0].upper()}{command.summary[1:]}.', help_of_node
    )
    parser.usage = '%(prog)s [--ros-args ...]'
    return parser


def _parser() -> argparse.ArgumentParser:
    lists: dict[str, list[str]] = {}
    for name, command in COMMANDS.items():
        title = 'commands that need ROS 2 Jazzy' if ROS in command.needs else 'commands'
        lists.setdefault(title, []).append(f'  {name:16} {command.summary}')
    epilog = '\n\n'.join('\n'.join([f'{title}:', *lines]) for title, lines in lists.items())
    parser = argparse.ArgumentParser(
        prog='rrth',
        usage='%(prog)s COMMAND ...',
        description='Motion planner for a body-worn pointing arm.',
        epilog=f'{epilog}\n\nrrth COMMAND --help describes each command.',
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    parser.add_argument('command', metavar='COMMAND', choices=COMMANDS, help='one of these:')
    return parser


if __name__ == '__main__':
    sys.exit(main())
