# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the node said of the body, again and again, and when bodies were lost by that."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Look:
    """
    The body by one message of diagnostics.

    Parameters
    ----------
    time : int
        When it came [ns].
    age : float
        Of the body [s].
    n_heard, n_sent : int
        Bodies that the node had heard by then, and that had been sent when the message came.

    """

    time: int
    age: float
    n_heard: int
    n_sent: int


@dataclass(frozen=True, slots=True)
class Loss:
    """
    Bodies that were sent between two looks and never heard.

    Parameters
    ----------
    n : int
    begin, end : int
        The two looks [ns].

    """

    n: int
    begin: int
    end: int


def heard_by(figures: Mapping[str, str]) -> int:
    """Return how many bodies the node has heard, by its diagnostics."""
    return int(figures.get('good messages, body', 0))


def look_at(figures: Mapping[str, str], time: int, n_sent: int) -> Look:
    """Return what diagnostics say at a time [ns] when so many bodies were sent."""
    return Look(time, float(figures['age of body [s]']), heard_by(figures), n_sent)


def losses(looks: Sequence[Look], n_missing: int) -> list[Loss]:
    """
    Return when bodies were lost, of which so many were missing in the end.

    What is missing at a look may be on its way; what is still missing at all looks after it, and
    in the end, is lost.
    """
    if not looks:
        return []
    missing = [look.n_sent - look.n_heard for look in looks]
    lost = np.minimum.accumulate([n_missing, *reversed(missing)])[::-1].clip(min=0)
    times = [look.time for look in looks]
    # Before the first look and after the last one the time is unknown.
    spans = zip([times[0], *times], [*times, times[-1]], strict=True)
    return [
        Loss(int(n), begin, end)
        for n, (begin, end) in zip(np.diff(lost, prepend=0), spans, strict=True)
        if n > 0
    ]
