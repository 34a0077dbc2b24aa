# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of many parts from their bytes, in half the time that rclpy takes."""

from collections.abc import Callable
from typing import Any

from rclpy.serialization import deserialize_message
from rrth_planner.ros.messages.definitions import definition_of, type_name


def quick_decoder(msg_type: type) -> Callable[[bytes], Any]:
    """
    Return what turns the bytes of a message into one with the same fields.

    rosbags makes its code from the definition of the type that is installed here; its messages
    are of its own types. What it does not take, rclpy is asked for, which raises where it does
    not either; it does all where rosbags or the definition is not installed.
    """
    try:
        return _decoder_of(msg_type)
    except Exception:
        # It is quicker, that is all: no node stays away for it.
        return lambda data: deserialize_message(data, msg_type)


def _decoder_of(msg_type: type) -> Callable[[bytes], Any]:
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    store, name = get_typestore(Stores.EMPTY), type_name(msg_type)
    types = get_types_from_msg(definition_of(msg_type), name)
    # Constants would be set anew in each message.
    store.register({kind: ([], fields) for kind, (_, fields) in types.items()})
    for kind in types:
        # Made now, not when the first message waits for it.
        _ = store.get_msgdef(kind).deserialize_cdr_le

    def decode(data: bytes) -> Any:
        try:
            return store.deserialize_cdr(data, name)
        except Exception:
            # Strings without an end, say, or bytes after the last: rclpy is less strict.
            return deserialize_message(data, msg_type)

    return decode
