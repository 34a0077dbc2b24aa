# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The meshes of a URDF in the page, beside the capsules that the planner checks."""

from rrth_planner.io.urdf.placed_robot import PlacedRobot
from rrth_planner.model.arrays import Array
from rrth_planner.visualization.viewer.curves import wxyz
import viser
from viser.extras import ViserUrdf

NAME = 'meshes'


class RobotMeshes:
    """All links of a robot that has the arm, which move with it."""

    def __init__(self, server: viser.ViserServer, robot: PlacedRobot) -> None:
        """Draw them, with all joints in the middle."""
        self._robot = robot
        T = robot.T_base_root
        self.layer = server.scene.add_frame(
            f'/{NAME}', show_axes=False, position=T[:3, 3], wxyz=wxyz(T[:3, :3])
        )
        self._urdf = ViserUrdf(server, robot.model, root_node_name=f'/{NAME}')

    def move(self, q: Array) -> None:
        """Move to a configuration of the arm, (dof,) [rad]."""
        self._urdf.update_cfg(self._robot.values(q))
