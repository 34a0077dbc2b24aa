# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A bad number of any command is answered by what was expected, and by the unit of its help."""

import argparse
from importlib import import_module
import re

import pytest
from rrth_planner.cli.numbers import integer, number, number_of_runs, number_of_workers
from rrth_planner.cli.parsers import simulate
from rrth_planner.cli.rrth import COMMANDS

UNIT = re.compile(r'\[([^\]]+)\]')


def options_of(parser):
    """Yield all options and arguments of a parser, those of subcommands included."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from options_of(command)
        else:
            yield action


def numbers():
    """Return (command, option) of all that take numbers: whatever reads 1 as one."""
    found = []
    for name in (name for name, command in COMMANDS.items() if not command.settings):
        for option in options_of(import_module(f'rrth_planner.cli.parsers.{name}').parser()):
            if option.type is not None and option.type('1') == 1:
                found.append(pytest.param(option, id=f'{name} {option.dest}'))
    assert len(found) > 30
    return found


@pytest.mark.parametrize('option', numbers())
def test_a_bad_number_is_answered_with_its_unit(option):
    has_unit = option.type not in (integer, number_of_runs, number_of_workers)
    for text in ('two', '1 m', '', 'nan', '-inf'):
        with pytest.raises(argparse.ArgumentTypeError) as said:
            option.type(text)
        assert f'{said.value}'.replace('"', '').startswith(f'{text}, expected a')
        if has_unit:
            assert UNIT.findall(f'{said.value}') == UNIT.findall(option.help)[:1] != []


def test_a_number_is_finite_and_above_its_bound():
    assert number('m')('-1e-3') == -0.001
    for text, kind, expected in (
        ('inf', number('s'), 'inf, expected a finite number [s]'),
        ('0', number('kg', above=0.0), '0, expected a number > 0 [kg]'),
        ('x', number('kg', above=0.0), '"x", expected a number > 0 [kg]'),
        ('1.5', integer, '"1.5", expected an integer'),
        ('0', number_of_runs, '"0", expected a number of runs of 1 or more'),
        ('two', number_of_workers, '"two", expected a number of workers of 1 or more'),
    ):
        with pytest.raises(argparse.ArgumentTypeError, match=f'^{re.escape(expected)}$'):
            kind(text)


def test_the_sentence_reaches_the_user(capsys):
    with pytest.raises(SystemExit) as end:
        simulate.parser().parse_args(['--lag', '0'])
    assert end.value.code == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.endswith('argument --lag: 0, expected a number > 0 [m]')
