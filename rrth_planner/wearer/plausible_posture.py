# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is believed of a posture: no person has a forearm of 3 m, or a face at his back."""

from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.joint_positions import FARTHEST_POINT, Indices, joints_of
from rrth_planner.wearer.posture import Posture
from rrth_planner.wearer.skeleton import BASE, Bone, FrameBase, Skeleton

# How far a tracker may be off in the length of a bone [m].
TOLERANCE = 0.05
# The same of the size of a whole person, from the lengths of the arms and legs [-].
SIZE_TOLERANCE = 0.15
# So many of these say how large somebody is; their shares of the stature are at least this [-].
LEAST_MEASURED, LONG_BONE = 3, 0.1
# More limbs do not go wrong at once.
MOST_WRONG_LIMBS = 2
# From a point of a person to the next one that is seen it is no further [m].
LONGEST_GAP = 1.0
# Cosines of what points backward, and of what does not.
BACKWARD, FORWARD = -0.5, 0.2
# Where what points forward begins and ends.
FACES = ('head', 'nose')
FEET = tuple((f'{side} ankle', f'{side} toes') for side in ('left', 'right'))
FOREARMS = tuple((f'{side} elbow', f'{side} wrist') for side in ('left', 'right'))
# Lengths by the factor that is taken for metres; 1.3 away from it they are none of it.
UNITS = {'mm': 1000.0, 'cm': 100.0, 'inch': 1.0 / 0.0254, 'feet': 1.0 / 0.3048}
NEAR_UNIT = 1.3
# Points of an image have no depth: this part of their height and width [-].
FLAT = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class PlausiblePosture:
    """
    A posture in which what no person can have is lost, and for each of it a sentence why.

    The sentences are without the names of parts, and have no full stop.
    """

    posture: Posture
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Layout:
    """
    The bones of a skeleton as indices into its joints, behind which is the base, (n, 2).

    `points_of` are the points of each of these in a posture; `used` all of them.
    """

    bones: tuple[Bone, ...]
    ends: Indices
    shortest: Array
    longest: Array
    shares: Array
    is_long: NDArray[np.bool_]
    spans: Indices
    longest_spans: Array
    trunk: frozenset[int]
    points_of: tuple[frozenset[int], ...]
    used: Indices
    rows: dict[str, int]
    facing: tuple[str, ...]


def plausible_posture(skeleton: Skeleton, posture: Posture) -> PlausiblePosture:
    """
    Return what is believed of a posture; the points of what is not are lost in it.

    Lost are points at exactly 0 0 0 while the person is elsewhere, points in exactly the same
    place with a bone between them, both ends of a bone that is too long or too short, unless
    other bones say which of them is wrong, and a face at the back. Bones are compared with those
    of the statures of the skeleton; one that has none is not judged by lengths.

    Raises
    ------
    SceneError
        It is no person: bones of the trunk, or of several limbs, are too long or too short, or it
        is one of another size, or left and right are mirrored.

    """
    layout = _layout(skeleton, posture.names)
    joints = _joints(skeleton, posture)
    if _are_possible(skeleton, layout, joints, posture.positions) and _is_facing(
        skeleton, layout, joints, posture
    ):
        return PlausiblePosture(posture)
    return _judged(skeleton, layout, posture)


def are_plausible(
    skeleton: Skeleton, names: tuple[str, ...], positions: Array, rotations: Array | None
) -> NDArray[np.bool_]:
    """
    Return which of many postures are believed as they are, by `plausible_posture`, (m,).

    positions (m, n, 3), rotations (m, n, 3, 3) of the points with these names.
    """
    layout = _layout(skeleton, names)
    joints = _joints_with_base(skeleton, names, positions, rotations)
    found = _are_possible(skeleton, layout, joints, positions)
    for i in np.flatnonzero(found).tolist():
        posture = Posture(
            names=names,
            positions=positions[i],
            rotations=None if rotations is None else rotations[i],
        )
        found[i] = _is_facing(skeleton, layout, joints[i], posture)
    return found


def _are_possible(
    skeleton: Skeleton, layout: _Layout, joints: Array, positions: Array
) -> NDArray[np.bool_]:
    """
    Return whether all points and bones of one posture, or of many, are those of a person, (...).

    joints (..., n_joints + 1, 3), positions (..., n, 3).
    """
    positions = positions[..., layout.used, :]
    spans = joints[..., layout.ends[:, 1], :] - joints[..., layout.ends[:, 0], :]
    lengths = np.sqrt(np.einsum('...j,...j->...', spans, spans))
    reach = joints[..., layout.spans[:, 1], :] - joints[..., layout.spans[:, 0], :]
    # What is lost compares as neither.
    is_doubted = (np.abs(positions) > FARTHEST_POINT).any(axis=(-2, -1))
    is_doubted |= (positions == 0.0).all(axis=-1).any(axis=-1)
    is_wrong = (lengths < layout.shortest) | (lengths > layout.longest) | (lengths == 0.0)
    is_doubted |= is_wrong.any(axis=-1)
    is_far = np.einsum('...j,...j->...', reach, reach) > layout.longest_spans**2
    is_doubted |= is_far.any(axis=-1)
    return np.asarray(~(is_doubted | _is_other_size(skeleton, layout, lengths)))


def _is_facing(skeleton: Skeleton, layout: _Layout, joints: Array, posture: Posture) -> bool:
    """Return whether nothing points backward that points forward of a person."""
    cosines = _facing(skeleton, layout, joints, posture).values()
    return not any(cosine < BACKWARD for cosine in cosines)


def _judged(skeleton: Skeleton, layout: _Layout, posture: Posture) -> PlausiblePosture:
    """Return the same of a posture with something that is not believed."""
    doubts: list[str] = []
    _reject_units(layout, posture)
    posture = _without_zeros(skeleton, layout, posture, doubts)
    posture = _without_coincidence(skeleton, layout, posture, doubts)
    lengths = _lengths(layout, _joints(skeleton, posture))
    is_wrong = (lengths < layout.shortest) | (lengths > layout.longest)
    if _is_other_size(skeleton, layout, lengths):
        size = float(_sizes(layout, lengths))
        far = _furthest(layout, lengths)
        raise SceneError(
            f'{_sentence(layout, far, lengths)}, and arms and legs are those of a person of '
            f'{size:.3g} m, expected {_statures(skeleton)}{_cause(layout, lengths, posture)}'
        )
    posture = _without_wrong_bones(skeleton, layout, posture, lengths, is_wrong, doubts)
    posture = _without_far_ends(skeleton, layout, posture, doubts)
    posture = _without_backward(skeleton, layout, posture, doubts)
    return PlausiblePosture(posture, tuple(doubts))


def _reject_units(layout: _Layout, posture: Posture) -> None:
    """Raise where most points are beyond 1 km, whether or not there are bones."""
    positions = posture.positions[layout.used]
    positions = positions[np.isfinite(positions).all(axis=1)]
    far = np.abs(positions).max(axis=1, initial=0.0) > FARTHEST_POINT
    if 2 * np.count_nonzero(far) > len(far):
        lengths = _lengths(layout, _joints_of_any_size(layout, posture))
        raise SceneError(f'{_distance(positions)}{_cause(layout, lengths, posture, is_far=True)}')


def _joints_of_any_size(layout: _Layout, posture: Posture) -> Array:
    """Return the mean of the points of each joint, without offsets, (n_joints + 1, 3)."""
    joints = np.full((len(layout.points_of), 3), np.nan)
    for k, points in enumerate(layout.points_of):
        if points:
            joints[k] = posture.positions[sorted(points)].mean(axis=0)
    return joints


def _without_zeros(
    skeleton: Skeleton, layout: _Layout, posture: Posture, doubts: list[str]
) -> Posture:
    """Return a posture without points at exactly 0 0 0, unless the person stands there."""
    zeros = [int(k) for k in layout.used if not posture.positions[k].any()]
    if not zeros or not skeleton.bones:
        return posture
    others = [int(k) for k in layout.used if k not in zeros]
    others = [k for k in others if np.isfinite(posture.positions[k]).all()]
    if not others:
        if len(zeros) == 1:
            # Of a person of whom nothing else is seen nobody knows where he is.
            return posture
        raise SceneError('all points are at 0 0 0, expected those of a person [m]')
    lengths = _lengths(layout, _joints(skeleton, posture))
    nearest = np.linalg.norm(posture.positions[others], axis=1).min()
    lost = []
    for k in zeros:
        bones = [
            n
            for n, (start, end) in enumerate(layout.ends.tolist())
            for here, there in ((start, end), (end, start))
            if k in layout.points_of[here]
            and not layout.points_of[there] & set(zeros)
            and np.isfinite(lengths[n])
        ]
        is_there = all(layout.shortest[n] <= lengths[n] <= layout.longest[n] for n in bones)
        if not (is_there if bones else nearest <= LONGEST_GAP):
            lost.append(k)
    if lost:
        doubts.append(f'{_named(posture, lost)} at exactly 0 0 0')
    return _without(posture, lost)


def _without_coincidence(
    skeleton: Skeleton, layout: _Layout, posture: Posture, doubts: list[str]
) -> Posture:
    """Return a posture without both ends of bones that begin where they end."""
    lengths = _lengths(layout, _joints(skeleton, posture))
    lost: set[int] = set()
    for n in np.flatnonzero(lengths == 0.0):
        for joint in layout.ends[n].tolist():
            lost |= layout.points_of[joint]
    if lost:
        doubts.append(f'{_named(posture, sorted(lost))} in exactly the same place')
    return _without(posture, sorted(lost))


def _without_wrong_bones(
    skeleton: Skeleton,
    layout: _Layout,
    posture: Posture,
    lengths: Array,
    is_wrong: NDArray[np.bool_],
    doubts: list[str],
) -> Posture:
    """Return a posture without the ends of bones of a wrong length, or raise SceneError."""
    left = {int(n) for n in np.flatnonzero(is_wrong)}
    if not left:
        return posture
    first = min(left, key=lambda n: (not layout.bones[n].is_trunk, n))
    # The joint that explains most of them comes first.
    lost: set[int] = set()
    n_wrong_trunk, wrong_limbs = 0, set()
    while left:
        counts = Counter(joint for n in left for joint in layout.ends[n].tolist())
        joint, most = max(counts.items(), key=lambda item: (item[1], item[0]))
        if most > 1:
            culprits = {joint}
        else:
            (start, end) = layout.ends[min(left)].tolist()
            # What the trunk holds is where it is.
            held = set().union(*(layout.points_of[j] for j in layout.trunk)) - lost
            culprits = {
                j for j in (start, end) if j not in layout.trunk and not layout.points_of[j] & held
            } or {start, end}
        n_wrong_trunk += len(culprits & layout.trunk)
        points = set().union(*(layout.points_of[j] for j in culprits))
        lost |= points
        explained = {
            n for n in left if any(layout.points_of[j] & points for j in layout.ends[n].tolist())
        }
        wrong_limbs |= {_limb(layout.bones[n]) for n in explained if not layout.bones[n].is_trunk}
        left -= explained or left
    limb = np.array([not bone.is_trunk for bone in layout.bones])
    n_limb, n_wrong = (np.count_nonzero(limb & of) for of in (np.isfinite(lengths), is_wrong))
    base_points = _base_points(skeleton, posture)
    if (
        n_wrong_trunk > 1
        or lost & base_points
        or len(wrong_limbs) > MOST_WRONG_LIMBS
        or (n_limb > 2 and 2 * n_wrong > n_limb)
    ):
        raise SceneError(f'{_sentence(layout, first, lengths)}{_cause(layout, lengths, posture)}')
    doubts += [_sentence(layout, int(n), lengths) for n in np.flatnonzero(is_wrong)]
    return _without(posture, sorted(lost))


def _without_far_ends(
    skeleton: Skeleton, layout: _Layout, posture: Posture, doubts: list[str]
) -> Posture:
    """Return a posture without ends of limbs that are out of reach, whatever is between."""
    joints = _joints(skeleton, posture)
    lost: set[int] = set()
    for (start, end), longest in zip(layout.spans.tolist(), layout.longest_spans, strict=True):
        length = float(np.linalg.norm(joints[end] - joints[start]))
        if length > longest and not layout.points_of[end] & lost:
            lost |= layout.points_of[end]
            names = list(layout.rows)
            doubts.append(
                f'{names[end]}: {length:.3g} m from the {names[start]}, expected at most '
                f'{longest:.2f} m'
            )
    return _without(posture, sorted(lost))


def _without_backward(
    skeleton: Skeleton, layout: _Layout, posture: Posture, doubts: list[str]
) -> Posture:
    """Return a posture without a face at the back; raise SceneError where all points there."""
    joints = _joints(skeleton, posture)
    cosines = _facing(skeleton, layout, joints, posture)
    backward = [name for name, cosine in cosines.items() if cosine < BACKWARD]
    if not backward:
        return posture
    where = ', '.join(dict.fromkeys(name.partition(' of ')[0] for name in backward))
    # Frames are not mirrored with their positions, so they may look right beside them.
    feet = [name for name in cosines if name.endswith('toes')]
    if (
        'left shoulder' in backward
        or (len(feet) == len(FEET) and set(feet) <= set(backward))
        or not any(cosine > FORWARD for cosine in cosines.values())
    ):
        forward = _forward(layout, joints)
        hands = [
            (joints[layout.rows[b]] - joints[layout.rows[a]]) @ forward
            for a, b in FOREARMS
            if a in layout.rows and b in layout.rows
        ]
        if hands and max(hands) < 0.0:
            where += ', hands'
        start, end = FACES if 'nose' in where else FEET[0]
        length = ''
        if start in layout.rows and end in layout.rows:
            far = np.linalg.norm(joints[layout.rows[end]] - joints[layout.rows[start]])
            length = f' ({start} to {end}: {far:.3g} m)'
        raise SceneError(
            f'{where} behind the back{length}, expected in front [m]: are left and right mirrored?'
        )
    if 'nose' not in where:
        return posture
    points = layout.points_of[layout.rows['nose']]
    doubts.append('nose: behind the head, expected in front of it')
    return _without(posture, sorted(points))


def _facing(
    skeleton: Skeleton, layout: _Layout, joints: Array, posture: Posture
) -> dict[str, float]:
    """Return the cosine of what points forward of a person and of his front, by its name."""
    found: dict[str, float] = {}
    for name in layout.facing:
        if name == 'left shoulder':
            base = skeleton.base
            if not isinstance(base, FrameBase) or posture.rotations is None:
                continue
            left = posture.rotations[posture.names.index(base.frame)] @ skeleton.axes[:, 1]
            way = joints[layout.rows['left shoulder']] - joints[layout.rows['right shoulder']]
            found[name] = _cosine(left, way)
        elif name == 'nose':
            way = joints[layout.rows['nose']] - joints[layout.rows['head']]
            found[name] = _cosine(_forward(layout, joints), way)
        elif name == 'nose of the head':
            ears = joints[layout.rows['left ear']] - joints[layout.rows['right ear']]
            up = joints[layout.rows['head']] - joints[layout.rows['neck']]
            way = joints[layout.rows['nose']] - joints[layout.rows['head']]
            found[name] = _cosine(_cross(ears, up), way)
        else:
            side = name.partition(' ')[0]
            hips = joints[layout.rows['left hip']] - joints[layout.rows['right hip']]
            ankle, toes = (joints[layout.rows[f'{side} {end}']] for end in ('ankle', 'toes'))
            up = joints[layout.rows[f'{side} knee']] - ankle
            found[name] = _cosine(_cross(hips, up), toes - ankle)
    return found


def _forward(layout: _Layout, joints: Array) -> Array:
    """Return the way to the front of the trunk, (3,), of any length."""
    rows = layout.rows
    left = joints[rows['left shoulder']] - joints[rows['right shoulder']]
    lower = next(name for name in ('hips', 'chest', BASE) if name in rows)
    return _cross(left, joints[rows['neck']] - joints[rows[lower]])


def _cosine(one: Array, other: Array) -> float:
    """Return the cosine of an angle, NaN where one is lost or has no length."""
    product = float(np.sqrt((one @ one) * (other @ other)))
    return float(one @ other) / product if product > 0.0 else float('nan')


def _cross(a: Array, b: Array) -> Array:
    # `np.cross` takes several times as long.
    x, y, z = a.tolist()
    u, v, w = b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _lengths(layout: _Layout, joints: Array) -> Array:
    spans = joints[layout.ends[:, 1]] - joints[layout.ends[:, 0]]
    lengths: Array = np.sqrt(np.einsum('ij,ij->i', spans, spans))
    return lengths


def _joints(skeleton: Skeleton, posture: Posture) -> Array:
    """Return the joints and, behind them, the base, (n_joints + 1, 3), NaN where unknown."""
    return _joints_with_base(skeleton, posture.names, posture.positions, posture.rotations)


def _joints_with_base(
    skeleton: Skeleton, names: tuple[str, ...], positions: Array, rotations: Array | None
) -> Array:
    """Return the same of one posture, or of many at once, (..., n_joints + 1, 3)."""
    joints = np.empty((*positions.shape[:-2], len(skeleton.joints) + 1, 3))
    joints[..., :-1, :] = joints_of(skeleton, names, positions, rotations)
    joints[..., -1, :] = np.nan
    base = skeleton.base
    if isinstance(base, FrameBase) and rotations is not None and base.frame in names:
        k = names.index(base.frame)
        turn = rotations[..., k, :, :] @ skeleton.axes
        joints[..., -1, :] = positions[..., k, :] + turn @ base.offset
    return joints


def _sizes(layout: _Layout, lengths: Array) -> Array:
    """
    Return how tall somebody is by the lengths of arms and legs [m], NaN where too few are.

    lengths (..., n): of his bones; (...).
    """
    sizes = (lengths / layout.shares)[..., layout.is_long]
    if sizes.shape[-1] < LEAST_MEASURED:
        return np.full(sizes.shape[:-1], np.nan)
    is_known = np.isfinite(sizes)
    # What is lost comes last.
    sizes = np.sort(np.where(is_known, sizes, np.nan), axis=-1)
    if is_known.all():
        most = sizes.shape[-1]
        return np.asarray(0.5 * (sizes[..., (most - 1) // 2] + sizes[..., most // 2]))
    n = is_known.sum(axis=-1)[..., None]
    middle = [np.take_along_axis(sizes, np.maximum(k // 2, 0), axis=-1) for k in (n - 1, n)]
    found: Array = np.where(n < LEAST_MEASURED, np.nan, 0.5 * (middle[0] + middle[1]))[..., 0]
    return found


def _is_other_size(
    skeleton: Skeleton, layout: _Layout, lengths: Array
) -> NDArray[np.bool_] | np.bool_:
    low, high = skeleton.stature.tolist()
    size = _sizes(layout, lengths)
    is_other: NDArray[np.bool_] | np.bool_ = size < (1.0 - SIZE_TOLERANCE) * low
    return is_other | (size > (1.0 + SIZE_TOLERANCE) * high)


def _statures(skeleton: Skeleton) -> str:
    low, high = skeleton.stature.tolist()
    return f'{low:g} to {high:g} m' if low < high else f'{low:g} m'


def _furthest(layout: _Layout, lengths: Array) -> int:
    """Return the bone that is most out of its limits, or of the usual length."""
    usual = 0.5 * (layout.shortest + layout.longest)
    with np.errstate(divide='ignore'):
        off = np.abs(np.log(lengths / usual))
    outside = (lengths < layout.shortest) | (lengths > layout.longest)
    off = np.where(np.isfinite(lengths), np.where(outside, off + 100.0, off), -1.0)
    return int(np.argmax(np.where(layout.is_long, off + 1e3, off)))


def _sentence(layout: _Layout, bone: int, lengths: Array) -> str:
    """Say how long a bone is."""
    return (
        f'{layout.bones[bone].name}: {lengths[bone]:.3g} m long, expected '
        f'{layout.shortest[bone]:.2f} to {layout.longest[bone]:.2f} m'
    )


def _distance(positions: Array) -> str:
    far = float(np.abs(positions).max(initial=0.0))
    return f'a point is {far:.0f} m away, expected metres'


def _cause(layout: _Layout, lengths: Array, posture: Posture, *, is_far: bool = False) -> str:
    """Say what may have made all bones longer or shorter than those of an adult."""
    positions = posture.positions[layout.used]
    positions = positions[np.isfinite(positions).all(axis=1)]
    usual = 1.7 * layout.shares
    ratios = lengths / usual
    ratios = ratios[np.isfinite(ratios)]
    if not len(ratios):
        return ': are the positions in mm?' if is_far else ''
    ratio = float(np.median(ratios))
    away = '' if is_far else f'; {_distance(positions)}'
    extent = np.sort(np.ptp(positions, axis=0)) if len(positions) else np.ones(3)
    if extent[0] <= FLAT * extent[1]:
        return f'{away}: are they coordinates of an image, in place of those of the world?'
    for unit, scale in UNITS.items():
        if scale / NEAR_UNIT <= ratio <= scale * NEAR_UNIT:
            return f'{away}: are the positions in {unit}?'
    if ratio > 2.0:
        return f'{away}: are the positions in another unit, or coordinates of an image?'
    if ratio < 0.75:
        return (
            ': are the positions coordinates of an image, in place of those of the world, or is '
            'the wearer smaller than the parameter stature says?'
        )
    if ratio > 1.25:
        return ': are the positions scaled, or is the wearer taller than stature says?'
    return ''


def _named(posture: Posture, points: list[int]) -> str:
    return ', '.join(f'"{posture.names[k]}"' for k in points)


def _without(posture: Posture, points: list[int]) -> Posture:
    """Return a posture in which points are lost."""
    if not points:
        return posture
    positions = posture.positions.copy()
    positions[points] = np.nan
    rotations = posture.rotations
    if rotations is not None:
        rotations = rotations.copy()
        rotations[points] = np.nan
    return replace(posture, positions=positions, rotations=rotations)


def _limb(bone: Bone) -> str:
    """Return which arm or leg a bone belongs to, or that it is of the head."""
    side = next((side for side in ('left', 'right') if side in bone.end), '')
    kind = 'leg' if bone.end.endswith(('knee', 'ankle', 'toes')) else 'arm'
    return f'{side} {kind}' if side and not bone.end.endswith('ear') else 'head'


def _base_points(skeleton: Skeleton, posture: Posture) -> set[int]:
    """Return the points that the base is made of."""
    base = skeleton.base
    if base is None:
        return set()
    if isinstance(base, FrameBase):
        wanted = {base.frame}
    else:
        ends = {base.origin, *(j for axis in base.axes for j in (axis.start, axis.end))}
        wanted = {p for joint in skeleton.joints if joint.name in ends for p in joint.points}
    return {k for k, name in enumerate(posture.names) if name in wanted}


@lru_cache(maxsize=16)
def _layout(skeleton: Skeleton, names: tuple[str, ...]) -> _Layout:
    """Return the bones of a skeleton in postures with these names."""
    place = {name: k for k, name in enumerate(names)}
    rows = {joint.name: k for k, joint in enumerate(skeleton.joints)}
    rows[BASE] = len(skeleton.joints)
    points_of = [
        frozenset(place[p] for p in joint.points if p in place) for joint in skeleton.joints
    ]
    base = skeleton.base
    points_of.append(
        frozenset(
            _base_points(skeleton, Posture(names=names, positions=np.empty((len(names), 3))))
            if isinstance(base, FrameBase)
            else ()
        )
    )
    # Between two places in one frame nothing is measured.
    bones = [
        bone for bone in skeleton.bones if points_of[rows[bone.start]] != points_of[rows[bone.end]]
    ]
    shares = np.array([bone.shares for bone in bones]).reshape(-1, 2)
    low, high = skeleton.stature
    longest = shares[:, 1] * high + TOLERANCE
    # A limb whose joint between is lost still ends within reach.
    limb = {bone.end: (bone.start, bone) for bone in skeleton.bones if not bone.is_trunk}
    longest_of = {bone.name: float(bone.shares[1] * high + TOLERANCE) for bone in skeleton.bones}
    spans, reaches = [], []
    for end, (before, bone) in limb.items():
        reach, start = longest_of[bone.name], before
        while start in limb:
            start, other = limb[start]
            reach += longest_of[other.name]
            if points_of[rows[start]] != points_of[rows[end]]:
                spans.append([rows[start], rows[end]])
                reaches.append(reach)
    trunk = {rows[j] for bone in skeleton.bones if bone.is_trunk for j in (bone.start, bone.end)}
    used = sorted(set().union(*points_of))
    return _Layout(
        bones=tuple(bones),
        ends=np.array([[rows[b.start], rows[b.end]] for b in bones], dtype=np.intp).reshape(-1, 2),
        shortest=np.maximum(shares[:, 0] * low - TOLERANCE, 0.0),
        longest=longest,
        shares=shares.mean(axis=1),
        is_long=np.array(
            [
                not b.is_trunk and b.shares[0] > LONG_BONE and rows[b.end] != rows.get('head')
                for b in bones
            ],
            dtype=bool,
        ),
        spans=np.array(spans, dtype=np.intp).reshape(-1, 2),
        longest_spans=np.array(reaches),
        trunk=frozenset(trunk),
        points_of=tuple(points_of),
        used=np.array(used, dtype=np.intp),
        rows=rows,
        facing=_facing_names(skeleton, rows, points_of),
    )


def _facing_names(
    skeleton: Skeleton, rows: dict[str, int], points_of: list[frozenset[int]]
) -> tuple[str, ...]:
    """Return what of a skeleton shows where the front is: what its joints suffice for."""
    if not skeleton.bones:
        return ()
    found = []

    def has(*joints: str) -> bool:
        return all(joint in rows and points_of[rows[joint]] for joint in joints)

    shoulders = has('left shoulder', 'right shoulder')
    if shoulders and isinstance(skeleton.base, FrameBase) and points_of[-1]:
        found.append('left shoulder')
    if has('head', 'nose'):
        lower = any(has(name) for name in ('hips', 'chest', BASE))
        if shoulders and has('neck') and lower:
            found.append('nose')
        if has('left ear', 'right ear', 'neck') and (
            points_of[rows['nose']] != points_of[rows['left ear']]
        ):
            found.append('nose of the head')
    for side in ('left', 'right'):
        ends = (f'{side} knee', f'{side} ankle', f'{side} toes')
        if has('left hip', 'right hip', *ends):
            found.append(f'{side} toes')
    return tuple(found)
