# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A 3-D view of the arm on its wearer, from the direction in which it is hidden least."""

from collections.abc import Sequence
from itertools import product
from typing import Any

from matplotlib.colors import to_rgb
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
import numpy as np
from rrth_planner.model.arm import ArmModel, forward_kinematics, pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.visualization.occlusion import best_view, cut, is_hidden

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


def arm_points(arm: ArmModel, q: Array) -> Array:
    """Return the corners of the arm from the mount to the tool, (2 dof + 3, 3) [m]."""
    poses = np.concatenate([arm.T_base_mount[None], forward_kinematics(arm, q)])
    points = [poses[0, :3, 3]]
    for i in range(1, len(poses)):
        points.append(poses[i - 1, :3, 3] + arm.dh[i - 1, 1] * poses[i - 1, :3, 0])
        points.append(poses[i, :3, 3])
    return np.array(points)


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

    Parameters
    ----------
    axes : Axes3D
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    trajectory : Trajectory
    target : ndarray, shape (3,)
        In the base frame [m].
    ray_guard_length : float
        Drawn length of the ray where it does not meet the target yet [m].

    """
    q = sample(trajectory, np.linspace(0.0, trajectory.duration, N_DRAWN))[0]
    q_dense = sample(trajectory, np.linspace(0.0, trajectory.duration, 200))[0]
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
    towards: Array | None = None,
) -> None:
    """
    Draw the same for any sequence of configurations.

    Parameters
    ----------
    axes : Axes3D
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
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
    towards : ndarray, shape (3,), optional
        Direction to the camera; default: the one that shows most of the arm and of the last ray.

    """
    outlines = np.array([arm_points(arm, row) for row in q])
    poses = np.array([forward_kinematics(arm, row)[-1] for row in q_dense])
    tool_path, first, last = poses[:, :3, 3], poses[0], poses[-1]
    first_ray = np.array([first[:3, 3], first[:3, 3] + ray_guard_length * first[:3, 2]])
    ray = np.array([last[:3, 3], last[:3, 3] + ray_guard_length * last[:3, 2]])
    if target is not None and pointing_error(arm, q_dense[-1], target) <= AIMED:
        ray[1] = target
    targets = [] if target is None else [target[None]]

    if towards is None:
        towards = best_view(scene, outlines, ray)
    _frame(axes, scene, np.concatenate([*outlines, ray, first_ray, *targets]), towards, shape)
    for box in scene.boxes:
        _draw_box(axes, box, towards)
    blend = np.linspace(0.0, 1.0, len(outlines))[:, None]
    colours = (1.0 - blend) * to_rgb(START) + blend * to_rgb(GOAL)
    for outline, colour in zip(outlines[1:-1], colours[1:-1], strict=True):
        _draw_line(axes, scene, towards, outline, colour, 1.6, 0.30)
    _draw_line(axes, scene, towards, tool_path, PATH, 1.8, 0.95)
    _draw_line(axes, scene, towards, first_ray, START, 1.2, 0.7)
    _draw_line(axes, scene, towards, ray, GOAL, 1.8, 0.95)
    ends = [(outlines[0], START, names[0], -0.14), (outlines[-1], GOAL, names[1], 0.07)]
    stops = [(arm_points(arm, row), STOP, '', 0.0) for row in q_stops]
    for outline, colour, name, offset in (*stops, *ends):
        _draw_line(axes, scene, towards, outline, colour, 5.0, 1.0)
        axes.plot(*outline.T, ls='', marker='o', ms=4.5, color=colour, mec='white', zorder=VISIBLE)
        axes.text(*outline[-1] + [0.0, 0.0, offset], name, color=colour, fontsize=9, zorder=9)
    if target is None:
        return
    axes.plot(
        *target[:, None],
        ls='',
        marker='*',
        ms=17,
        color='#f2b705',
        mec='#5c4600',
        zorder=9,
        clip_on=False,
    )
    axes.text(*target + [0.0, 0.0, 0.12], 'target', fontsize=9, ha='center', zorder=9)


def _draw_line(
    axes: Any,
    scene: Scene,
    towards: Array,
    points: Array,
    colour: Any,
    width: float,
    alpha: float,
) -> None:
    pieces = cut(points)
    hidden = is_hidden(scene, pieces.mean(axis=1), towards)
    for part, depth in ((pieces[hidden], HIDDEN), (pieces[~hidden], VISIBLE)):
        if len(part):
            lines = Line3DCollection(
                part, colors=[colour], linewidths=width, alpha=alpha, zorder=depth
            )
            lines.set_capstyle('round')
            axes.add_collection3d(lines)


def _draw_box(axes: Any, box: Box, towards: Array) -> None:
    colour = SKIN if any(part in box.name for part in ('head', 'forearm', 'hand')) else CLOTH
    faces, shades = [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = side * box.rotation[:, axis]
            if normal @ towards <= 0.0:
                continue
            u, v = (0.5 * box.size[k] * box.rotation[:, k] for k in range(3) if k != axis)
            middle = box.center + 0.5 * box.size[axis] * normal
            faces.append([middle - u - v, middle + u - v, middle + u + v, middle - u + v])
            shades.append(
                np.array(to_rgb(colour)) * (0.72 + 0.28 * max(0.0, float(normal @ LIGHT)))
            )
    # Nearer boxes are drawn later.
    depth = BODY + 0.9 * np.tanh(0.2 * float(box.center @ towards))
    axes.add_collection3d(
        Poly3DCollection(
            faces,
            facecolors=shades,
            edgecolors='#5b6472',
            linewidths=0.5,
            alpha=0.82,
            zorder=depth,
        )
    )


def _frame(axes: Any, scene: Scene, points: Array, towards: Array, shape: float) -> None:
    corners = [
        box.center + box.rotation @ (0.5 * box.size * np.array(signs))
        for box in scene.boxes
        for signs in product((-1.0, 1.0), repeat=3)
    ]
    everything = np.concatenate([points, np.array(corners).reshape(-1, 3)])
    low, high = everything.min(axis=0) - 0.05, everything.max(axis=0) + 0.05
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    # Fill the picture: matplotlib keeps the diagonal of the space, whatever its shape, and fits it
    # to the shorter side of the picture.
    right = np.array([-towards[1], towards[0], 0.0]) / np.hypot(*towards[:2])
    up = np.cross(towards, right)
    width, height = (high - low) @ abs(right), (high - low) @ abs(up)
    zoom = (
        ZOOM * np.linalg.norm(high - low) / max(height * min(1.0, shape), width / max(1.0, shape))
    )
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.set_proj_type('persp', focal_length=0.9)
    axes.computed_zorder = False
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
