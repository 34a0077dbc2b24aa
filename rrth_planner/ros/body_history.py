# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The last arrays of the wearer's markers, so that one which comes late takes its place."""

from collections.abc import Sequence

from rrth_planner.ros.bodies import Edit, WearerBody

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
        self._heard: list[tuple[int, float, tuple[Edit, ...]]] = []
        self._has_forgotten = False

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
        if newer and len(newer) == len(self._heard) and self._has_forgotten:
            # Newer arrays may be forgotten: what they put there must not be lost.
            return body.with_older(edits, received)
        body = body.edited(edits, received)
        for _, time, later in newer:
            body = body.edited(later, time)
        older = self._heard[: len(self._heard) - len(newer)]
        self._heard = [*older, (sent, received, tuple(edits)), *newer]
        self._forget()
        return body.at(received)

    def _forget(self) -> None:
        """Keep to the arrays that were sent last."""
        n_boxes = n_kept = 0
        for _, _, edits in reversed(self._heard[-REMEMBERED:]):
            n_boxes += sum(1 if edit.part is None else len(edit.part.boxes) for edit in edits)
            if n_kept and n_boxes > REMEMBERED_BOXES:
                break
            n_kept += 1
        self._has_forgotten |= n_kept < len(self._heard)
        del self._heard[:-n_kept]
