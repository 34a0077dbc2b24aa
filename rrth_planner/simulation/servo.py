# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Position servos of limited torque, and which gains have a wished lag."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import OptionsError
from rrth_planner.simulation.arm_dynamics import ArmDynamics
from rrth_planner.simulation.mechanics import Mechanics
from rrth_planner.simulation.tool_speed import random_postures, top_tool_speed

# A servo without feedforward and damped just so that it does not swing lags so many times the
# inverse of its bandwidth.
CRITICAL = 2.0


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Servo:
    """
    `effort = stiffness (q_d - q) + damping (feedforward v_d - v) + gravity compensation`.

    Parameters
    ----------
    stiffness, damping : array_like, shape (dof,)
        > 0 [N m/rad, N m s/rad; of joints that slide N/m, N s/m].
    feedforward : array_like, shape (dof,)
        Share of the commanded velocity that is not damped [-].
    gravity_compensation : float
        Share of the weight of the links that is held without an error, 0 to 1 [-].

    Raises
    ------
    OptionsError
        A value out of its range, arrays of different lengths.

    """

    stiffness: Array
    damping: Array
    feedforward: Array
    gravity_compensation: float = 1.0

    def __post_init__(self) -> None:
        """Validate and freeze."""
        dof: int | None = None
        for name, unit in (
            ('stiffness', 'N m/rad'),
            ('damping', 'N m s/rad'),
            ('feedforward', '-'),
        ):
            value = frozen_array(getattr(self, name), (dof,), name, unit, OptionsError)
            dof = len(value)
            if name != 'feedforward' and not (value > 0.0).all():
                raise OptionsError(f'{name}: {value.tolist()}, expected values > 0 [{unit}]')
            object.__setattr__(self, name, value)
        if not 0.0 <= self.gravity_compensation <= 1.0:
            raise OptionsError(
                f'gravity_compensation: {self.gravity_compensation}, expected 0 to 1 [-]'
            )


def servo_effort(
    servo: Servo, wanted: tuple[Array, Array], measured: tuple[Array, Array], weight: Array
) -> Array:
    """
    Return what the servos ask of their motors, (dof,) [N m or N].

    Parameters
    ----------
    wanted, measured : (ndarray, ndarray), shape (dof,) each
        Positions [rad or m] and velocities [rad/s or m/s].
    weight : ndarray, shape (dof,)
        What holds the arm against gravity [N m or N].

    """
    effort: Array = (
        servo.stiffness * (wanted[0] - measured[0])
        + servo.damping * (servo.feedforward * wanted[1] - measured[1])
        + servo.gravity_compensation * weight
    )
    return effort


def servo_for_lag(
    arm: ArmModel,
    mechanics: Mechanics,
    max_velocity: Array,
    *,
    lag: float,
    bandwidth: float = 60.0,
    delay: float = 0.0,
    gravity_compensation: float = 1.0,
) -> Servo:
    """
    Return servos by which the tool lags its motion by a distance at its greatest speed.

    That speed is `top_tool_speed`; the lag is a time, of which the delay of commands is a part.
    Stiffness and damping are those of the bandwidth at the greatest inertia of each joint, damped
    just so that it does not swing; where the lag is shorter than such a servo's, a share of the
    commanded velocity is fed forward, and where it is longer, the bandwidth is lower.

    Parameters
    ----------
    max_velocity : ndarray, shape (dof,)
        Of the joints [rad/s].
    lag : float
        > 0 [m].
    bandwidth : float
        Greatest one [rad/s].
    delay : float
        From a command until it takes effect [s].

    Raises
    ------
    OptionsError
        A lag that is shorter than the delay alone.

    """
    speed = top_tool_speed(arm, max_velocity)
    time = lag / speed - delay
    if not 0.0 < time < np.inf:
        raise OptionsError(
            f'lag: {lag:g}, expected more than {delay * speed:.4f}, which the tool moves at '
            f'{speed:.2f} m/s within the delay of {delay:g} s [m]'
        )
    width = min(bandwidth, CRITICAL / time)
    inertia = greatest_inertia(arm, mechanics)
    stiffness = inertia * width**2
    damping = CRITICAL * inertia * width
    # At a constant velocity v: stiffness * error = damping (1 - feedforward) v + friction v.
    feedforward = 1.0 - (time * stiffness - mechanics.damping) / damping
    return Servo(
        stiffness=stiffness,
        damping=damping,
        feedforward=feedforward,
        gravity_compensation=gravity_compensation,
    )


def greatest_inertia(arm: ArmModel, mechanics: Mechanics) -> Array:
    """Return the greatest inertia of each joint, all others held, (dof,) [kg m^2 or kg]."""
    dynamics = ArmDynamics(arm, mechanics)
    found: Array = np.max([dynamics.inertia(q).diagonal() for q in random_postures(arm)], axis=0)
    return found
