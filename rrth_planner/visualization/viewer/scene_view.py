# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene of the page: wearer, margin, arm, ray, target, tree and paths."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rrth_planner.io.urdf.placed_robot import PlacedRobot
from rrth_planner.model.arm import ArmModel, capsule_ends, pointing_error, tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Box, Scene
from rrth_planner.planning.result import Tree
from rrth_planner.visualization.arm_view import arm_points, ray_of
from rrth_planner.visualization.viewer.curves import (
    along_z,
    segments_of,
    tool_positions,
    tree_segments,
    wxyz,
)
import viser
from viser.extras import ViserUrdf

Color = tuple[int, int, int]
CLOTH, SKIN, SHELL = (126, 147, 178), (227, 184, 152), (70, 110, 170)
REACH = (224, 122, 47)
BAR, JOINT, GHOST, RAY = (38, 43, 52), (232, 138, 32), (110, 116, 128), (209, 50, 70)
TARGET = (242, 183, 5)
# The trees from the start and from the goals; the path as found, shortened, and in time.
TREES: tuple[Color, Color] = ((59, 111, 182), (200, 60, 140))
FIRST, SHORT, TIMED = (224, 123, 0), (20, 140, 80), (123, 63, 160)
# Thinnest bar, and the ray [m].
BAR_RADIUS, RAY_RADIUS = 0.014, 0.005
# Boxes whose sizes differ by less are drawn alike [m].
SAME_SIZE = 1e-3
# A ray closer to the target than this meets it [m].
AIMED = 5e-3
# The camera at first: behind the wearer, to the right [m].
CAMERA, LOOK_AT = (-1.45, -1.3, 1.15), (0.25, 0.05, 0.24)
LAYERS = ('margin', 'start', 'tree', 'first', 'short', 'timed')
# Colours and widths of the paths of the tool [m].
PATHS = {'first': (FIRST, 0.007), 'short': (SHORT, 0.007), 'timed': (TIMED, 0.010)}


class ArmShape:
    """Bars, joints and capsules of the arm in one configuration."""

    def __init__(
        self, server: viser.ViserServer, name: str, arm: ArmModel, opacity: float | None = None
    ) -> None:
        """Create all bars with length zero."""
        self._arm = arm
        bar, joint = (BAR, JOINT) if opacity is None else (GHOST, GHOST)
        radii = np.repeat(np.maximum(arm.radii, BAR_RADIUS), 2)
        options: dict[str, Any] = {'opacity': opacity, 'cast_shadow': opacity is None}
        self._capsules = [
            (
                server.scene.add_cylinder(f'{name}/capsule_{k}', c.radius, 1.0, bar, **options),
                [
                    server.scene.add_icosphere(f'{name}/cap_{k}_{end}', c.radius, bar, **options)
                    for end in (0, 1)
                ],
            )
            for k, c in enumerate(arm.capsules)
        ]
        self._bars = [
            server.scene.add_cylinder(f'{name}/bar_{k}', float(r), 1.0, bar, **options)
            for k, r in enumerate(radii)
        ]
        self._joints = [
            server.scene.add_icosphere(f'{name}/joint_{k}', 1.45 * float(r), joint, **options)
            for k, r in enumerate(np.append(radii[:1], radii))
        ]

    def move(self, q: Array) -> None:
        """Move to a configuration, (dof,) [rad]."""
        points = arm_points(self._arm, q)
        ends = capsule_ends(self._arm, q)
        for (cylinder, caps), places in zip(self._capsules, ends, strict=True):
            place_bar(cylinder, *places)
            for cap, place in zip(caps, places, strict=True):
                cap.position = place
        for k, bar in enumerate(self._bars):
            place_bar(bar, points[k], points[k + 1])
            self._joints[k + 1].position = points[k + 1]
        self._joints[0].position = points[0]


class SceneView:
    """Draw into a server's scene, x forward, y left, z up [m]."""

    def __init__(
        self,
        server: viser.ViserServer,
        arm: ArmModel,
        ray_guard_length: float,
        robot: PlacedRobot | None = None,
    ) -> None:
        """
        Set up camera, floor and layers; a ray that meets no target is drawn so long [m].

        robot: the one that the arm was read from; its meshes are shown, and the arm transparent.
        """
        self._scene, self._arm, self._ray_length = server.scene, arm, ray_guard_length
        server.scene.set_up_direction('+z')
        server.initial_camera.position, server.initial_camera.look_at = CAMERA, LOOK_AT
        server.scene.add_grid(
            '/floor', 6.0, 6.0, position=(0.0, 0.0, -0.87), cell_size=0.25, section_size=1.0
        )
        self.layers = {
            name: server.scene.add_frame(f'/{name}', show_axes=False) for name in LAYERS
        }
        self._robot = robot
        if robot is not None:
            T = robot.T_base_root
            self.layers['meshes'] = server.scene.add_frame(
                '/meshes', show_axes=False, position=T[:3, 3], wxyz=wxyz(T[:3, :3])
            )
            self._meshes = ViserUrdf(server, robot.model, root_node_name='/meshes')
        self.arm = ArmShape(server, '/arm', arm, None if robot is None else 0.45)
        self.start = ArmShape(server, '/start', arm, 0.35)
        self._ray = server.scene.add_cylinder('/ray', RAY_RADIUS, 1.0, RAY, cast_shadow=False)
        self.target = server.scene.add_transform_controls(
            '/target', scale=0.28, disable_rotations=True, disable_sliders=True, depth_test=False
        )
        server.scene.add_icosphere('/target/ball', 0.035, TARGET)
        self._drawn: dict[str, list[Any]] = {}
        self._names: list[str] = []

    @property
    def body(self) -> list[Any]:
        """The wearer's boxes as they are drawn."""
        return self._drawn.get('body', [])

    @property
    def reach(self) -> list[Any]:
        """What is drawn of how far parts of the wearer may get."""
        return self._drawn.get('reach', [])

    def show_body(self, scene: Scene, margin: float) -> None:
        """Draw the wearer's boxes, each in a shell of the margin [m]."""
        add = self._scene.add_box
        unlit = {'opacity': 0.16, 'cast_shadow': False, 'receive_shadow': False}
        boxes: list[Any] = []
        shells: list[Any] = []
        for k, box in enumerate(scene.boxes):
            place = {'position': box.center, 'wxyz': wxyz(box.rotation)}
            is_skin = any(part in box.name for part in ('head', 'forearm', 'hand'))
            boxes.append(add(f'/body/{k}', SKIN if is_skin else CLOTH, box.size, **place))
            shells.append(add(f'/margin/{k}', SHELL, box.size + 2.0 * margin, **unlit, **place))
        self._replace('body', boxes)
        self._replace('margin', shells)

    def show_reach(self, boxes: Sequence[Box]) -> None:
        """Draw how large parts of the wearer may have got, in a layer of their own."""
        style: Any = {'opacity': 0.18, 'cast_shadow': False, 'receive_shadow': False}
        self._replace(
            'reach',
            [
                self._scene.add_box(
                    f'/reach/{k}', REACH, b.size, position=b.center, wxyz=wxyz(b.rotation), **style
                )
                for k, b in enumerate(boxes)
            ],
        )

    def move_body(self, scene: Scene, margin: float) -> None:
        """Draw the wearer's boxes as `show_body` does, moving those that are drawn already."""
        names = [box.name for box in scene.boxes]
        if names != self._names:
            self._names = names
            self.show_body(scene, margin)
            return
        for box, *handles in zip(scene.boxes, self.body, self._drawn['margin'], strict=True):
            quaternion = wxyz(box.rotation)
            for handle, size in zip(handles, (box.size, box.size + 2.0 * margin), strict=True):
                handle.position, handle.wxyz = box.center, quaternion
                if np.abs(np.asarray(handle.dimensions) - size).max() > SAME_SIZE:
                    handle.dimensions = tuple(size.tolist())

    def show_configuration(self, q: Array, target: Array | None) -> None:
        """Draw the arm and its ray, (dof,) [rad]; up to the target (3,) [m] where it is aimed."""
        self.arm.move(q)
        if self._robot is not None:
            self._meshes.update_cfg(self._robot.values(q))
        pose, length = tool_pose(self._arm, q), self._ray_length
        if target is not None and pointing_error(self._arm, q, target) < AIMED:
            length = float(np.linalg.norm(target - pose[:3, 3]))
        place_bar(self._ray, *ray_of(pose, length))

    def show_trees(self, trees: Sequence[Tree]) -> None:
        """Draw the paths of the tool along the edges of the trees."""
        handles: list[Any] = []
        for k, (tree, colour) in enumerate(zip(trees, TREES, strict=False)):
            handles += self._lines(f'/tree/{k}', tree_segments(self._arm, tree), colour, 0.0035)
            nodes = tool_positions(self._arm, tree.nodes)
            handles.append(self._dots(f'/tree/nodes_{k}', nodes, colour, 0.011))
        self._replace('tree', handles)

    def show_path(
        self, layer: str, curve: Array, corners: Array, colour: Color | None = None
    ) -> None:
        """
        Draw a path of the tool, (n, 3), and its waypoints, (m, 3), in a layer of PATHS [m].

        colour: None for that of the layer.
        """
        own, width = PATHS[layer]
        colour = own if colour is None else colour
        handles = self._lines(f'/{layer}/line', segments_of(curve), colour, width)
        if len(corners):
            handles.append(self._dots(f'/{layer}/corners', corners, colour, 2.6 * width))
        self._replace(layer, handles)

    def _lines(self, name: str, segments: Array, colour: Color, width: float) -> list[Any]:
        if not len(segments):
            return []
        return [self._scene.add_line_segments(name, segments, colour, thickness=width)]

    def _dots(self, name: str, points: Array, colour: Color, size: float) -> Any:
        style: Any = {'point_size': size, 'point_shape': 'circle'}
        return self._scene.add_point_cloud(name, points, colour, **style)

    def _replace(self, what: str, handles: list[Any]) -> None:
        """Remove what was drawn before and not redrawn under its name."""
        kept = {handle.name for handle in handles}
        for handle in self._drawn.get(what, []):
            if handle.name not in kept:
                handle.remove()
        self._drawn[what] = handles


def place_bar(bar: Any, begin: Array, end: Array) -> None:
    """Put a bar of length 1 along z between two points, (3,) [m]."""
    middle, rotation, length = along_z(begin, end)
    bar.position, bar.wxyz, bar.scale = middle, rotation, (1.0, 1.0, length)
    bar.visible = length > 1e-6
