# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which of the persons whom a tracker sees wears the arm."""

from collections.abc import Mapping

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, shown

# The person where there is only one, and the one who is nearest to the arm.
ONLY, NEAREST = -1, 'nearest'


class WearerChoice:
    """
    Chooses the wearer, and stays with him: nobody else becomes the wearer until `reset`.

    Parameters
    ----------
    person : int or str
        A number of the tracker; -1: the only one; `nearest`: who is nearest to the arm at first.
    arm_position : array_like, shape (3,)
        The arm's base in the frame of the tracker [m]; of `nearest`.

    """

    def __init__(self, person: int | str, arm_position: Array) -> None:
        """Begin without a wearer."""
        self._person, self._arm_position = person, np.asarray(arm_position, dtype=np.float64)
        self._wearer: int | None = None

    def reset(self) -> None:
        """Choose anew with the next message."""
        self._wearer = None

    def __call__(self, people: Mapping[int, Array]) -> int:
        """
        Return the number of the wearer among persons, whose points are (n, 3) [m].

        It is -1 where none can be chosen, and the number that is wanted where he is not there.

        Raises
        ------
        MessageError
            The persons are others than the one who was the wearer before.

        """
        if isinstance(self._person, int) and self._person != ONLY:
            return self._person
        if not people or (self._person == ONLY and len(people) > 1):
            return ONLY
        if self._wearer is None:
            self._wearer = min(people, key=lambda number: self._distance(people[number]))
        if self._wearer not in people:
            raise MessageError(
                f'persons {shown(sorted(people))}, expected person {self._wearer}, who is the '
                'wearer; if he has another number now, call ~/reset while nobody else is near'
            )
        return self._wearer

    def _distance(self, points: Array) -> float:
        distances = np.linalg.norm(points - self._arm_position, axis=1)
        seen = distances[~np.isnan(distances)]
        return float(np.median(seen)) if seen.size else np.inf
