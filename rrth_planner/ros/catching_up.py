# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Wait until a node has read what came: what it then judges is the newest that there is."""

from collections.abc import Callable
from threading import Event
import time

from rclpy.executors import Executor

# A node that is busy for longer is not waited for [s], nor one that hears more than it can read.
LONGEST, MOST_ROUNDS = 0.25, 5


def catch_up(executor: Executor | None, heard: Callable[[], tuple[int, int]]) -> bool:
    """
    Return when an executor has handled the messages that came before; True if it has in time.

    In one round an executor handles one message of each subscription. It is through with them
    once it has handled one that came later, or none for a round.

    Parameters
    ----------
    executor : Executor or None
        Which spins in another thread; without, there is nobody to wait for.
    heard : callable
        Returns how many messages were handled, and when the last of them came [ns]; called by the
        executor.

    """
    if executor is None:
        return False
    begin, is_over = time.time_ns(), Event()
    counts: list[int] = []

    def look() -> None:
        count, arrived = heard()
        if arrived >= begin or counts[-1:] == [count] or len(counts) == MOST_ROUNDS:
            is_over.set()
        elif not is_over.is_set():
            counts.append(count)
            # After a round: tasks come first, then what is ready.
            executor.create_task(look)

    try:
        executor.create_task(look)
    except Exception:
        # What an executor that was shut down raises depends on how far it has come with that.
        return False
    is_in_time = is_over.wait(LONGEST)
    is_over.set()
    return is_in_time
