# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Make the description of an arm from a URDF file."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
import math
import sys

import numpy as np
from rrth_planner.cli import plain_parsers
from rrth_planner.cli.joint_values import joint_values
from rrth_planner.cli.program import run
from rrth_planner.io.arm_file import arm_from_mapping, arm_to_mapping, arm_to_yaml
from rrth_planner.io.urdf.allowed_pairs import colliding_pairs, disabled_pairs
from rrth_planner.io.urdf.chain import RAYS, read_chain
from rrth_planner.io.urdf.import_chain import (
    import_chain,
    ImportedArm,
    with_capsules,
    with_ray_radius,
)
from rrth_planner.io.urdf.link_capsules import enclose_links
from rrth_planner.model.arm import NO_BARS
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix

# Bars this much longer than all links together are no links.
LONG = 2.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Read a URDF, write an arm, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    # To argparse a -z by itself is another option.
    for k in range(len(given) - 1, 0, -1):
        if given[k - 1] == '--ray' and given[k] in RAYS:
            given[k - 1 : k + 1] = [f'--ray={given[k]}']
    options = plain_parsers.read_urdf().parse_args(given)
    return run('read_urdf', lambda: _import(options), 2)


def _import(options: argparse.Namespace) -> None:
    # Not for --help: it has kernels, which take seconds to load and, once, to compile.
    from rrth_planner.planning.pointing_goals import check_pointing_arm

    chain = read_chain(options.file, options.base, options.tool, options.ray)
    found = import_chain(chain, _mount(options.mount), options.radius, options.max_turns)
    shape: list[str] = []
    if options.geometry == 'collision':
        found, shape = _with_flesh(found, options)
    if options.srdf is not None and not found.arm.capsules:
        raise ModelError(
            f'--srdf {options.srdf}: the links are bars, expected collision geometry: its pairs '
            'are links'
        )
    if not found.arm.capsules and options.ray_radius is not None:
        found = with_ray_radius(found, options.ray_radius)
    # As it will be read.
    arm = arm_from_mapping(arm_to_mapping(found.arm, chain.name))
    check_pointing_arm(arm)
    lines = _report(found) + shape
    if options.check is not None:
        lines += _report_ray(found, joint_values(options.check, '--check', arm.joint_names))
    comments = [
        f'The arm of {options.file.name} from link {chain.base} to {chain.tool}, '
        f'ray along {options.ray}.'
    ]
    options.output.write_text(arm_to_yaml(found.arm, chain.name, comments), encoding='utf-8')
    print('\n'.join([*lines, f'written: {options.output}']))


def _with_flesh(found: ImportedArm, options: argparse.Namespace) -> tuple[ImportedArm, list[str]]:
    """Return an arm with capsules round its links, and a description of them, in lines."""
    flesh = enclose_links(found, options.include_branches)
    lines = []
    if flesh.left_out:
        lines.append(
            f'left out: {", ".join(flesh.left_out)}, moved by joints beside the chain; '
            '--include-branches encloses them in all their positions'
        )
    if not flesh.capsules:
        return found, [
            *lines,
            'shape: no collision geometry: each link is a bar from joint to joint',
        ]
    found = with_capsules(found, flesh.capsules, options.ray_radius or 0.0)
    always = colliding_pairs(found.arm)
    pairs = list(always)
    if options.srdf is not None:
        named = disabled_pairs(options.srdf, found.arm)
        known = {frozenset(pair) for pair in always}
        pairs += [pair for pair in named if frozenset(pair) not in known]
        lines.append(f'may meet, by {options.srdf.name}: {_listed(pairs[len(always) :])}')
    if always:
        lines.append(f'may meet, since they nearly always do: {_listed(always)}')
    if flesh.bare:
        lines.append(f'not checked, no collision geometry: {", ".join(flesh.bare)}')
    shape = [
        f'shape: {len(flesh.capsules)} capsules; slack: how far one reaches beyond the convex '
        'hull of what it encloses'
    ]
    for link in flesh.links:
        n = len(link.capsules)
        if n == 0:
            shape.append(f'  {link.name}: in the capsules of the links before it')
            continue
        radius = max(capsule.radius for capsule in link.capsules)
        shape.append(
            f'  {link.name}: {n} capsule{"s" * (n > 1)}, radius up to {radius:.4f} m, '
            f'slack {1e3 * link.slack:.0f} mm'
        )
    return replace(found, arm=replace(found.arm, allowed=tuple(pairs))), shape + lines


def _listed(pairs: Sequence[tuple[str, str]]) -> str:
    return ', '.join(f'{one} and {other}' for one, other in pairs) or 'none'


def _mount(numbers: Sequence[float] | None) -> Array:
    if numbers is None:
        return np.eye(4)
    values = frozen_array(numbers, (7,), '--mount', 'm and -', ModelError)
    if np.linalg.norm(values[3:]) < 1e-6:
        raise ModelError('--mount: quaternion all zero, expected qx qy qz qw, not all 0 [-]')
    return pose_matrix(values[:3], values[3:])


def _report(found: ImportedArm) -> list[str]:
    """Return a description of an arm, in lines."""
    arm, chain = found.arm, found.chain
    lines = [f'arm "{chain.name}" of {arm.dof} joints, from {chain.base} to {chain.tool}']
    for k, name in enumerate(arm.joint_names):
        unit = 'm' if arm.is_prismatic[k] else 'rad'
        low, high = arm.bounds[:, k]
        note = f', {high / math.tau:g} turns either way' if arm.is_continuous[k] else ''
        radius = '' if arm.radii[k] == NO_BARS else f', radius {arm.radii[k]:.4f} m'
        lines.append(f'  {name}: {low:.4f} to {high:.4f} {unit}{radius}{note}')
    lines.append(f'  ray: radius {arm.radii[-1]:.4f} m')
    if arm.radii[:-1].max() > found.radius:
        lines.append(
            f'radii: more than {found.radius:g} m where a link deviates from its straight bars'
        )
    longest = np.abs(arm.dh[:, [1, 3]]).max()
    size = np.linalg.norm(np.diff(chain.points, axis=0), axis=1).sum()
    if longest > LONG * size and not arm.capsules:
        lines.append(
            f'bars: up to {longest:.2f} m long in an arm of {size:.2f} m: the common normal of '
            'two nearly parallel axes is far away; make them parallel in the URDF'
        )
    if found.ray_lead != 0.0:
        where = 'before' if found.ray_lead > 0.0 else 'beyond'
        lines.append(
            f"ray: starts {abs(found.ray_lead):.4f} m {where} the tool's origin, on the same line"
        )
    velocities = {joint.name: joint.limit and joint.limit.velocity for joint in chain.moving}
    velocities = {name: v if v and np.isfinite(v) else None for name, v in velocities.items()}
    if any(velocities.values()):
        speeds = ', '.join(f'{v:g}' if v else '?' for v in velocities.values())
        missing = ', '.join(name for name, v in velocities.items() if not v)
        note = f'; none given for {missing}: replace each ? by a value' if missing else ''
        lines.append(f'max_velocity of the URDF, for the settings: [{speeds}]{note}')
    far, tilt = found.deviation()
    lines.append(f'differs from the URDF by at most {far:.1e} m and {tilt:.1e} rad')
    return lines


def _report_ray(found: ImportedArm, q: Array) -> list[str]:
    """Return position and ray of the tool, by the arm and by the URDF."""
    lines = [f'at {" ".join(f"{value:g}" for value in q)}, in the base frame:']
    for what, (p, z) in (('arm', found.ray_at(q)), ('URDF', found.urdf_ray_at(q))):
        position, ray = (
            ' '.join(f'{value:.6f}' for value in np.round(v, 6) + 0.0) for v in (p, z)
        )
        lines.append(f'  {what + ":":6} tool at {position} m, ray along {ray}')
    return lines


if __name__ == '__main__':
    sys.exit(main())
