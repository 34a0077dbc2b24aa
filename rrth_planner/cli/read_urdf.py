# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Make the description of an arm from a URDF file."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
import math
import sys
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.file_question import free_share_of, nothing_free, settings_of
from rrth_planner.cli.joint_values import joint_values
from rrth_planner.cli.mount_pose import mount_pose
from rrth_planner.cli.parsers.read_urdf import parser
from rrth_planner.cli.program import program, run, say
from rrth_planner.cli.progress import Progress
from rrth_planner.io.arm_file import arm_from_mapping, arm_to_mapping, arm_to_yaml
from rrth_planner.io.urdf.allowed_pairs import colliding_pairs, disabled_pairs
from rrth_planner.io.urdf.chain import RAYS, read_chain, soft_limits
from rrth_planner.io.urdf.implausible import implausible
from rrth_planner.io.urdf.import_chain import (
    import_chain,
    ImportedArm,
    with_capsules,
    with_ray_radius,
)
from rrth_planner.io.urdf.link_capsules import enclose_links
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel, NO_BARS, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError

if TYPE_CHECKING:
    from rrth_planner.collision.free_share import FreeShare

# How far away a target is proposed, as far as rays are free there [m].
TARGET_DISTANCE = 1.0
# So many links of an SRDF that are none of the arm are named.
MOST_NAMED = 8
# Bars this much longer than all links together are no links.
LONG_FACTOR = 2.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Read a URDF, write an arm, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    # To argparse a -z by itself is another option.
    for k in range(len(given) - 1, 0, -1):
        if given[k - 1] == '--ray' and given[k] in RAYS:
            given[k - 1 : k + 1] = [f'--ray={given[k]}']
    options = parser().parse_args(given)
    return run('read_urdf', lambda: _import(options), 2)


def _import(options: argparse.Namespace) -> None:
    # Not for --help: it has kernels, which take seconds to load and, once, to compile.
    from rrth_planner.planning.pointing_goals import check_pointing_arm

    chain = read_chain(
        options.file, options.base, options.tool, options.ray, takes_jaw=options.jaw
    )
    T_base_link = np.eye(4) if options.mount is None else mount_pose(options.mount)
    found = import_chain(chain, T_base_link, options.radius, options.max_turns)
    shape: list[str] = []
    if options.geometry != 'bars':
        found, shape = _with_flesh(found, options)
    if options.srdf is not None and not found.arm.capsules:
        raise ModelError(
            f'--srdf {options.srdf}: the links are bars, expected collision geometry: its pairs '
            'are links'
        )
    if not found.arm.capsules and options.ray_radius is not None:
        found = with_ray_radius(found, options.ray_radius)
    # As it will be read.
    arm = arm_from_mapping(arm_to_mapping(found.arm, chain.name, T_base_link))
    check_pointing_arm(arm)
    lines = _report(found) + shape
    if options.check is not None:
        lines += _report_ray(found, joint_values(options.check, '--check', arm.joint_names))
    scene, settings = load_body(options.body), settings_of(arm, None)
    room = free_share_of(arm, scene, settings, 'read_urdf')
    comments = [
        f'The arm of {options.file.name} from link {chain.base} to {chain.tool}, '
        f'ray along {options.ray}.'
    ]
    text = arm_to_yaml(found.arm, chain.name, comments, T_base_link)
    options.output.write_text(text, encoding='utf-8')
    worn = 'config/body.yaml' if options.body is None else str(options.body)
    lines += _report_room(room, f'beside the wearer of {worn}, margin {settings.margin:g} m')
    print('\n'.join([*lines, f'written: {options.output}']), flush=True)
    for sentence in implausible(found):
        say('read_urdf', f'warning: {sentence}')
    if room.start is None:
        at_0 = np.linalg.inv(T_base_link) @ arm.T_base_mount
        sentence = nothing_free(
            room, scene, settings, lambda T: replace(arm, T_base_mount=T @ at_0)
        )
        say('read_urdf', f'warning: {sentence}')
    else:
        print(
            f'next: {program("plan")} --arm {options.output} '
            + ('' if options.body is None else f'--body {options.body} ')
            + f'--start auto --target {_target(arm, room)}'
        )


def _target(arm: ArmModel, room: 'FreeShare') -> str:
    """Return a target at which the arm can point, or any, as one types it [m]."""
    if room.aim is None:
        return '1.5 0.1 0.3'
    T = tool_pose(arm, room.aim)
    return ' '.join(
        f'{value:g}' for value in np.round(T[:3, 3] + TARGET_DISTANCE * T[:3, 2], 2) + 0.0
    )


def _report_room(room: 'FreeShare', where: str) -> list[str]:
    """Return how freely an arm moves, and from where, in lines."""
    lines = [f'free: {100.0 * room.share:.1f} % of 1000 random configurations, {where}']
    if room.start is not None:
        numbers = [round(float(value), 6) + 0.0 for value in room.start]
        lines.append(
            f'start: --from {" ".join(f"{value:g}" for value in numbers)} is free, as --start '
            f'auto finds; of the nodes: -p "initial_positions:={numbers}"'
        )
    return lines


def _with_flesh(found: ImportedArm, options: argparse.Namespace) -> tuple[ImportedArm, list[str]]:
    """Return an arm with capsules round its links, and a description of them, in lines."""
    with Progress('read_urdf') as progress:
        flesh = enclose_links(
            found,
            options.include_branches,
            options.geometry,
            lambda link: progress(f'enclosing link "{link}" in capsules'),
        )
    lines = []
    if flesh.left_out:
        lines.append(
            f'left out: {", ".join(flesh.left_out)}, moved by joints beside the chain; '
            '--include-branches encloses them in all their positions'
        )
    if not flesh.capsules:
        none = 'geometry' if options.geometry == 'visual' else 'collision geometry'
        no_shape = f'shape: no {none}: each link is a bar from joint to joint'
        if flesh.bare:
            say('read_urdf', f'warning: {_seen(flesh.bare)}; links are bars of {found.radius:g} m')
        return found, [*lines, no_shape]
    found = with_capsules(found, flesh.capsules, options.ray_radius or 0.0)
    always = colliding_pairs(found.arm)
    pairs = list(always)
    if options.srdf is not None:
        named, strangers = disabled_pairs(options.srdf, found.arm, found.chain.name)
        known = {frozenset(pair) for pair in always}
        pairs += [pair for pair in named if frozenset(pair) not in known]
        lines.append(f'may meet, by {options.srdf.name}: {_listed(pairs[len(always) :])}')
        if strangers:
            some = ', '.join(strangers[:MOST_NAMED]) + (', ...' * (len(strangers) > MOST_NAMED))
            count = f'{len(strangers)} link{"s" * (len(strangers) > 1)}'
            lines.append(f'no part of the arm, but in {options.srdf.name}: {count}: {some}')
    if always:
        lines.append(f'may meet, since they nearly always do: {_listed(always)}')
    if flesh.bare:
        lines.append(f'not checked: {_seen(flesh.bare)}')
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


def _seen(links: Sequence[str]) -> str:
    return f'give --geometry visual to enclose what is only seen: {", ".join(links)}'


def _listed(pairs: Sequence[tuple[str, str]]) -> str:
    return ', '.join(f'{one} and {other}' for one, other in pairs) or 'none'


def _report(found: ImportedArm) -> list[str]:
    """Return a description of an arm, in lines."""
    arm, chain = found.arm, found.chain
    lines = [f'arm "{chain.name}" of {arm.dof} joints, from {chain.base} to {chain.tool}']
    for k, name in enumerate(arm.joint_names):
        unit = arm.units[k]
        low, high = arm.bounds[:, k]
        note = f', {high / math.tau:g} turns either way' if arm.is_continuous[k] else ''
        radius = '' if arm.radii[k] == NO_BARS else f', radius {arm.radii[k]:.4f} m'
        if not arm.is_continuous[k] and np.isfinite(soft_limits(chain.moving[k])).any():
            limit = chain.moving[k].limit
            hard = f'{limit.lower:g} to {limit.upper:g}'
            note = f', within soft limits of safety_controller (limits {hard})'
        lines.append(f'  {name}: {low:.4f} to {high:.4f} {unit}{radius}{note}')
    lines.append(f'  ray: radius {arm.radii[-1]:.4f} m')
    if arm.radii[:-1].max() > found.radius:
        lines.append(
            f'radii: more than {found.radius:g} m where a link deviates from its straight bars'
        )
    longest = np.abs(arm.dh[:, [1, 3]]).max()
    size = np.linalg.norm(np.diff(chain.points, axis=0), axis=1).sum()
    if longest > LONG_FACTOR * size and not arm.capsules:
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
