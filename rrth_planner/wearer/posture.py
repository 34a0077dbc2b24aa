# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a tracker sees of a person at one time."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.model.frozen import Frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Posture(Frozen):
    """
    Where the points of a skeleton are, in the frame of the tracker.

    Parameters
    ----------
    names : tuple of str
        As the tracker calls them.
    positions : ndarray, shape (n, 3)
        [m]; NaN where a point is lost.
    rotations : ndarray, shape (n, 3, 3), or None
        Axes of the frame at each point, as columns; NaN where unknown. None: points only.

    Raises
    ------
    SceneError
        Arrays of other shapes, or a name that comes twice.

    """

    names: tuple[str, ...]
    positions: Array
    rotations: Array | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        n = len(self.names)
        if len(set(self.names)) < n:
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise SceneError(f'point "{twice}": given twice, expected each name once')
        for name, shape in (('positions', (n, 3)), ('rotations', (n, 3, 3))):
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise SceneError(f'{name}: shape {np.shape(value)}, expected {shape}')
        Frozen.__post_init__(self)
