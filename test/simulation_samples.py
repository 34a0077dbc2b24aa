# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated arms and motions that tests share."""

import numpy as np
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.simulation.mechanics import usual_mechanics
from rrth_planner.simulation.servo import servo_for_lag
from rrth_planner.simulation.simulated_arm import SimulatedArm
from rrth_planner.simulation.trajectory_controller import ControllerRules, TimedPoints
from worlds import FOLDED

TOP = np.full(4, 1.5)


def points_of(trajectory, order=2):
    """Return the points of a trajectory with derivatives up to an order: 0, 1 or 2."""
    unknown = np.full_like(trajectory.positions, np.nan)
    return TimedPoints(
        times=trajectory.times,
        positions=trajectory.positions,
        velocities=trajectory.velocities if order > 0 else unknown,
        accelerations=trajectory.accelerations if order > 1 else unknown,
    )


def motion_between(q_from, q_to, duration):
    """Return a motion from rest to rest, (dof,) each, in a time [s]."""
    still = np.zeros((2, len(q_from)))
    return Trajectory([0.0, duration], np.array([q_from, q_to]), still, still)


def simulated(arm, q=FOLDED, lag=0.01, mechanics=None, rules=None, **options):
    """Return a simulated arm at rest whose tool lags by a distance [m]."""
    mechanics = mechanics or usual_mechanics(arm.dof)
    top = np.full(arm.dof, TOP[0])
    delay = options['imperfections'].command_delay if 'imperfections' in options else 0.0
    return SimulatedArm(
        arm,
        mechanics,
        servo_for_lag(arm, mechanics, top, lag=lag, delay=delay),
        rules or ControllerRules(),
        q=q,
        **options,
    )


def stepped(simulation, duration):
    """Return the readings of a simulation after each step for a time [s]."""
    found = []
    for _ in range(round(duration * 500)):
        simulation.step()
        found.append(simulation.reading)
    return found
