# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Declaration and validation of a node's parameters."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rrth_planner.model.errors import OptionsError

# The expected type in words, of a value and of the values of an array.
KINDS = {
    float: ('a number', 'numbers'),
    int: ('a whole number', 'whole numbers'),
    bool: ('true or false', 'true or false each'),
    str: ('a text', 'texts'),
}
# What ROS itself declares on every node.
OF_ROS = ('use_sim_time', 'start_type_description_service')


@dataclass(frozen=True, slots=True)
class Setting:
    """
    One parameter: its name, default, unit, meaning, and range (None: no range).

    is_dynamic: of any type, as a text that may also be true or false, which YAML takes for no
    text; whoever reads it checks the value.
    """

    name: str
    default: Any
    unit: str
    description: str
    low: float | None = None
    high: float | None = None
    is_read_only: bool = False
    is_dynamic: bool = False

    @property
    def descriptor(self) -> ParameterDescriptor:
        """For `ros2 param describe`; a step other than 0 would reject values."""
        msg = ParameterDescriptor(
            description=f'{self.description} [{self.unit}]',
            read_only=self.is_read_only,
            dynamic_typing=self.is_dynamic,
        )
        if self.low is None or self.high is None:
            return msg
        if isinstance(self.default, int):
            msg.integer_range = [IntegerRange(from_value=self.low, to_value=self.high)]
        else:
            msg.floating_point_range = [
                FloatingPointRange(from_value=float(self.low), to_value=float(self.high))
            ]
        return msg

    def check(self, value: Any) -> None:
        """Raise OptionsError when a value is not of the default's type, or out of range."""
        if self.is_dynamic:
            return
        is_array = isinstance(self.default, list)
        kind = type(self.default[0] if is_array else self.default)
        # An empty array comes as None; others as arrays of Python's or as lists.
        is_given_array = isinstance(value, Iterable | None) and not isinstance(value, str)
        given = list(value or ()) if is_given_array else [value]
        if is_given_array is is_array and given and all(type(v) is kind for v in given):
            if self.low is None or self.high is None:
                return
            if all(self.low <= v <= self.high for v in given):
                return
        expected = KINDS[kind][is_array]
        if self.low is not None and self.high is not None:
            expected += f' from {self.low:.10g} to {self.high:.10g}'
        hint = ''
        if kind is float and is_given_array is is_array and any(type(v) is int for v in given):
            # ROS does not convert an integer to a double.
            numbers = [float(v) if type(v) is int else v for v in given]
            hint = f': write {numbers if is_array else numbers[0]}'
        shown = given if is_given_array else f'"{value}"' if isinstance(value, str) else value
        raise OptionsError(f'{self.name}: {shown}, expected {expected} [{self.unit}]{hint}')


ARM = Setting(
    'arm',
    '',
    'path of a YAML file',
    'the arm, as config/arm.yaml; empty: that one',
    is_read_only=True,
)


def reject_unknown(node: Node, known: Sequence[Setting]) -> None:
    """Raise OptionsError when a node was started with a parameter that it does not have."""
    names = [*(setting.name for setting in known), *OF_ROS]
    for name in _overrides(node):
        if name not in names and not name.startswith('qos_overrides.'):
            near = get_close_matches(name, names, 1, 0.0)[0]
            raise OptionsError(f'{name}: no such parameter, the closest name is {near}')


def declare(node: Node, known: Sequence[Setting]) -> None:
    """Declare parameters on a node, or raise OptionsError at a bad value of the start."""
    given = _overrides(node)
    for setting in known:
        if setting.name in given:
            setting.check(given[setting.name].value)
        node.declare_parameter(setting.name, setting.default, setting.descriptor)


def _overrides(node: Node) -> Mapping[str, Parameter]:
    """Return the overrides of a node; rclpy has no public way to get all of them."""
    return node._parameter_overrides
