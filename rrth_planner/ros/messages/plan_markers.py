# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Markers of a plan for RViz: body with margin, arm, pointing ray and path of the tool."""

from collections.abc import Iterable

from geometry_msgs.msg import Point
from nav_msgs.msg import Path
import numpy as np
from rrth_planner.model.arm import ArmModel, capsule_ends, forward_kinematics
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import quaternion_xyzw, turned_to
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import Trajectory
from visualization_msgs.msg import Marker, MarkerArray

Color = tuple[float, float, float, float]

BODY: Color = (0.85, 0.65, 0.55, 0.35)
START: Color = (0.45, 0.45, 0.50, 1.0)
GOAL: Color = (0.10, 0.35, 0.75, 1.0)
RAY: Color = (0.90, 0.15, 0.15, 0.9)
TOOL_PATH: Color = (0.15, 0.60, 0.30, 1.0)
TEXT: Color = (0.15, 0.15, 0.15, 1.0)
BAR_WIDTH, LINE_WIDTH = 0.02, 0.006
# How opaque capsules are, and lengths without a cylinder [m].
SHADE, SHORTEST = 0.4, 1e-6
# Of letters, and where they stand above the mount [m].
TEXT_HEIGHT, TEXT_ABOVE = 0.03, 0.15


def plan_markers(
    arm: ArmModel,
    scene: Scene,
    margin: float,
    trajectory: Trajectory,
    target: Array,
    tool_path: Path,
) -> MarkerArray:
    """
    Return all markers of a plan; the first one clears those of the plan before.

    Boxes are shown grown by the margin [m]; the target, shape (3,) [m], is in the base frame, that
    of the tool's path and of all markers.
    """
    q_start, q_goal = trajectory.positions[0], trajectory.positions[-1]
    tool = forward_kinematics(arm, q_goal)[-1, :3, 3]
    steps = [pose.pose.position for pose in tool_path.poses]
    markers = [
        *(box_marker('body', k, box, BODY, margin) for k, box in enumerate(scene.boxes)),
        _line('arm_start', _points(_bars(arm, q_start)), BAR_WIDTH, START),
        _line('arm_goal', _points(_bars(arm, q_goal)), BAR_WIDTH, GOAL),
        *_capsules('arm_start_capsules', arm, q_start, (*START[:3], SHADE)),
        *_capsules('arm_goal_capsules', arm, q_goal, (*GOAL[:3], SHADE)),
        *_meetings(arm),
        _line('ray', _points((tool, target)), LINE_WIDTH, RAY),
        _line('tool_path', steps, LINE_WIDTH, TOOL_PATH),
    ]
    for marker in markers:
        marker.header.frame_id = tool_path.header.frame_id
    return MarkerArray(markers=[Marker(action=Marker.DELETEALL), *markers])


def _bars(arm: ArmModel, q: Array) -> list[Array]:
    """Return the corners of the arm's bars in the base frame, from the mount outwards [m]."""
    corners = [arm.T_base_mount[:3, 3]]
    for i, T in enumerate(forward_kinematics(arm, q)):
        slide = q[i] if i < arm.dof and arm.is_prismatic[i] else 0.0
        for corner in (T[:3, 3] - (arm.dh[i, 3] + slide) * T[:3, 2], T[:3, 3]):
            if np.abs(corner - corners[-1]).max() > 1e-9:
                corners.append(corner)
    return corners


def _capsules(ns: str, arm: ArmModel, q: Array, color: Color) -> list[Marker]:
    """Return the capsules of the arm: cylinders with a sphere at both ends."""
    markers: list[Marker] = []
    for (begin, end), capsule in zip(capsule_ends(arm, q), arm.capsules, strict=True):
        width, length = 2.0 * capsule.radius, float(np.linalg.norm(end - begin))
        rotation, parts = np.eye(3), [(Marker.SPHERE, begin, width)]
        if length > SHORTEST:
            rotation = turned_to((end - begin) / length)
            middle = 0.5 * (begin + end)
            parts += [(Marker.SPHERE, end, width), (Marker.CYLINDER, middle, length)]
        for kind, center, height in parts:
            marker = _marker(ns, len(markers), kind, color)
            _place(marker, center, rotation, np.array([width, width, height]))
            markers.append(marker)
    return markers


def _meetings(arm: ArmModel) -> list[Marker]:
    """Return what may meet as a text at the mount; nothing where nothing may."""
    if not arm.allowed:
        return []
    marker = _marker('allowed', 0, Marker.TEXT_VIEW_FACING, TEXT)
    marker.text = '\n'.join(f'{part} may meet {other}' for part, other in arm.allowed)
    place = arm.T_base_mount[:3, 3] + [0.0, 0.0, TEXT_ABOVE]
    _place(marker, place, np.eye(3), np.array([0.0, 0.0, TEXT_HEIGHT]))
    return [marker]


def _points(positions: Iterable[Array]) -> list[Point]:
    return [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in positions]


def _marker(ns: str, index: int, kind: int, color: Color) -> Marker:
    marker = Marker(ns=ns, id=index, type=kind, action=Marker.ADD)
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = color
    return marker


def _line(ns: str, points: list[Point], width: float, color: Color) -> Marker:
    marker = _marker(ns, 0, Marker.LINE_STRIP, color)
    marker.scale.x, marker.points = width, points
    return marker


def box_marker(ns: str, index: int, box: Box, color: Color, margin: float = 0.0) -> Marker:
    """Return a box, grown by a margin on every side [m], as a marker without a frame."""
    marker = _marker(ns, index, Marker.CUBE, color)
    _place(marker, box.center, box.rotation, box.size + 2.0 * margin)
    return marker


def _place(marker: Marker, center: Array, rotation: Array, size: Array) -> None:
    p, o, s = marker.pose.position, marker.pose.orientation, marker.scale
    p.x, p.y, p.z = center.tolist()
    o.x, o.y, o.z, o.w = quaternion_xyzw(rotation).tolist()
    s.x, s.y, s.z = size.tolist()
