# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of the frames: the wearer, the mount, the joints, the tool and its pointing ray."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import proj3d
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
import numpy as np
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError, SceneError
from rrth_planner.model.joint_range import turns_near
from rrth_planner.model.scene import Scene
from rrth_planner.visualization.arm_view import arm_points, faces_of, fit_axes, ray_of

DESCRIPTION = """\
Draw the frames that docs/conventions.md names: left on the wearer, right along the arm.
"""
# x, y and z of every frame.
AXIS_COLOURS = ('#d1495b', '#2f9e6e', '#1b6ca8')
BAR, RAY, SKIN, EDGE, TEXT = '#4a5763', '#d97706', '#c9d3df', '#9aa7b5', '#30343b'
# Elevation and azimuth of the camera, for each side [deg].
VIEWS = ((14.0, -142.0), (16.0, -128.0))
# How far into the range of each joint the arm stands: no two axes in line.
SHARE = (0.57, 0.30, 0.66, 0.40)
# Length of the ray on the left over the size of the arm.
RAY_SHARE = 0.8
# Least distance of two labels, and where they may be, as shares of the height.
GAP, LOWEST, HIGHEST = 0.075, 0.06, 0.96
DOTS_PER_INCH = 110


def frames_figure(arm: ArmModel, scene: Scene) -> Figure:
    """Return a figure of an arm's frames: left on the wearer, right along the arm."""
    low, high = turns_near(arm, arm.bounds, np.zeros(arm.dof), 1)
    q = low + np.resize(SHARE, arm.dof) * (high - low)
    poses = np.concatenate([arm.T_base_mount[None], forward_kinematics(arm, q)])
    size = float(np.ptp(arm_points(arm, q), axis=0).max())
    joints = [f'frame {i}: {name}' for i, name in enumerate(arm.joint_names, start=1)]
    names = ['mount: frame 0', *joints, 'tool']
    figure = Figure(figsize=(12.5, 6.2), facecolor='white')
    FigureCanvasAgg(figure)
    key = 'red: x    green: y    blue: z, the axis of a joint and the pointing ray of the tool'
    figure.text(0.5, 0.055, key, ha='center', color=TEXT)
    key = 'of two frames with the same origin the later one is shorter and thicker'
    figure.text(0.5, 0.02, key, ha='center', color=TEXT)

    mount, tool = poses[[0, -1]]
    body: Any = figure.add_axes((0.0, 0.09, 0.49, 0.9), projection='3d')
    ray = ray_of(tool, RAY_SHARE * size)
    boxes = [[corners for _, corners in faces_of(box)] for box in scene.boxes]
    points = [*poses[:, :3, 3], *ray, np.full(3, 0.55), *np.reshape(boxes, (-1, 3))]
    _aim_camera(body, np.array(points), VIEWS[0])
    for faces in boxes:
        style = {'facecolors': SKIN, 'edgecolors': EDGE, 'linewidths': 0.6, 'alpha': 0.22}
        body.add_collection3d(Poly3DCollection(faces, **style, zorder=1))
    _draw_arm(body, arm, q, ray)
    base = np.eye(4)
    _draw_frame(body, base, 0.45, 2.4)
    for axis, word in enumerate(('x forward', 'y left', 'z up')):
        body.text(*(0.53 * base[:3, axis]), word, color=AXIS_COLOURS[axis], ha='center', zorder=9)
    for pose in (mount, tool):
        _draw_frame(body, pose, 0.35 * size, 2.0)
    points = [base[:3, 3], mount[:3, 3], *ray]
    _label(body, points, ['base frame', 'mount: frame 0', 'tool', 'pointing ray'])

    close: Any = figure.add_axes((0.5, 0.09, 0.49, 0.9), projection='3d')
    ray, reach = ray_of(tool, 0.42 * size), 0.26 * size
    _aim_camera(
        close, np.concatenate([poses[:, :3, 3] + reach, poses[:, :3, 3] - reach]), VIEWS[1]
    )
    _draw_arm(close, arm, q, ray)
    for i, pose in enumerate(poses):
        # A frame on an earlier one is shorter and thicker.
        n = sum(np.allclose(pose[:3, 3], other[:3, 3], atol=1e-6) for other in poses[:i])
        _draw_frame(close, pose, reach * 0.55**n, 1.6 + 2.0 * n)
    _label(close, [*poses[:, :3, 3], ray[1]], [*names, 'pointing ray'])
    return figure


def _draw_frame(axes: Any, pose: Array, length: float, width: float) -> None:
    for axis, colour in enumerate(AXIS_COLOURS):
        end = length * pose[:3, axis]
        axes.quiver(
            *pose[:3, 3], *end, color=colour, linewidth=width, arrow_length_ratio=0.2, zorder=5
        )


def _draw_arm(axes: Any, arm: ArmModel, q: Array, ray: Array) -> None:
    axes.plot(*arm_points(arm, q).T, color=BAR, lw=6, solid_capstyle='round', alpha=0.55, zorder=3)
    axes.plot(*ray.T, color=RAY, lw=2.0, ls=(0, (4, 2)), zorder=4)


def _aim_camera(axes: Any, points: Array, view: tuple[float, float]) -> None:
    """Fit the axes to points, (n, 3) [m], seen from an elevation and an azimuth [deg]."""
    fit_axes(axes, points.min(axis=0), points.max(axis=0), 1.07)
    axes.view_init(*view)
    axes.set_axis_off()


def _label(axes: Any, points: Sequence[Array], names: Sequence[str]) -> None:
    """Name points in a column at the side, each near its height, so that none overlap."""
    projected = [proj3d.proj_transform(*point, axes.get_proj())[:2] for point in points]
    to_share = axes.transData + axes.transAxes.inverted()
    heights = np.array([to_share.transform(point)[1] for point in projected])
    order = np.argsort(heights)
    for i, height in zip(order, _apart(heights[order]), strict=True):
        axes.annotate(
            names[i],
            xy=projected[i],
            xytext=(0.98, height),
            textcoords='axes fraction',
            annotation_clip=False,
            ha='right',
            va='center',
            fontsize=10,
            color=TEXT,
            zorder=10,
            bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.5, 'alpha': 0.85},
            arrowprops={'arrowstyle': '-', 'color': TEXT, 'lw': 0.7, 'shrinkB': 0.0},
        )


def _apart(heights: Array) -> Array:
    """Return rising heights moved apart to at least a gap, and into the axes."""
    steps = GAP * np.arange(len(heights))
    # The least rising sequence above, less the steps that it needs.
    apart = np.maximum.accumulate(np.clip(heights, LOWEST, HIGHEST) - steps) + steps
    highest = HIGHEST - steps[::-1]
    return np.minimum(apart, highest)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the picture and return the exit code."""
    parser = argparse.ArgumentParser(prog='frames_figure', description=DESCRIPTION)
    parser.add_argument(
        '--output', type=Path, default=Path('frames.png'), help='picture file (%(default)s)'
    )
    parser.add_argument(
        '--arm', type=Path, metavar='FILE', help='the arm, as config/arm.yaml (default: that one)'
    )
    options = parser.parse_args(arguments)
    try:
        figure = frames_figure(load_arm(options.arm), load_body())
        try:
            # Without the version of the library the same picture has the same bytes.
            figure.savefig(options.output, dpi=DOTS_PER_INCH, metadata={'Software': None})
        except (OSError, ValueError) as problem:
            raise SceneError(
                f'file {options.output}: {problem}, expected a picture file, e.g. .png'
            ) from problem
    except RrthError as problem:
        print(f'frames_figure: {problem}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
