# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Messages from YAML files, as `ros2 topic pub` reads them."""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from rosidl_parser.definition import (  # type: ignore[import-untyped]
    AbstractNestedType,
    NamespacedType,
)
from rrth_planner.errors import MessageError
from rrth_planner.resources import load_yaml

Message = TypeVar('Message')


def message_from_file(path: str | Path, message_type: type[Message]) -> Message:
    """
    Return the message whose fields a YAML file holds; fields it does not name keep defaults.

    Raises
    ------
    RrthError
        The file cannot be read, or does not fit the message.

    """
    message = message_type()
    try:
        _fill(message, load_yaml(path))
    except (AssertionError, AttributeError, KeyError, TypeError, ValueError) as problem:
        raise MessageError(
            f'file {path}: {problem}; expected fields of {message_type.__name__}'
        ) from problem
    return message


def _fill(message: Any, values: Mapping[str, Any]) -> None:
    types = dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))
    for name, value in values.items():
        kind, present = types[name], getattr(message, name)
        if isinstance(kind, NamespacedType):
            _fill(present, value)
        elif isinstance(kind, AbstractNestedType):
            setattr(message, name, [_element(kind.value_type, item) for item in value])
        else:
            setattr(message, name, type(present)(value))


def _element(kind: Any, value: Any) -> Any:
    """Return an element of an array: a message, or a value as it is."""
    if not isinstance(kind, NamespacedType):
        return value
    message = getattr(import_module('.'.join(kind.namespaces)), kind.name)()
    _fill(message, value)
    return message
