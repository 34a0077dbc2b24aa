# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The last arrays of the wearer's markers, so that one which comes late takes its place."""

from collections.abc import Sequence

from rrth_planner.ros.bodies import Edit, WearerBody

# So many arrays are remembered.
REMEMBERED = 100


class BodyHistory:
    """
    Apply arrays of markers in the order in which they were sent.

    An array that is older than others, as a latched one may be, is applied, and the newer ones
    once more behind it.
    """

    def __init__(self) -> None:
        """Begin with nothing remembered."""
        self._heard: list[tuple[int, float, tuple[Edit, ...]]] = []

    def apply(
        self, body: WearerBody, edits: Sequence[Edit], sent: int, received: float
    ) -> WearerBody:
        """
        Return the body after an array, and remember it.

        Parameters
        ----------
        body : WearerBody
            As it is.
        edits : sequence of Edit
            Of the array.
        sent : int
            When it was sent, as far as its place among the others goes [ns].
        received : float
            When it came [s].

        Raises
        ------
        MessageError
            Too many boxes; nothing is remembered then.

        """
        newer = [item for item in self._heard if item[0] > sent]
        if newer and len(newer) == len(self._heard) == REMEMBERED:
            # Newer arrays may be forgotten: what they put there must not be lost.
            return body.with_older(edits, received)
        body = body.edited(edits, received)
        for _, time, later in newer:
            body = body.edited(later, time)
        older = self._heard[: len(self._heard) - len(newer)]
        self._heard = [*older, (sent, received, tuple(edits)), *newer][-REMEMBERED:]
        return body.at(received)
