# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of the frames: the wearer, the mount, the joints, the tool and its pointing ray."""

import argparse
from collections.abc import Sequence
from itertools import product
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
from rrth_planner.model.scene import Scene
from rrth_planner.visualization.arm_view import arm_points

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
    """
    Return a figure of an arm's frames: left on the wearer, right along the arm.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.

    """
    shares = np.resize(SHARE, arm.dof)
    q = arm.bounds[0] + shares * (arm.bounds[1] - arm.bounds[0])
    poses = np.concatenate([arm.T_base_mount[None], forward_kinematics(arm, q)])
    size = float(np.ptp(arm_points(arm, q), axis=0).max())
    names = ['mount: frame 0']
    names += [f'frame {i}: {name}' for i, name in enumerate(arm.joint_names, start=1)]
    names += ['tool']
    figure = Figure(figsize=(12.5, 6.2), facecolor='white')
    FigureCanvasAgg(figure)
    key = 'red: x    green: y    blue: z, the axis of a joint and the pointing ray of the tool'
    figure.text(0.5, 0.055, key, ha='center', color=TEXT)
    key = 'of two frames with the same origin the later one is shorter and thicker'
    figure.text(0.5, 0.02, key, ha='center', color=TEXT)

    body: Any = figure.add_axes((0.0, 0.09, 0.49, 0.9), projection='3d')
    _aim_camera(body, _corners(scene, poses, RAY_SHARE * size), VIEWS[0])
    for box in scene.boxes:
        _draw_box(body, box.center, box.rotation * (0.5 * box.size))
    _draw_arm(body, arm, q, poses, RAY_SHARE * size)
    base = np.eye(4)
    _draw_frame(body, base, 0.45, 2.4)
    for axis, word in enumerate(('x forward', 'y left', 'z up')):
        body.text(*(0.53 * base[:3, axis]), word, color=AXIS_COLOURS[axis], ha='center', zorder=9)
    for pose in (poses[0], poses[-1]):
        _draw_frame(body, pose, 0.35 * size, 2.0)
    ray = poses[-1, :3, 3] + RAY_SHARE * size * poses[-1, :3, 2]
    points = [base[:3, 3], poses[0, :3, 3], poses[-1, :3, 3], ray]
    _label(body, points, ['base frame', 'mount: frame 0', 'tool', 'pointing ray'])

    close: Any = figure.add_axes((0.5, 0.09, 0.49, 0.9), projection='3d')
    _aim_camera(close, _around(poses, 0.26 * size), VIEWS[1])
    _draw_arm(close, arm, q, poses, 0.42 * size)
    for pose, length, width in zip(poses, *_sizes(poses, 0.26 * size), strict=True):
        _draw_frame(close, pose, length, width)
    ray = poses[-1, :3, 3] + 0.42 * size * poses[-1, :3, 2]
    _label(close, [*poses[:, :3, 3], ray], [*names, 'pointing ray'])
    return figure


def _sizes(poses: Array, length: float) -> tuple[list[float], list[float]]:
    """Return how long and how thick each frame is drawn: one on another is shorter, thicker."""
    below = [
        sum(np.allclose(pose[:3, 3], other[:3, 3], atol=1e-6) for other in poses[:i])
        for i, pose in enumerate(poses)
    ]
    return [length * 0.55**n for n in below], [1.6 + 2.0 * n for n in below]


def _draw_frame(axes: Any, pose: Array, length: float, width: float) -> None:
    for axis, colour in enumerate(AXIS_COLOURS):
        end = length * pose[:3, axis]
        axes.quiver(
            *pose[:3, 3], *end, color=colour, linewidth=width, arrow_length_ratio=0.2, zorder=5
        )


def _draw_arm(axes: Any, arm: ArmModel, q: Array, poses: Array, ray_length: float) -> None:
    axes.plot(*arm_points(arm, q).T, color=BAR, lw=6, solid_capstyle='round', alpha=0.55, zorder=3)
    ray = np.array([poses[-1, :3, 3], poses[-1, :3, 3] + ray_length * poses[-1, :3, 2]])
    axes.plot(*ray.T, color=RAY, lw=2.0, ls=(0, (4, 2)), zorder=4)


def _draw_box(axes: Any, center: Array, halves: Array) -> None:
    """Draw a box; the columns of `halves` lead from its centre to its faces, (3, 3) [m]."""
    faces = []
    for axis, side in product(range(3), (-1.0, 1.0)):
        u, v = (halves[:, k] for k in range(3) if k != axis)
        middle = center + side * halves[:, axis]
        faces.append([middle - u - v, middle + u - v, middle + u + v, middle - u + v])
    axes.add_collection3d(
        Poly3DCollection(
            faces, facecolors=SKIN, edgecolors=EDGE, linewidths=0.6, alpha=0.22, zorder=1
        )
    )


def _corners(scene: Scene, poses: Array, ray_length: float) -> Array:
    """Return points that enclose the wearer, the arm and its ray, (n, 3) [m]."""
    ray = poses[-1, :3, 3] + ray_length * poses[-1, :3, 2]
    points = [*poses[:, :3, 3], ray, np.full(3, 0.55)]
    for box in scene.boxes:
        halves = box.rotation * (0.5 * box.size)
        points += [box.center + halves @ signs for signs in product((-1.0, 1.0), repeat=3)]
    return np.array(points)


def _around(poses: Array, reach: float) -> Array:
    """Return points that enclose the arm and its frames, (n, 3) [m]."""
    points: Array = np.concatenate([poses[:, :3, 3] + reach, poses[:, :3, 3] - reach])
    return points


def _aim_camera(axes: Any, points: Array, view: tuple[float, float]) -> None:
    """Fit the axes to points, seen from an elevation and an azimuth [deg]."""
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.07)
    axes.view_init(*view)
    axes.computed_zorder = False
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
    moved: Array = np.minimum(apart, highest)
    return moved


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
        _save(figure, options.output)
    except RrthError as problem:
        print(f'frames_figure: {problem}', file=sys.stderr)
        return 2
    return 0


def _save(figure: Figure, path: Path) -> None:
    try:
        # Without the version of the library the same picture has the same bytes.
        figure.savefig(path, dpi=DOTS_PER_INCH, metadata={'Software': None})
    except (OSError, ValueError) as problem:
        raise SceneError(
            f'file {path}: {problem}, expected a picture file, e.g. .png'
        ) from problem


if __name__ == '__main__':
    sys.exit(main())
