# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The proof that a motion keeps separate from a wearer who moves."""

from dataclasses import dataclass
import functools

import numpy as np
from numpy.typing import NDArray
from rrth_planner.collision.certificate import BERNSTEIN_3, BERNSTEIN_4
from rrth_planner.collision.world import allowed_bars, arm_rows, mount_inverse, SLACK
from rrth_planner.kernels import jit
from rrth_planner.kernels.collision.separation import first_blocked, permitted_rates
from rrth_planner.model.arm import ArmModel, bars_of
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import curves_of
from rrth_planner.model.separation import growth_lines, SeenBody, Separation, SeparationRules
from rrth_planner.model.trajectory import Trajectory

# A stop takes no longer than that, in the estimate of a rate [s].
LONGEST_STOP = 1.0


@dataclass(frozen=True, slots=True)
class Blocked:
    """When a motion is not proven separate from the wearer [s], by which bar and which box."""

    time: float
    bar: str
    box: str


def first_unproven(
    trajectory: Trajectory,
    begin: float,
    arm: ArmModel,
    body: SeenBody,
    rules: SeparationRules,
    margin: float,
) -> Blocked | None:
    """
    Return where a motion is not proven separate from a moving wearer; None: it is proven.

    At no instant after `begin` [s] is a point of the arm that is faster than the contact speed in
    a box grown by how far it may have got since it was seen, margin [m] and error added
    (`growth_at`). The body is that of the time 0 of the motion. The pointing ray is left
    out: it has no body. It holds between any two instants, too (`docs/algorithms.md`, section 8).
    """
    boxes = body.scene.boxes
    if not boxes or len(trajectory.times) == 1:
        return None
    found = np.empty(2)
    lines = growth_lines(body, rules, margin + SLACK, trajectory.duration)
    blocking = first_blocked(
        jit.Points(trajectory.times, *trajectory.states),
        begin,
        rules.contact_speed,
        _arm_numbers(arm),
        _body_numbers(arm, body, *lines),
        BERNSTEIN_4,
        BERNSTEIN_3,
        found,
    )
    if blocking < 0:
        return None
    bar, box = divmod(blocking, len(boxes))
    return Blocked(float(found[0]), bars_of(arm)[bar].name, boxes[box].name)


def permitted_ahead(
    motion: Trajectory,
    places: Array,
    n_rates: int,
    body: SeenBody,
    settings: Separation,
    margin: float,
    reserve: float = 1.0,
) -> Array:
    """
    Return the rates that are permitted at the first places of a motion, (n,) [s] -> (n_rates, 3).

    The greatest rate from which a stop would keep clear of the wearer, up to 1 [-], and how fast
    the rate may change there: its first and its second derivative [1/s, 1/s^2]. body: the wearer
    as he will be known when such a stop begins; margin [m]; reserve: a stop from so many times the
    rate would keep clear, too. An estimate: `first_unproven` proves.
    """
    arm, rules = settings.arm, settings.rules
    found, until = np.empty((n_rates, 3)), settings.stretch + LONGEST_STOP
    growths, speeds = growth_lines(body, rules, margin + SLACK, until)
    permitted_rates(
        curves_of(motion),
        motion.times,
        places,
        n_rates,
        reserve,
        settings.limits.rows,
        settings.stop_limits.rows,
        rules.contact_speed,
        _arm_numbers(arm),
        _body_numbers(arm, body, growths + speeds * settings.stretch, speeds),
        found,
    )
    return found


@functools.lru_cache(maxsize=16)
def _arm_numbers(arm: ArmModel) -> jit.Arm:
    """Return an arm as the kernels take it, its pointing ray left out."""
    robot, chain = arm_rows(arm, 0.0)
    return jit.Arm(jit.address(chain), robot, moving_joints(arm))


def _body_numbers(arm: ArmModel, body: SeenBody, growths: Array, speeds: Array) -> jit.Body:
    """Return a wearer as the kernels take him; growths, speeds (m, n): lines of the boxes."""
    for array in (growths, speeds):
        array.setflags(write=False)
    scene = body.scene
    return jit.Body(scene.numbers, allowed_bars(arm, scene), mount_inverse(arm), growths, speeds)


@functools.lru_cache(maxsize=16)
def moving_joints(arm: ArmModel) -> NDArray[np.int64]:
    """Return how many joints move each bar, (n,), the pointing ray left out."""
    joints = np.array([bar.body for bar in bars_of(arm)[:-1]], dtype=np.int64)
    joints.setflags(write=False)
    return joints
