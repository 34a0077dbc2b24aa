# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Who hears messages leaves time to others, however many come."""

import time

# Who has run all of a stretch of time, but for so small a share of it, and that in so many
# stretches one after the other, rests after each of them [s, -, -, s].
STRETCH, SHARE, STRETCHES, REST = 5e-3, 0.2, 4, 5e-3


class Breather:
    """
    Has the thread that hears messages rest where they come without end.

    It shares its interpreter with the one that answers requests, which would hardly ever run.
    """

    def __init__(self) -> None:
        """Begin rested."""
        self._since = self._ran = 0.0
        self._n_full = 0

    def __call__(self) -> None:
        """Rest if need be; called by that thread, after each message."""
        now = time.monotonic()
        if now - self._since < STRETCH:
            return
        ran = time.thread_time()
        is_full = ran - self._ran > (1.0 - SHARE) * (now - self._since)
        # A single one may be a brake, or what a motion begins with.
        self._n_full = self._n_full + 1 if is_full else 0
        if self._n_full >= STRETCHES:
            time.sleep(REST)
            now = time.monotonic()
        self._since, self._ran = now, ran
