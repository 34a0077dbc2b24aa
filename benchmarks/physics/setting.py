# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm of the physics benchmark: its servos, its payload, and what delays it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import mujoco
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.simulation.body_shapes import capsules_within
from rrth_planner.simulation.mechanics import usual_mechanics
from rrth_planner.simulation.moving_body import MovingBody
from rrth_planner.simulation.physics_model import Fill, OF_ARM, PhysicsModel
from rrth_planner.simulation.servo import Servo, servo_for_lag
from rrth_planner.simulation.simulated_arm import Imperfections, SimulatedArm
from rrth_planner.simulation.trajectory_controller import TimedPoints

from benchmarks.separation.setting import the_arm, the_settings

# How far the tool lags at its greatest speed [m]; how late commands take effect [s]; and the share
# of the payload that the servos are made for.
LAGS, DELAYS, PAYLOADS = (0.002, 0.01, 0.03), (0.0, 0.005, 0.01, 0.02), (0.7, 1.0, 1.3)
NOISE = 5e-6
# Distances beyond this are not looked for [m].
FAR = 0.3


@dataclass(frozen=True, slots=True)
class Setup:
    """
    An arm.

    Parameters
    ----------
    lag : float
        Of the tool at its greatest speed, by its servos alone [m].
    delay : float
        From a command until it takes effect, in addition [s].
    payload : float
        As a share of the one that the servos are made for.

    """

    lag: float
    delay: float = 0.0
    payload: float = 1.0


@cache
def servo_of(lag: float) -> Servo:
    """Return servos by the lag of the tool [m]."""
    arm = the_arm()
    return servo_for_lag(arm, usual_mechanics(arm.dof), the_settings().limits.velocity, lag=lag)


def arm_of(
    setup: Setup,
    q: Array,
    body: MovingBody,
    seed: int,
    *,
    body_begin: float = 0.0,
    fill: Fill = capsules_within,
) -> SimulatedArm:
    """Return an arm at rest at q, (dof,) [rad], beside a wearer."""
    arm = the_arm()
    usual = usual_mechanics(arm.dof)
    return SimulatedArm(
        arm,
        replace(usual, payload=setup.payload * usual.payload),
        servo_of(setup.lag),
        q=q,
        body=body,
        body_begin=body_begin,
        imperfections=Imperfections(encoder_noise=NOISE, command_delay=setup.delay, seed=seed),
        compensated=usual,
        fill=fill,
    )


def points_of(trajectory: Trajectory) -> TimedPoints:
    """Return a trajectory as a controller is given it."""
    return TimedPoints(
        times=trajectory.times,
        positions=trajectory.positions,
        velocities=trajectory.velocities,
        accelerations=trajectory.accelerations,
    )


def clearance_of(physics: PhysicsModel) -> Callable[[mujoco.MjData], float]:
    """Return what gives the least distance of the arm from the wearer, by MuJoCo [m]."""
    model = physics.model
    bars = [k for k in physics.names if model.geom_contype[k] == OF_ARM]
    parts = [k for k in physics.names if model.geom_contype[k] != OF_ARM]

    def clearance(data: mujoco.MjData) -> float:
        return min(
            mujoco.mj_geomDistance(model, data, bar, part, FAR, None)
            for bar in bars
            for part in parts
        )

    return clearance
