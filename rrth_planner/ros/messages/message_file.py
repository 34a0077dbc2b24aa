# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Messages from YAML files, as `ros2 topic pub` reads them."""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from rosidl_parser.definition import (  # type: ignore[import-untyped]
    AbstractGenericString,
    AbstractNestedType,
    NamespacedType,
)
from rrth_planner.io.entries import sequence, text, whole
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.errors import MessageError, shown

Message = TypeVar('Message')
# Of the integers of messages; rclpy itself takes any, and fails when it sends them.
BITS = (8, 16, 32, 64)
RANGES = {
    **{f'int{n}': (-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in BITS},
    **{f'uint{n}': (0, 2**n - 1) for n in BITS},
}


def message_from_file(path: str | Path, message_type: type[Message]) -> Message:
    """
    Return the message whose fields a YAML file holds; fields it does not name keep defaults.

    Raises
    ------
    RrthError
        The file cannot be read, or does not fit the message.

    """
    data = load_yaml(path)
    try:
        return message_from_mapping(data, message_type)
    except MessageError as problem:
        raise MessageError(f'file {path}: {problem}') from problem


def message_from_mapping(data: Any, message_type: type[Message], name: str = '') -> Message:
    """Return the message whose fields a mapping, so named, holds, or raise MessageError."""
    message: Any = message_type()
    types = dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))
    kind = message_type.__name__
    if not isinstance(data, Mapping):
        raise MessageError(f'{name or kind}: {shown(data)}, expected fields of {kind}')
    for key, value in data.items():
        if key not in types:
            raise MessageError(
                f'{name or kind}: {key}, expected fields of {kind}: {", ".join(types)}'
            )
        setattr(message, key, _value(types[key], value, f'{name}.{key}' if name else key))
    return message


def _value(kind: Any, value: Any, name: str) -> Any:
    """Return the value of a field or an element of one: of its type, or raise MessageError."""
    if isinstance(kind, NamespacedType):
        message_type = getattr(import_module('.'.join(kind.namespaces)), kind.name)
        return message_from_mapping(value, message_type, name)
    if isinstance(kind, AbstractNestedType):
        return [
            _value(kind.value_type, item, f'{name}[{i}]')
            for i, item in enumerate(sequence(value, name, MessageError))
        ]
    if isinstance(kind, AbstractGenericString):
        return text(value, name, MessageError)
    if kind.typename == 'boolean':
        if not isinstance(value, bool):
            raise MessageError(f'{name}: {shown(value)}, expected true or false')
        return value
    if kind.typename in ('float', 'double'):
        # NaN and inf may be sent, too, to see them rejected.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise MessageError(f'{name}: {shown(value)}, expected a number')
        return float(value)
    low, high = RANGES[kind.typename]
    if not low <= whole(value, name, MessageError) <= high:
        raise MessageError(f'{name}: {value}, expected a {kind.typename} from {low} to {high}')
    return value
