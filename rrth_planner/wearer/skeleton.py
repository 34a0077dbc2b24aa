# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Of which points of a tracker the parts of the wearer are made, and where his base frame is."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import printable, SceneError, shown
from rrth_planner.model.frozen import Frozen

# The axes of boxes and of the base frame, in this order.
AXES = ('forward', 'left', 'up')
# The joint that every skeleton has: the origin of the base frame. No joint is called like an axis.
BASE = 'base'
# Shorter directions are none.
SHORTEST = 1e-6
# Axes of a frame are perpendicular up to this.
ORTHOGONAL = 1e-6
# Where a limb points whose box is turned least, unless its part says so: forward and down. No
# leg points the opposite way.
REST = (1.0, 0.0, -1.0)
# Nothing on a wearer is longer [m].
LONGEST = 5.0
# Of the smallest and the largest adult of ANSUR II, 1.409 and 1.993, rounded away from each
# other [m].
STATURES = (1.4, 2.0)
# What may be said of a wearer [m].
LEAST_STATURE, MOST_STATURE = 0.5, 2.8


@dataclass(frozen=True, slots=True, eq=False)
class Joint(Frozen):
    """
    A joint of the wearer: the mean of points of the tracker, or a place in one of its frames.

    Parameters
    ----------
    points : tuple of str
        As the tracker calls them.
    offset : array_like, shape (3,), or None
        From the frame at the only point, to the front, left and top of a wearer whose frames all
        stand as `Skeleton.axes` says [m]. None: at the points, whose rotations are not needed.

    Raises
    ------
    SceneError
        No point; an offset from a mean, or one that is no vector of at most 5 m.

    """

    name: str
    points: tuple[str, ...]
    offset: Array | None = None

    def __post_init__(self) -> None:
        """Validate and freeze."""
        label = f'joint "{printable(self.name, "name of a joint", SceneError)}"'
        for point in self.points:
            printable(point, f'{label}: point', SceneError)
        if not self.points:
            raise SceneError(f'{label}: no point, expected at least one of the tracker')
        if self.offset is not None:
            if len(self.points) > 1:
                raise SceneError(
                    f'{label}: an offset from {len(self.points)} points, expected one frame'
                )
            _freeze(self, 'offset', (3,), f'{label}: offset')


@dataclass(frozen=True, slots=True)
class Direction:
    """
    An axis, `forward`, `left` or `up`, that leads from a joint to another one.

    Raises
    ------
    SceneError
        Another axis, or the same joint twice.

    """

    axis: str
    start: str
    end: str

    def __post_init__(self) -> None:
        """Validate."""
        if self.axis not in AXES:
            raise SceneError(f'axis {shown(self.axis)}, expected one of {", ".join(AXES)}')
        if self.start == self.end:
            raise SceneError(
                f'axis {self.axis}: from "{self.start}" to itself, expected two joints'
            )


@dataclass(frozen=True, slots=True, eq=False)
class Part(Frozen):
    """
    A part of the wearer: the box round joints, with margins, turned as directions say.

    Parameters
    ----------
    joints : tuple of str
        The box surrounds all of them; `base` is the origin of the base frame.
    margins : array_like, shape (3, 2)
        How far it reaches beyond the outermost joints: backward and forward, right and left, down
        and up, along its own axes, each >= 0 [m]. They are lengths of the body, not of the bones
        between its joints, which are measured.
    axes : tuple of Direction
        None: the box keeps the axes of the base frame. One: that is an axis of the box, which is
        turned round it the shortest way: for limbs that are as wide as deep. Two: the first is an
        axis of the box, the second another one once it is made perpendicular.
    rest : array_like, shape (3,)
        The direction in the base frame from which a box with one direction is turned. Where a
        limb passes the opposite direction, its box turns round it suddenly, so no limb should.

    Raises
    ------
    SceneError
        No joint, more directions, two of the same axis, margins that leave no box, a rest of no
        length.

    """

    name: str
    joints: tuple[str, ...]
    margins: Array
    axes: tuple[Direction, ...] = ()
    rest: Array = field(default_factory=lambda: np.array(REST))

    def __post_init__(self) -> None:
        """Validate and freeze."""
        label = f'part "{printable(self.name, "name of a part", SceneError)}"'
        if not self.joints:
            raise SceneError(f'{label}: no joints, expected at least one')
        _freeze(self, 'margins', (3, 2), f'{label}: margins')
        if self.margins.min() < 0.0 or not (self.margins.sum(axis=1) > 0.0).all():
            raise SceneError(
                f'{label}: margins {shown(self.margins.tolist())}, expected lengths >= 0, one of '
                'each pair > 0 [m]'
            )
        _check_axes(self.axes, label)
        _freeze(self, 'rest', (3,), f'{label}: rest', '-')
        if np.linalg.norm(self.rest) < SHORTEST:
            raise SceneError(f'{label}: rest {self.rest.tolist()}, expected a direction [-]')


@dataclass(frozen=True, slots=True, eq=False)
class Bone(Frozen):
    """
    What a person has between two joints, by which a posture is judged.

    Parameters
    ----------
    start, end : str
        Joints, or `base`; the end is further from the trunk.
    shares : array_like, shape (2,)
        Its least and its greatest length over the stature of whom it belongs to [-].
    is_trunk : bool
        Whether both ends belong to the trunk.

    Raises
    ------
    SceneError
        The same joint twice, or shares that are none, 0 to 1 in their order.

    """

    name: str
    start: str
    end: str
    shares: Array
    is_trunk: bool = False

    def __post_init__(self) -> None:
        """Validate and freeze."""
        label = f'bone "{printable(self.name, "name of a bone", SceneError)}"'
        if self.start == self.end:
            raise SceneError(f'{label}: from "{self.start}" to itself, expected two joints')
        _freeze(self, 'shares', (2,), f'{label}: share', '-')
        if not 0.0 <= self.shares[0] < self.shares[1] <= 1.0:
            raise SceneError(
                f'{label}: share {self.shares.tolist()}, expected the least and the greatest of '
                'the stature, 0 to 1 [-]'
            )


@dataclass(frozen=True, slots=True, eq=False)
class FrameBase(Frozen):
    """
    The base frame of a wearer whose chest is a frame of the tracker.

    Parameters
    ----------
    frame : str
        As the tracker calls it.
    offset : array_like, shape (3,)
        From there to the origin, along the axes of the base frame [m].

    Raises
    ------
    SceneError
        A name that is not printable, or an offset that is no vector of at most 5 m.

    """

    frame: str
    offset: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        printable(self.frame, 'base: frame', SceneError)
        _freeze(self, 'offset', (3,), 'base: offset')


@dataclass(frozen=True, slots=True, eq=False)
class JointBase(Frozen):
    """
    The base frame of a wearer of whom there are points only.

    Parameters
    ----------
    origin : str
        A joint.
    offset : array_like, shape (3,)
        From there to the origin, along the axes of the base frame [m].
    axes : tuple of Direction
        Two: the first one exactly, the second once it is made perpendicular.

    Raises
    ------
    SceneError
        Fewer or more than two directions, both of one axis, or an offset that is no vector.

    """

    origin: str
    offset: Array
    axes: tuple[Direction, ...]

    def __post_init__(self) -> None:
        """Validate and freeze."""
        _freeze(self, 'offset', (3,), 'base: offset')
        _check_axes(self.axes, 'base')
        if len(self.axes) != 2:
            raise SceneError(f'base: {len(self.axes)} axes, expected two')


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Skeleton(Frozen):
    """
    How the points of a tracker become boxes round the wearer.

    Parameters
    ----------
    joints : tuple of Joint
    parts : tuple of Part
    base : FrameBase, JointBase or None
        None: the tracker reports in the base frame.
    axes : array_like, shape (3, 3)
        Where front, left and top of a wearer who stands as the tracker's frames at rest are in
        each of these frames, as columns.
    names_by_id : tuple of str
        What the tracker calls the points that it reports by number only.
    bones : tuple of Bone
        None: whatever the lengths between joints are, they are believed.
    stature : array_like, shape (2,)
        Of the smallest and the largest wearer whom the bones may belong to, 0.5 to 2.8 [m].

    Raises
    ------
    SceneError
        A joint, part or bone that comes twice, a part, bone or base of a joint that is none, a
        joint that nothing uses, axes that are no rotation, statures that are none.

    """

    joints: tuple[Joint, ...]
    parts: tuple[Part, ...]
    base: FrameBase | JointBase | None
    axes: Array
    names_by_id: tuple[str, ...] = ()
    bones: tuple[Bone, ...] = ()
    stature: Array = field(default_factory=lambda: np.array(STATURES))

    def __post_init__(self) -> None:
        """Validate and freeze."""
        _freeze(self, 'axes', (3, 3), 'axes', '-')
        _freeze(self, 'stature', (2,), 'stature')
        if not LEAST_STATURE <= self.stature[0] <= self.stature[1] <= MOST_STATURE:
            raise SceneError(
                f'stature: {self.stature.tolist()}, expected that of the smallest and of the '
                f'largest wearer, {LEAST_STATURE:g} to {MOST_STATURE:g} [m]'
            )
        if np.abs(self.axes @ self.axes.T - np.eye(3)).max() > ORTHOGONAL or (
            np.linalg.det(self.axes) < 0.0
        ):
            raise SceneError(
                f'axes: {self.axes.tolist()}, expected right-handed, perpendicular ones [-]'
            )
        names = [joint.name for joint in self.joints]
        _check_once([BASE, *AXES, *names], 'joint')
        _check_once([part.name for part in self.parts], 'part')
        _check_once(list(self.names_by_id), 'name of an id')
        _check_once([bone.name for bone in self.bones], 'bone')
        if not self.parts:
            raise SceneError('parts: none, expected at least one')
        uses = {f'part "{part.name}"': _joints_of(part) for part in self.parts}
        if isinstance(self.base, JointBase):
            uses['base'] = {self.base.origin, *_ends(self.base.axes)}
        for user, used in uses.items():
            known = {*names, BASE} if user != 'base' else {*names}
            if missing := sorted(used - known):
                raise SceneError(f'{user}: no joint "{missing[0]}", expected it among the joints')
        for bone in self.bones:
            if missing := sorted({bone.start, bone.end} - {*names, BASE}):
                raise SceneError(
                    f'bone "{bone.name}": no joint "{missing[0]}", expected it among the joints'
                )
        if unused := [name for name in names if name not in set().union(*uses.values())]:
            raise SceneError(
                f'joint "{unused[0]}": used by no part and not by the base, expected one of '
                f'those that are'
            )


def _joints_of(part: Part) -> set[str]:
    """Return the joints that a part is made of."""
    return {*part.joints, *_ends(part.axes)}


def _ends(axes: Iterable[Direction]) -> set[str]:
    return {joint for direction in axes for joint in (direction.start, direction.end)}


def _check_axes(axes: tuple[Direction, ...], label: str) -> None:
    given = [direction.axis for direction in axes]
    if len(given) > 2 or len(set(given)) < len(given):
        raise SceneError(f'{label}: axes {", ".join(given)}, expected at most two, not the same')


def _check_once(names: list[str], what: str) -> None:
    twice = [name for name, n in Counter(names).items() if n > 1]
    if twice:
        raise SceneError(f'{what} "{twice[0]}": given twice, expected each once')


def _freeze(
    value: object, field: str, shape: tuple[int, ...], label: str, unit: str = 'm'
) -> None:
    given = getattr(value, field)
    frozen = frozen_array(given, shape, label, unit, SceneError, LONGEST)
    object.__setattr__(value, field, frozen)
