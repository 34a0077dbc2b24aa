# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What each judge says of a motion, piece by piece: certificate, python-fcl, numpy oracle."""

from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.collision import reference_checker as oracle
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.fcl_checker import nearest
from rrth_planner.collision.trajectory_validation import is_proven_free, violation_seen
from rrth_planner.collision.violation import Violation
from rrth_planner.collision.world import arm_world, World
from rrth_planner.model.arm import ArmModel, reach_to
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import positions_at, Trajectory

# How often python-fcl's distance and the oracle's are looked at: figures for people [s].
PERIOD = 0.002


@dataclass(frozen=True, slots=True)
class Opinion:
    """
    What the judges say of one piece of a motion.

    Parameters
    ----------
    begin, end : float
        [s]; the same for the posture at the end, with the ray out to the target.
    certificate : str
        `proven`, `touches` or `undecided`.
    fcl : Violation
        Where python-fcl sees the arm closest to the wearer, at some instants.
    oracle : float
        The least clearance that the numpy oracle sees at such instants [m].

    """

    begin: float
    end: float
    certificate: str
    fcl: Violation
    oracle: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """
    What the judges say of a whole motion.

    Parameters
    ----------
    is_proven : bool
        By the certificate.
    touch : Violation or None
        What python-fcl sees first.
    clearance : float
        The least that the numpy oracle sees [m].
    opinions : tuple of Opinion
        One a piece, and that of the posture at the end.

    """

    is_proven: bool
    touch: Violation | None
    clearance: float
    opinions: tuple[Opinion, ...]

    @property
    def is_disagreement(self) -> bool:
        """Whether the motion is proven and touches all the same."""
        return self.is_proven and self.touch is not None


def verdict_of(
    arm: ArmModel,
    scene: Scene,
    goal: PointingGoal,
    trajectory: Trajectory,
    margin: float,
    ray_guard_length: float,
    escape_time: float = 0.0,
) -> Verdict:
    """
    Return what the judges say of a motion.

    Parameters
    ----------
    arm : ArmModel
    scene : Scene
        The wearer in the base frame.
    goal : PointingGoal
        The ray is to be clear out to it at the end.
    trajectory : Trajectory
    margin, ray_guard_length : float
        [m].
    escape_time : float
        Until then the motion leads out of boxes that the arm was in: its pieces touch [s].

    """
    world = arm_world(arm, scene, margin, ray_guard_length)
    q_end: Array = trajectory.positions[-1]
    reach = reach_to(arm, goal.target, q_end)
    opinions = tuple(
        _of_piece(arm, scene, world, trajectory, i) for i in range(len(trajectory.times) - 1)
    )
    end = trajectory.duration
    last = Opinion(
        begin=end,
        end=end,
        certificate='proven' if world.is_valid(q_end, reach) else 'touches',
        fcl=_closest(arm, scene, q_end[None], np.array([end]), reach),
        oracle=oracle.least_clearance(arm, scene, q_end[None], reach),
    )
    return Verdict(
        is_proven=is_proven_free(world, trajectory, reach, escape_time),
        touch=violation_seen(arm, scene, trajectory, margin, ray_guard_length, reach, escape_time),
        clearance=min(opinion.oracle for opinion in (*opinions, last)),
        opinions=(*opinions, last),
    )


def _of_piece(
    arm: ArmModel, scene: Scene, world: World, trajectory: Trajectory, i: int
) -> Opinion:
    begin, end = (float(time) for time in trajectory.times[i : i + 2])
    piece = Trajectory(
        times=np.array([0.0, end - begin]),
        positions=trajectory.positions[i : i + 2],
        velocities=trajectory.velocities[i : i + 2],
        accelerations=trajectory.accelerations[i : i + 2],
    )
    certificate = certify(piece, world)
    times = np.linspace(0.0, end - begin, 2 + math.ceil((end - begin) / PERIOD))
    # The oracle solves for the curve by itself.
    _, q, _, _ = oracle.quintic_states(
        piece.times, piece.positions, piece.velocities, piece.accelerations, PERIOD
    )
    found = 'touches' if certificate.touches else 'undecided'
    return Opinion(
        begin=begin,
        end=end,
        certificate='proven' if certificate.is_proven else found,
        fcl=_closest(arm, scene, positions_at(piece, times), begin + times, world.ray_length),
        oracle=oracle.least_clearance(arm, scene, q, world.ray_length),
    )


def _closest(arm: ArmModel, scene: Scene, q: Array, times: Array, ray: float) -> Violation:
    """Return where python-fcl sees the arm closest at instants, q (n, dof), times (n,) [s]."""
    best = Violation(float(times[0]), math.inf, '', '')
    # Without a box there is nothing to be close to.
    for time, one in zip(times.tolist(), q if scene.boxes else (), strict=False):
        seen = nearest(arm, scene, one, ray)
        if seen.distance < best.distance:
            best = Violation(time, seen.distance, seen.bar, seen.box)
    return best
