# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The messages that a node has received and not processed yet."""

from collections.abc import Iterator
import time
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription


def process_backlog(node: Node) -> Iterator[None]:
    """
    Process the messages that a node's readers hold, one callback at each step.

    In a round an executor takes one message from each reader. Only those count that have come
    before the first step: a flood of messages has no end. Called in the node's own thread.
    """
    begin = time.time_ns()
    for reader in list(node.subscriptions):
        # No more than these can have come before.
        for _ in range(max(1, reader.qos_profile.depth)):
            found = taken(reader)
            if found is None:
                break
            message, info = found
            has_info = reader._callback_type is Subscription.CallbackType.WithMessageInfo
            reader.callback(message, *((info,) if has_info else ()))
            yield
            # A callback may take further ones; not every middleware has this time.
            if (info.get('received_timestamp') or 0) > begin:
                break


def taken(reader: Subscription) -> tuple[Any, dict[str, Any]] | None:
    """Return the next message that a reader holds, and what the middleware says of it."""
    with reader.handle:
        found: tuple[Any, dict[str, Any]] | None = reader.handle.take_message(
            reader.msg_type, reader.raw
        )
    return found
