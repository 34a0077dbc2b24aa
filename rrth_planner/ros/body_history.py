# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The last arrays of the wearer's markers, so that one which comes late takes its place."""

from collections import deque
from collections.abc import Sequence
from itertools import takewhile

from rrth_planner.ros.bodies import WearerBody
from rrth_planner.ros.edits import Edit

# So many arrays are remembered, and so many boxes at most.
REMEMBERED, REMEMBERED_BOXES = 100, 20_000


class BodyHistory:
    """
    Apply arrays of markers in the order in which they were sent.

    An array that is older than others, as a latched one may be, is applied, and the newer ones
    once more behind it.
    """

    def __init__(self) -> None:
        """Begin with nothing remembered."""
        self._heard: deque[tuple[int, float, tuple[Edit, ...]]] = deque()
        self._n_boxes, self._has_forgotten = 0, False

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
        # Nearly always none, so they are looked for from the end.
        newer = list(takewhile(lambda item: item[0] > sent, reversed(self._heard)))[::-1]
        if newer and len(newer) == len(self._heard) and self._has_forgotten:
            # Newer arrays may be forgotten: what they put there must not be lost.
            return body.with_older(edits, received)
        body = body.edited(edits, received)
        for _, time, later in newer:
            body = body.edited(later, time)
        self._heard.insert(len(self._heard) - len(newer), (sent, received, tuple(edits)))
        self._n_boxes += _n_boxes(edits)
        self._forget()
        return body.at(received)

    def _forget(self) -> None:
        """Keep to the arrays that were sent last."""
        while len(self._heard) > REMEMBERED or (
            self._n_boxes > REMEMBERED_BOXES and len(self._heard) > 1
        ):
            self._n_boxes -= _n_boxes(self._heard.popleft()[2])
            self._has_forgotten = True


def _n_boxes(edits: Sequence[Edit]) -> int:
    return sum(1 if edit.part is None else len(edit.part.boxes) for edit in edits)
