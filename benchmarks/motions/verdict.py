# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The strict check of a timed motion: of the curve that a controller interpolates."""

from dataclasses import asdict, dataclass

import numpy as np
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory

from benchmarks.common.controller_curve import (
    Curve,
    curve_of,
    derivative,
    greatest_jerk,
    instants,
    whole_nanoseconds,
)
from benchmarks.common.task import Row


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """
    The figures of a checked motion.

    Parameters
    ----------
    contact : str
        Which bar collides with which box, and when; empty where none does.
    velocity_ratio, acceleration_ratio, jerk_ratio : float
        The greatest magnitude of any joint over its limit [-].
    beyond_range : float
        By how much a joint leaves its range at most [rad].
    is_at_rest : bool
        Whether velocity and acceleration of the first and the last point are exact zeros.
    is_increasing : bool
        Whether the times strictly increase in whole nanoseconds.
    n_points : int

    """

    contact: str
    velocity_ratio: float
    acceleration_ratio: float
    jerk_ratio: float
    beyond_range: float
    is_at_rest: bool
    is_increasing: bool
    n_points: int

    def columns(self) -> Row:
        """Return the verdict as columns of a row."""
        return asdict(self)


def verdict(
    arm: ArmModel,
    scene: Scene,
    trajectory: Trajectory,
    limits: MotionLimits,
    *,
    margin: float,
    ray_length: float,
    reach: float,
) -> Verdict:
    """
    Return what is to be said of the controller's curve, every 0.2 ms and at each point.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
    trajectory : Trajectory
    limits : MotionLimits
    margin : float
        Clearance to keep from every box [m].
    ray_length : float
        How much of the ray is checked in motion [m].
    reach : float
        How much of it must be clear at the end [m].

    """
    ends = np.stack([trajectory.velocities[[0, -1]], trajectory.accelerations[[0, -1]]])
    is_increasing = bool((np.diff(whole_nanoseconds(trajectory.times)) > 0).all())
    common = {
        'is_at_rest': not ends.any(),
        'is_increasing': is_increasing,
        'n_points': len(trajectory.times),
    }
    if not is_increasing:
        # There is no curve through two points at once.
        infinite = dict.fromkeys(
            ('velocity_ratio', 'acceleration_ratio', 'jerk_ratio', 'beyond_range'), np.inf
        )
        return Verdict(contact='no curve', **infinite, **common)
    curve = curve_of(trajectory)
    places = instants(curve)
    velocity_ratio, acceleration_ratio = speed_ratios(curve, limits)
    q = derivative(curve, places, 0)
    outside = np.maximum(arm.bounds[0] - q, q - arm.bounds[1]).max()
    return Verdict(
        contact=_contact(arm, scene, places.times, q, margin, ray_length)
        or _contact(arm, scene, places.times[-1:], q[-1:], margin, max(reach, ray_length)),
        velocity_ratio=velocity_ratio,
        acceleration_ratio=acceleration_ratio,
        jerk_ratio=_ratio(greatest_jerk(curve), limits.jerk),
        beyond_range=max(0.0, float(outside)),
        **common,
    )


def speed_ratios(curve: Curve, limits: MotionLimits) -> tuple[float, float]:
    """Return the greatest velocity and acceleration of any joint over their limits [-]."""
    places = instants(curve)
    return (
        _ratio(np.abs(derivative(curve, places, 1)), limits.velocity),
        _ratio(np.abs(derivative(curve, places, 2)), limits.acceleration),
    )


def _ratio(values: Array, limit: Array) -> float:
    return float((values / limit).max())


def _contact(
    arm: ArmModel, scene: Scene, times: Array, q: Array, margin: float, ray_length: float
) -> str:
    """Return the first contact as words, empty where there is none."""
    found = first_contact(arm, scene, q, ray_length, margin)
    if found is None:
        return ''
    return f'bar {found.bar}, box "{found.box}", at {times[found.index]:.4f} s'
