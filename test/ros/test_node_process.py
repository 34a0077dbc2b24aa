# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How a process of one node ends: exit codes, a sentence where it cannot start, no error lost."""

import pytest

rclpy = pytest.importorskip('rclpy')

from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rrth_planner.model.errors import OptionsError
from rrth_planner.ros import body_boxes_node, playback_node
from rrth_planner.ros.middleware.node_process import run_node


def make():
    """Return a node."""
    return Node('some_node')


def ended(call, run=lambda node: None, create=make, arguments=()):
    """Return how a process ended that runs a node in some way."""
    return call(lambda args: run_node('some_node', create, run, ['main', *args]), *arguments)


def raises(problem):
    """Return a function that raises a problem, whatever it is called with."""

    def function(*_):
        raise problem

    return function


@pytest.mark.parametrize('end', [None, KeyboardInterrupt(), ExternalShutdownException()])
def test_a_signal_ends_it_well(call, end):
    result = ended(call, raises(end) if end else lambda node: None)
    assert (result.returncode, result.stderr) == (0, '')


def test_a_start_that_cannot_be_is_one_sentence(call):
    result = ended(call, create=raises(OptionsError('rate: -1, expected\na number > 0 [1/s]')))
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert line.endswith('[some_node]: cannot start: rate: -1, expected a number > 0 [1/s]')


def test_an_error_that_nobody_expected_is_not_lost(call):
    with pytest.raises(ZeroDivisionError):
        ended(call, raises(ZeroDivisionError()))
    # Only that of a callback which a signal interrupted is.
    assert ended(call, lambda node: rclpy.shutdown() or 1 / 0).returncode == 0


@pytest.mark.parametrize('main', [playback_node.main, body_boxes_node.main])
@pytest.mark.parametrize('arguments', [['--bogus'], ['-p', 'no_value'], ['-r', 'no_name']])
def test_arguments_that_ros_cannot_read_are_no_start(call, main, arguments, monkeypatch):
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    result = call(lambda args: main(['main', *args]), '--ros-args', *arguments)
    assert result.returncode == 1
    line = result.stderr.splitlines()[-1]
    assert 'cannot start: ' in line
    assert arguments[-1] in line
