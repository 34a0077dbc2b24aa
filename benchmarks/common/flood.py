# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A topic that is flooded with one and the same message, by a process of its own."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rrth_planner.ros.messages.definitions import type_name, type_of_name
from rrth_planner.ros.middleware.child_process import ChildProcess

# Messages in a second [Hz]; what could not be sent for longer than this is not made up for [s].
RATE, LATE = 2000.0, 0.1


class Flood(ChildProcess):
    """
    Floods a topic while it is entered.

    Parameters
    ----------
    topic : str
        With its namespace.
    message : object
        What is published.
    folder : Path
        For its bytes, and the file that it is counted in.
    rate : float
        Messages in a second [Hz]; inf: as many as the process can.

    """

    def __init__(self, topic: str, message: Any, folder: Path, rate: float = RATE) -> None:
        """Count from 0."""
        data, counter = folder / 'message', folder / 'counter'
        data.write_bytes(serialize_message(message))
        self._count = np.memmap(counter, dtype=np.int64, mode='w+', shape=())
        arguments = [type_name(type(message)), topic, str(data), str(counter), str(rate)]
        super().__init__('benchmarks.common.flood', arguments, lambda _: None)

    @property
    def count(self) -> int:
        """How many messages were published."""
        return int(self._count)


def main(arguments: Sequence[str]) -> None:
    """Publish until it is interrupted: type, topic, a file with the message, a counter, rate."""
    kind, topic, data, counter, rate = arguments
    rclpy.init()
    profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
    publisher = Node('flood').create_publisher(type_of_name(kind), topic, profile)
    message = Path(data).read_bytes()
    count = np.memmap(counter, dtype=np.int64, mode='r+', shape=())
    due = time.monotonic()
    while True:
        publisher.publish(message)
        count[...] += 1
        now = time.monotonic()
        due = max(due + 1.0 / float(rate), now - LATE)
        if due > now:
            time.sleep(due - now)


if __name__ == '__main__':
    with suppress(KeyboardInterrupt):
        main(sys.argv[1:])
