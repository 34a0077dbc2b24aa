# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Make the description of an arm from a URDF file."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

import numpy as np
from rrth_planner.cli.program import command_parser, joint_values, run
from rrth_planner.io.arm_file import arm_from_mapping, arm_to_mapping, arm_to_yaml
from rrth_planner.io.urdf.chain import RAYS, read_chain
from rrth_planner.io.urdf.import_chain import import_chain, ImportedArm
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import ModelError
from rrth_planner.model.rotation import pose_matrix

# Bars this much longer than all links together are no links.
LONG = 2.0
DESCRIPTION = """\
Read the joints between two links of a URDF and write them as an arm of the planner, laid out as
config/arm.yaml: modified Denavit-Hartenberg rows, limits, radii, mount and tool. Meshes are
ignored: the planner models every link as a bar from joint to joint, with the radius given here.
"""
EPILOG = """\
The conversion is exact for any chain of revolute, continuous, prismatic and fixed joints. The
result is compared with the URDF at many configurations, and the difference is printed. Continuous
joints get limits of +-pi. Branches beside the chain, such as fingers, are left out.

exit codes: 0  the file has been written
            2  wrong usage, or a URDF without such a chain (the reason is printed)
          130  interrupted

example:    %(prog)s config/examples/chest_arm.urdf --ray +x --radius 0.025 \\
                --output my_arm.yaml --check 0 -0.5 1 0 0.3 0
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Read a URDF, write an arm, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    # To argparse a -z by itself is another option.
    for k in range(len(given) - 1, 0, -1):
        if given[k - 1] == '--ray' and given[k] in RAYS:
            given[k - 1 : k + 1] = [f'--ray={given[k]}']
    options = _parser().parse_args(given)
    return run('read_urdf', lambda: _import(options), 2)


def _import(options: argparse.Namespace) -> None:
    # Not for --help: it has kernels, which take seconds to load and, once, to compile.
    from rrth_planner.planning.pointing_goals import check_pointing_arm

    chain = read_chain(options.file, options.base, options.tool, options.ray)
    found = import_chain(chain, _mount(options.mount), options.radius)
    # As it will be read.
    arm = arm_from_mapping(arm_to_mapping(found.arm, chain.name))
    check_pointing_arm(arm)
    lines = _report(found)
    if options.check is not None:
        lines += _report_ray(found, joint_values(options.check, '--check', arm.joint_names))
    comments = [
        f'The arm of {options.file.name} from link {chain.base} to {chain.tool}, '
        f'ray along {options.ray}.'
    ]
    options.output.write_text(arm_to_yaml(found.arm, chain.name, comments), encoding='utf-8')
    print('\n'.join([*lines, f'written: {options.output}']))


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
        endless = chain.moving[k].type == 'continuous'
        note = ', +-pi for a continuous joint' if endless else ''
        lines.append(
            f'  {name}: {low:.4f} to {high:.4f} {unit}, radius {arm.radii[k]:.4f} m{note}'
        )
    lines.append(f'  ray: radius {arm.radii[-1]:.4f} m')
    if arm.radii.max() > found.radius:
        lines.append(
            f'radii: more than {found.radius:g} m where a link deviates from its straight bars'
        )
    longest = np.abs(arm.dh[:, [1, 3]]).max()
    size = np.linalg.norm(np.diff(chain.points, axis=0), axis=1).sum()
    if longest > LONG * size:
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


def _parser() -> argparse.ArgumentParser:
    parser = command_parser('read_urdf', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('file', type=Path, metavar='FILE', help='the URDF file')
    add('--base', metavar='LINK', help='first link of the chain (the root)')
    add('--tool', metavar='LINK', help='last link (the one that ends the chain)')
    add(
        '--ray',
        default='+z',
        metavar='AXIS',
        help='axis of the tool link that is the pointing ray: +x -x +y -y +z -z (%(default)s)',
    )
    add(
        '--mount',
        type=float,
        nargs=7,
        metavar=('X', 'Y', 'Z', 'QX', 'QY', 'QZ', 'QW'),
        help="pose of the first link in the wearer's base frame [m] (the same frame)",
    )
    radius = 'radius of the links [m] (%(default)s)'
    add('--radius', type=float, default=0.03, metavar='M', help=radius)
    add('--output', type=Path, required=True, metavar='FILE', help='arm file to write')
    check = 'print the tool pose at these joint positions [rad or m]'
    add('--check', type=float, nargs='+', metavar='Q', help=check)
    return parser


if __name__ == '__main__':
    sys.exit(main())
