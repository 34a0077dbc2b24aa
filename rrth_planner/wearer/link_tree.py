# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer of whom a tracker measures the angles of his joints: the links between them."""

from collections import Counter
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError
from rrth_planner.model.frozen import Frozen

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Link(Frozen):
    """
    A link, and the joint that leads to it.

    Parameters
    ----------
    parent : str
        The link before the joint; empty: this is the root.
    joint : str
        Empty: it does not move.
    origin : ndarray, shape (4, 4)
        Pose of the link in its parent while the joint is at 0.
    axis : ndarray, shape (3,)
        Of unit length, in the frame of the link: it turns about it, or slides along it.
    is_prismatic : bool

    """

    name: str
    parent: str
    joint: str
    origin: Array
    axis: Array
    is_prismatic: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class LinkTree:
    """
    Links that joints connect to a tree.

    Raises
    ------
    ModelError
        No link, a link or joint that comes twice, a parent that is none, a link that is connected
        to no root, or to one of several.

    """

    links: tuple[Link, ...]

    def __post_init__(self) -> None:
        """Validate."""
        names = {link.name: link for link in self.links}
        for what, given in (
            ('link', [link.name for link in self.links]),
            ('joint', [link.joint for link in self.links if link.joint]),
        ):
            twice = [name for name, n in Counter(given).items() if n > 1]
            if twice:
                raise ModelError(f'{what} "{twice[0]}": given twice, expected each once')
        for link in self.links:
            if link.parent and link.parent not in names:
                raise ModelError(f'link "{link.name}": no parent "{link.parent}", expected a link')
        roots = [link.name for link in self.links if not link.parent]
        if len(roots) != 1:
            raise ModelError(f'roots: {roots}, expected one link without a parent')
        for link in self.links:
            above, n = link, 0
            while above.parent:
                above, n = names[above.parent], n + 1
                if n > len(names):
                    raise ModelError(f'link "{link.name}": is its own ancestor, expected a tree')

    @property
    def names(self) -> tuple[str, ...]:
        """Of the links."""
        return tuple(link.name for link in self.links)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move, in the order of their links."""
        return tuple(link.joint for link in self.links if link.joint)


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """
    A tree as arrays, a row for each link.

    `places` is the column of its joint's position, the last one where it does not move; `cross`
    and `squared` are the cross product with its axis, and that twice; `levels` the links that are
    equally far from the root, and their parents.
    """

    places: Indices
    origins: Array
    axes: Array
    cross: Array
    squared: Array
    is_prismatic: NDArray[np.bool_]
    root: int
    levels: tuple[tuple[Indices, Indices], ...]


def link_poses(tree: LinkTree, positions: Array) -> tuple[Array, Array]:
    """
    Return rotations, (n, 3, 3), and origins, (n, 3) [m], of all links in the frame of the root.

    Parameters
    ----------
    positions : ndarray, shape (n_joints,)
        Of `tree.joints` [rad or m]; NaN where unknown, as then are the links beyond.

    """
    layout = _layout(tree)
    q = np.append(positions, 0.0)[layout.places]
    angles = np.where(layout.is_prismatic, 0.0 * q, q)[:, None, None]
    # The formula of Rodrigues.
    turns = np.eye(3) + np.sin(angles) * layout.cross + (1.0 - np.cos(angles)) * layout.squared
    slides = np.where(layout.is_prismatic, q, 0.0)[:, None] * layout.axes
    rotations = layout.origins[:, :3, :3] @ turns
    places = layout.origins[:, :3, 3] + (layout.origins[:, :3, :3] @ slides[:, :, None])[:, :, 0]
    rotations[layout.root], places[layout.root] = np.eye(3), 0.0
    for links, parents in layout.levels:
        R = rotations[parents]
        places[links] = places[parents] + (R @ places[links][:, :, None])[:, :, 0]
        rotations[links] = R @ rotations[links]
    return rotations, places


@lru_cache(maxsize=4)
def _layout(tree: LinkTree) -> _Layout:
    number = {link.name: k for k, link in enumerate(tree.links)}
    column = {joint: k for k, joint in enumerate(tree.joints)}
    axes = np.array([link.axis for link in tree.links])
    # Its columns are the products with the axes of the link.
    cross = np.swapaxes(np.cross(axes[:, None], np.eye(3)[None]), 1, 2)
    # Sorted by their distance from the root, which is above all.
    levels, above = [], {''}
    while members := [link for link in tree.links if link.parent in above]:
        above = {link.name for link in members}
        levels.append(members)
    return _Layout(
        places=np.array([column.get(link.joint, len(column)) for link in tree.links]),
        origins=np.array([link.origin for link in tree.links]),
        axes=axes,
        cross=cross,
        squared=cross @ cross,
        is_prismatic=np.array([link.is_prismatic for link in tree.links]),
        root=number[levels[0][0].name],
        levels=tuple(
            (
                np.array([number[link.name] for link in members]),
                np.array([number[link.parent] for link in members]),
            )
            for members in levels[1:]
        ),
    )
