# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Weight and inertia of an arm at a configuration, as the servos of its joints know them."""

from contextlib import suppress

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.simulation.mechanics import Mechanics
from rrth_planner.simulation.physics_model import physics_model

with suppress(ImportError):
    import mujoco


class ArmDynamics:
    """An arm without a wearer, never moved by time."""

    def __init__(self, arm: ArmModel, mechanics: Mechanics) -> None:
        """Make the model."""
        self._model = physics_model(arm, mechanics).model
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)

    def weight(self, q: Array, gravity: Array) -> Array:
        """
        Return what holds the arm still at a configuration, (dof,) [N m or N].

        Parameters
        ----------
        q : ndarray, shape (dof,)
            [rad or m].
        gravity : ndarray, shape (3,)
            In the base frame [m/s^2].

        """
        self._move(q)
        self._model.opt.gravity[:] = gravity
        found = np.empty(len(q))
        # All velocities are 0.
        mujoco.mj_rne(self._model, self._data, 0, found)
        return found

    def inertia(self, q: Array) -> Array:
        """Return the inertia matrix with armatures, (dof,) [rad or m] -> (dof, dof) [kg m^2]."""
        self._move(q)
        mujoco.mj_crb(self._model, self._data)
        rows = np.empty((len(q), len(q)))
        for row, unit in zip(rows, np.eye(len(q)), strict=True):
            mujoco.mj_mulM(self._model, self._data, row, unit)
        return rows

    def _move(self, q: Array) -> None:
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
