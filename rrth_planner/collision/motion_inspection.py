# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An independent check of a motion before it is executed; shares nothing with the planner."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.reference_checker import (
    first_contact,
    frames,
    least_clearance,
    quintic_states,
)
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.joint_range import start_bounds
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory

# Sampling period of a controller's states [s].
STATE_PERIOD = 0.0005
# Clearance costs more, so only every so many samples are checked for it.
CLEARANCE_STRIDE = 8
CONTACT_SLACK = 1e-6
# Greatest distance of the start from the present configuration [rad], and of the last ray from
# its target [m].
START_TOLERANCE, POINTING_TOLERANCE = 1e-4, 1e-3
LIMIT_EXCESS = 0.01
REST = 1e-6
BOUND_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """
    The figures of a motion that passed the inspection.

    The length of its path in joint space [rad], its duration [s], the least distance of the arm
    and its ray up to `ray_guard_length` from the wearer, and of the final ray from the target [m].
    """

    length: float
    duration: float
    clearance: float
    pointing_error: float


class UnsafeMotionError(RrthError):
    """A motion that must not be executed."""


def inspect_motion(
    arm: ArmModel,
    scene: Scene,
    trajectory: Trajectory,
    limits: MotionLimits,
    *,
    q_present: Array,
    target: Array,
    margin: float,
    ray_guard_length: float,
) -> Inspection:
    """
    Return the figures of a motion, as a quintic-interpolating controller executes it.

    Scene and target (3,) are in the base frame [m]; q_present (dof,) is the present configuration
    [rad]. Velocities and accelerations must keep the limits, with a tolerance of 1 %. margin,
    ray_guard_length: clearance from every box, and how much of the ray keeps it in motion [m]; at
    the end the ray keeps it as far as the target.

    Raises
    ------
    UnsafeMotionError
        The first failed check, with figures and units.

    """
    gap = float(np.abs(trajectory.positions[0] - q_present).max())
    if not gap <= START_TOLERANCE:
        raise UnsafeMotionError(
            f'the motion starts {gap:.2e} from the present configuration [rad]'
        )
    times, q, v, a = quintic_states(trajectory, STATE_PERIOD)
    for what, unit, value in (('velocity', 'rad/s', v), ('acceleration', 'rad/s^2', a)):
        for end in (0, -1):
            if not np.abs(value[end]).max() <= REST:
                raise UnsafeMotionError(
                    f'{what} {value[end].tolist()} at start or end, expected 0 [{unit}]'
                )
        limit = (1.0 + LIMIT_EXCESS) * getattr(limits, what)
        if not (np.abs(value) <= limit).all():
            worst = float((np.abs(value) / getattr(limits, what)).max())
            raise UnsafeMotionError(f'{what} reaches {worst:.3f} times its limit, expected 1 [-]')
    beyond = np.maximum(arm.bounds[0] - q, q - arm.bounds[1])
    # A joint that begins beyond a limit is never further from it than before.
    farthest = start_bounds(arm)[1] - arm.bounds[1] + BOUND_TOLERANCE
    led_in = np.where(beyond[0] <= farthest, np.maximum(beyond[0], 0.0), 0.0)
    nearest = np.minimum.accumulate(np.minimum(np.maximum(beyond, 0.0), led_in))
    if not (beyond <= nearest + BOUND_TOLERANCE).all():
        raise UnsafeMotionError('a joint exceeds its position limits')
    tool = frames(arm, q[-1:])[0, -1]
    reach = float(np.linalg.norm(target - tool[:3, 3]))
    error = float(np.linalg.norm(tool[:3, 3] + reach * tool[:3, 2] - target))
    if not error <= POINTING_TOLERANCE:
        raise UnsafeMotionError(f'the ray misses the target by {1e3 * error:.2f} mm')
    for instants, ray in ((q, ray_guard_length), (q[-1:], reach)):
        contact = first_contact(arm, scene, instants, ray, margin - CONTACT_SLACK)
        if contact is not None:
            when = times[-1] if len(instants) == 1 else times[contact.index]
            raise UnsafeMotionError(
                f'bar {contact.bar} of the arm comes closer than {margin} m to {contact.box} at '
                f'{when:.3f} s'
            )
    return Inspection(
        length=float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()),
        duration=trajectory.duration,
        clearance=least_clearance(arm, scene, q[::CLEARANCE_STRIDE], ray_guard_length),
        pointing_error=error,
    )
