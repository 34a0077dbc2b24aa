# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What of an arm from a URDF is possible, but hardly meant: mostly another unit."""

from collections.abc import Iterator, Sequence
import math
from typing import Any

import numpy as np
from rrth_planner.io.urdf.import_chain import ImportedArm
from rrth_planner.model.arm import Capsule

# Wider limits than this are hardly those of an arm: two turns either way [rad], a stroke [m].
WIDEST, LONGEST_STROKE = 4.0 * math.pi, 5.0
# No joint of an arm that is worn is faster [rad/s or m/s] or stronger [N m or N].
FASTEST, STRONGEST = 50.0, 1e4
# The reach of arms that a person may wear [m]. No capsule is longer than the arm reaches; one of
# the mount may be, as a plate is.
SHORTEST_REACH, LONGEST_REACH, OF_MOUNT = 0.1, 5.0, 3.0
# Where all capsules are shorter than this share of the reach, meshes are in a greater unit.
LEAST_SHARE = 0.03


def implausible(found: ImportedArm) -> list[str]:
    """Return a sentence for each kind of thing that is hardly meant; the remedy comes first."""
    return [*_lengths(found), *_ranges(found), *_drives(found.chain.moving)]


def _lengths(found: ImportedArm) -> Iterator[str]:
    arm = found.arm
    links = np.linalg.norm(np.diff(found.chain.points, axis=0), axis=1)
    strokes = np.abs(arm.bounds).max(axis=0)[np.array(arm.is_prismatic, dtype=bool)]
    reach = float(links.sum() + strokes.sum())
    if reach > LONGEST_REACH:
        yield f'write origins of joints in metres: the arm reaches {reach:.4g} m by them'
    sizes = {
        capsule: _size(capsule) / (OF_MOUNT if capsule.link == 0 else 1.0)
        for capsule in arm.capsules
    }
    if not sizes:
        return
    largest = max(sizes, key=lambda capsule: sizes[capsule])
    n = len({capsule.name for capsule, size in sizes.items() if size > max(reach, SHORTEST_REACH)})
    if n:
        yield (
            'give a mesh in millimetres scale="0.001 0.001 0.001" in the URDF, which is in '
            f'metres: a capsule of "{largest.name}" is {_size(largest):.4g} m long, and the arm '
            f'reaches {reach:.3g} m{_others(n)}'
        )
    longest = max(_size(capsule) for capsule in arm.capsules)
    if longest < LEAST_SHARE * reach:
        yield (
            'look at the scale of the meshes, which a URDF has in metres: no capsule is longer '
            f'than {longest:.2g} m, and the arm reaches {reach:.3g} m'
        )


def _size(capsule: Capsule) -> float:
    """Return how long a capsule is, its caps included [m]."""
    return float(np.linalg.norm(capsule.ends[1] - capsule.ends[0])) + 2.0 * capsule.radius


def _others(n: int) -> str:
    return f'; {n - 1} more link{"s" * (n > 2)} alike' if n > 1 else ''


def _ranges(found: ImportedArm) -> Iterator[str]:
    arm = found.arm
    most = np.abs(arm.bounds).max(axis=0)
    is_sliding = np.array(arm.is_prismatic, dtype=bool)
    for unit, likely, mask, limit in (
        ('rad', 'radians, not degrees', ~is_sliding & ~np.array(arm.is_continuous), WIDEST),
        ('m', 'metres', is_sliding, LONGEST_STROKE),
    ):
        names = [arm.joint_names[k] for k in np.flatnonzero(mask & (most > limit))]
        if names:
            yield (
                f'write limits in {likely}: {_named(names)} up to {most[mask].max():.4g} {unit}, '
                f'expected at most {limit:.4g}'
            )


def _drives(moving: Sequence[Any]) -> Iterator[str]:
    for what, most, effect in (
        ('velocity', FASTEST, 'max_velocity of the settings counts'),
        ('effort', STRONGEST, 'forces are simulated with it'),
    ):
        given = {
            joint.name: getattr(joint.limit, what)
            for joint in moving
            if joint.limit is not None and getattr(joint.limit, what) is not None
        }
        odd = {name: v for name, v in given.items() if not 0.0 < v <= most}
        if odd:
            unit = {'velocity': 'rad/s or m/s', 'effort': 'N m or N'}[what]
            values = ', '.join(f'{v:g}' for v in dict.fromkeys(odd.values()))
            yield (
                f'correct the {what} in the limit of {_named(list(odd))}: {values}, expected more '
                f'than 0 and at most {most:g} [{unit}]; {effect}'
            )


def _named(names: Sequence[str]) -> str:
    shown = ', '.join(f'"{name}"' for name in names[:6])
    return f'{shown} and {len(names) - 6} more' if len(names) > 6 else shown
