# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A 3-D view of the arm on its wearer, from the direction in which it is hidden least."""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import Any

from matplotlib.colors import to_rgb
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.proj3d import proj_transform
import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.reference_checker import bar_box_contact
from rrth_planner.model.arm import ArmModel, forward_kinematics, pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import positions_at, Trajectory

START, GOAL, PATH, STOP = '#3b6fb6', '#d1495b', '#7b3fa0', '#d9820f'
CLOTH, SKIN = '#8fa3bf', '#e3b898'
# Behind the wearer's boxes, between, and in front of them.
HIDDEN, BODY, VISIBLE = 1.0, 2.0, 3.0
LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])
N_DRAWN = 16
# A ray that passes a target by no more than that points at it [m].
AIMED = 0.01
# How large the space is drawn, and the width of the picture over its height.
ZOOM, SHAPE = 0.93, 1.35
# Of a label from what it names [m].
LABEL_OFFSET = 0.04
# Segments that a line is cut into; each is hidden or visible as a whole.
N_SEGMENTS = 40
FAR = 50.0
# A view along an axis would show no depth.
ELEVATIONS = np.radians([18.0, 24.0, 30.0])
AZIMUTHS = np.radians([q + a for q in (0.0, 90.0, 180.0, 270.0) for a in (25.0, 45.0, 65.0)])


def arm_points(arm: ArmModel, q: Array) -> Array:
    """Return the corners of the arm from the mount to the tool, (2 dof + 3, 3) [m]."""
    poses = np.concatenate([arm.T_base_mount[None], forward_kinematics(arm, q)])
    points = [poses[0, :3, 3]]
    for i in range(1, len(poses)):
        points.append(poses[i - 1, :3, 3] + arm.dh[i - 1, 1] * poses[i - 1, :3, 0])
        points.append(poses[i, :3, 3])
    return np.array(points)


def ray_of(pose: Array, length: float) -> Array:
    """Return both ends of the pointing ray of a tool pose, (4, 4) -> (2, 3) [m]."""
    return np.array([pose[:3, 3], pose[:3, 3] + length * pose[:3, 2]])


def faces_of(box: Box) -> Iterator[tuple[Array, Array]]:
    """Yield the outward normal, (3,), and the corners in turn, (4, 3) [m], of each face."""
    halves = 0.5 * box.size * box.rotation
    for axis, side in product(range(3), (-1.0, 1.0)):
        u, v = np.delete(halves, axis, axis=1).T
        middle = box.center + side * halves[:, axis]
        corners = np.array([middle - u - v, middle + u - v, middle + u + v, middle - u + v])
        yield side * box.rotation[:, axis], corners


def _best_view(scene: Scene, outlines: Array, ray: Array) -> Array:
    """Return the direction to the camera that shows most of the arm and of the ray."""
    arm_points, ray_points = outlines.reshape(-1, 3), _cut(ray).mean(axis=1)
    best, score = np.array([0.0, -1.0, 0.0]), -np.inf
    for elevation, azimuth in product(ELEVATIONS, AZIMUTHS):
        level = np.cos(elevation)
        towards = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        shown = 0.0
        for points, weight in ((arm_points, 1.2), (ray_points, 0.3)):
            across = points - np.outer(points @ towards, towards)
            spread = np.linalg.norm(across - across.mean(axis=0), axis=1).mean()
            shown += weight * spread - _is_hidden(scene, points, towards).mean()
        if shown > score:
            best, score = towards, shown
    return best


def _is_hidden(scene: Scene, points: Array, towards: Array) -> NDArray[np.bool_]:
    """Return which points, (n, 3), the wearer hides from a camera in some direction."""
    line = np.stack([points, points + FAR * towards], axis=1)
    hidden: NDArray[np.bool_] = np.zeros(len(points), dtype=bool)
    for box in scene.boxes:
        hidden |= bar_box_contact(line, box.center, box.rotation, 0.5 * box.size) > 0
    return hidden


def _cut(points: Array) -> Array:
    """Return the short segments of a polyline, (n, 2, 3) [m]."""
    n = max(1, N_SEGMENTS // (len(points) - 1))
    t = np.linspace(0.0, 1.0, n + 1)[:, None]
    lines = points[:-1, None] + t * (points[1:, None] - points[:-1, None])
    return np.stack([lines[:, :-1], lines[:, 1:]], axis=2).reshape(-1, 2, 3)


def draw_motion(
    axes: Any,
    arm: ArmModel,
    scene: Scene,
    trajectory: Trajectory,
    target: Array,
    ray_guard_length: float,
) -> None:
    """
    Draw the wearer, the arm along its motion, the pointing ray, the tool's path and the target.

    The target, (3,), is in the base frame; a ray that does not meet it has `ray_guard_length` [m].
    """
    q, q_dense = (
        positions_at(trajectory, np.linspace(0.0, trajectory.duration, n)) for n in (N_DRAWN, 200)
    )
    draw_configurations(axes, arm, scene, q, q_dense, target, ray_guard_length)


def draw_configurations(
    axes: Any,
    arm: ArmModel,
    scene: Scene,
    q: Array,
    q_dense: Array,
    target: Array | None,
    ray_guard_length: float,
    q_stops: Sequence[Array] = (),
    names: tuple[str, str] = ('start', 'goal'),
    shape: float = SHAPE,
    looked_at: Array | None = None,
) -> None:
    """
    Draw the same for any sequence of configurations.

    Parameters
    ----------
    q : ndarray, shape (n, dof)
        Configurations in which the arm is drawn, from start to goal, n >= 2 [rad].
    q_dense : ndarray, shape (m, dof)
        Configurations along the tool's path [rad].
    target : ndarray, shape (3,), or None
        In the base frame [m].
    ray_guard_length : float
        Drawn length of a ray that does not meet the target [m].
    q_stops : sequence of ndarray, shape (dof,)
        Configurations in which the arm was stopped [rad].
    names : tuple of str
        Labels of the first and the last configuration.
    shape : float
        Width of the picture over its height.
    looked_at : ndarray, shape (k, 3), optional
        A line of which the camera shows most, beside the arm; default: the last ray [m].

    """
    outlines = np.array([arm_points(arm, row) for row in q])
    poses = np.array([forward_kinematics(arm, row)[-1] for row in q_dense])
    first_ray, ray = (ray_of(pose, ray_guard_length) for pose in poses[[0, -1]])
    if target is not None and pointing_error(arm, q_dense[-1], target) <= AIMED:
        ray[1] = target
    targets = [] if target is None else [target[None]]

    towards = _best_view(scene, outlines, ray if looked_at is None else looked_at)
    _frame(axes, scene, np.concatenate([*outlines, ray, first_ray, *targets]), towards, shape)
    for box in scene.boxes:
        _draw_box(axes, box, towards)
    draw_line = partial(_draw_line, axes, scene, towards)
    blend = np.linspace(0.0, 1.0, len(outlines))[:, None]
    colours = (1.0 - blend) * to_rgb(START) + blend * to_rgb(GOAL)
    for outline, colour in zip(outlines[1:-1], colours[1:-1], strict=True):
        draw_line(outline, colour, 1.6, 0.30)
    draw_line(poses[:, :3, 3], PATH, 1.8, 0.95)
    draw_line(first_ray, START, 1.2, 0.7)
    draw_line(ray, GOAL, 1.8, 0.95)
    ends = [(outlines[0], START), (outlines[-1], GOAL)]
    for outline, colour in (*((arm_points(arm, row), STOP) for row in q_stops), *ends):
        draw_line(outline, colour, 5.0, 1.0)
        axes.plot(*outline.T, ls='', marker='o', ms=4.5, color=colour, mec='white', zorder=VISIBLE)
    # The upper label is above its tool in the picture and the lower one below, so they are apart.
    heights = [proj_transform(*outline[-1], axes.get_proj())[1] for outline, _ in ends]
    sides = ((-1.0, 'top'), (1.0, 'bottom'))
    if heights[0] > heights[1]:
        sides = sides[::-1]
    for (outline, colour), name, (side, align) in zip(ends, names, sides, strict=True):
        place = {'ha': 'center', 'va': align, 'color': colour, 'fontsize': 9, 'zorder': 9}
        axes.text(*outline[-1] + [0.0, 0.0, side * LABEL_OFFSET], name, **place)
    if target is None:
        return
    star = {'marker': '*', 'ms': 17, 'color': '#f2b705', 'mec': '#5c4600'}
    axes.plot(*target[:, None], ls='', **star, zorder=9, clip_on=False)
    axes.text(*target + [0.0, 0.0, 0.12], 'target', fontsize=9, ha='center', zorder=9)


def _draw_line(
    axes: Any, scene: Scene, towards: Array, points: Array, colour: Any, width: float, alpha: float
) -> None:
    pieces = _cut(points)
    hidden = _is_hidden(scene, pieces.mean(axis=1), towards)
    style = {'colors': [colour], 'linewidths': width, 'alpha': alpha, 'capstyle': 'round'}
    for part, depth in ((pieces[hidden], HIDDEN), (pieces[~hidden], VISIBLE)):
        if len(part):
            axes.add_collection3d(Line3DCollection(part, **style, zorder=depth))


def _draw_box(axes: Any, box: Box, towards: Array) -> None:
    is_skin = any(part in box.name for part in ('head', 'forearm', 'hand'))
    colour = np.array(to_rgb(SKIN if is_skin else CLOTH))
    faces, shades = [], []
    for normal, corners in faces_of(box):
        if normal @ towards > 0.0:
            faces.append(corners)
            shades.append(colour * (0.72 + 0.28 * max(0.0, float(normal @ LIGHT))))
    # Nearer boxes are drawn later.
    depth = BODY + 0.9 * np.tanh(0.2 * float(box.center @ towards))
    style = {'edgecolors': '#5b6472', 'linewidths': 0.5, 'alpha': 0.82}
    axes.add_collection3d(Poly3DCollection(faces, facecolors=shades, **style, zorder=depth))


def fit_axes(axes: Any, low: Array, high: Array, zoom: float) -> None:
    """Show the space between two corners, (3,) [m], undistorted; what is drawn later is before."""
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.computed_zorder = False


def _frame(axes: Any, scene: Scene, points: Array, towards: Array, shape: float) -> None:
    corners = [face for box in scene.boxes for _, face in faces_of(box)]
    everything = np.concatenate([points, *corners])
    low, high = everything.min(axis=0) - 0.05, everything.max(axis=0) + 0.05
    # Fill the picture: matplotlib keeps the diagonal of the space, whatever its shape, and fits it
    # to the shorter side of the picture.
    right = np.array([-towards[1], towards[0], 0.0]) / np.hypot(*towards[:2])
    up = np.cross(towards, right)
    width, height = (high - low) @ abs(right), (high - low) @ abs(up)
    zoom = (
        ZOOM * np.linalg.norm(high - low) / max(height * min(1.0, shape), width / max(1.0, shape))
    )
    fit_axes(axes, low, high, zoom)
    axes.set_proj_type('persp', focal_length=0.9)
    elevation = np.degrees(np.arcsin(towards[2]))
    azimuth = np.degrees(np.arctan2(towards[1], towards[0]))
    axes.view_init(elev=elevation, azim=azimuth)
    axes.set_xlabel('x forward [m]', fontsize=8)
    axes.set_ylabel('y left [m]', fontsize=8)
    axes.set_zlabel('z up [m]', fontsize=8)
    axes.tick_params(labelsize=7, pad=0)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((0.965, 0.97, 0.98, 1.0))
        axis._axinfo['grid'].update(color='#dfe3e8', linewidth=0.6)
        axis.set_major_locator(MultipleLocator(0.5))
