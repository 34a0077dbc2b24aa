# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer as boxes."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.arrays import Array, frozen_array
from rrth_planner.errors import SceneError

# Further out the slack of the certificates would no longer cover rounding.
FARTHEST = 1e4


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """
    One part of the wearer.

    Parameters
    ----------
    name : str
        How messages call it.
    center : array_like, shape (3,)
        Its centre in the base frame [m].
    size : array_like, shape (3,)
        Its full edge lengths along its own axes [m], all > 0.
    rotation : array_like, shape (3, 3)
        Its axes as columns, in the base frame.

    Raises
    ------
    SceneError
        A size that is not positive, a rotation that is none, a number that is not finite.

    """

    name: str
    center: Array
    size: Array
    rotation: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        label = f'box "{self.name}"'
        for field, shape in (('center', (3,)), ('size', (3,)), ('rotation', (3, 3))):
            value = frozen_array(
                getattr(self, field),
                shape,
                f'{label}: {field}',
                '-' if field == 'rotation' else 'm',
                SceneError,
            )
            object.__setattr__(self, field, value)
        if not (self.size > 0.0).all():
            raise SceneError(f'{label}: size {self.size.tolist()}, expected three lengths > 0 [m]')
        if max(np.abs(self.center).max(), self.size.max()) > FARTHEST:
            raise SceneError(
                f'{label}: center {self.center.tolist()}, size {self.size.tolist()}, expected '
                f'lengths up to {FARTHEST:g} [m]'
            )
        r = self.rotation
        if np.abs(r @ r.T - np.eye(3)).max() > 1e-6 or np.linalg.det(r) < 0.0:
            raise SceneError(f'{label}: rotation {r.tolist()}, expected a rotation matrix [-]')


@dataclass(frozen=True, slots=True)
class Scene:
    """The wearer: any number of boxes in the base frame."""

    boxes: tuple[Box, ...]

    def __post_init__(self) -> None:
        """Freeze the collection."""
        object.__setattr__(self, 'boxes', tuple(self.boxes))
