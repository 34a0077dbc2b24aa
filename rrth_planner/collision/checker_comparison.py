# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Certificate, second checker and reference checker compared on each piece of a motion."""

from dataclasses import dataclass, replace
import math

import numpy as np
from rrth_planner.collision import reference_checker
from rrth_planner.collision.certificate import certify
from rrth_planner.collision.second_checker import nearest
from rrth_planner.collision.trajectory_validation import is_proven_free, violation_seen
from rrth_planner.collision.violation import Violation
from rrth_planner.collision.world import World, world_of
from rrth_planner.model.arm import reach_to
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import positions_at, Trajectory

# Sampling period of the distances of the second and the reference checker [s].
DISTANCE_PERIOD = 0.002


@dataclass(frozen=True, slots=True)
class PieceComparison:
    """
    The results of the three checkers for one piece of a motion.

    `begin` and `end` [s] are equal for the final configuration, whose ray extends to the target.
    `certificate`: `proven`, `violated` or `undecided`; `second`: where the second checker finds
    the arm closest to the wearer, sampled; `reference`: least clearance by the reference checker,
    sampled [m].
    """

    begin: float
    end: float
    certificate: str
    second: Violation
    reference: float


@dataclass(frozen=True, slots=True)
class MotionComparison:
    """
    The results of the three checkers for a whole motion.

    `is_proven` by the certificate, the first `violation` that the second checker finds, and the
    least `clearance` by the reference checker [m]; `pieces`: one for each, and one for the final
    configuration.
    """

    is_proven: bool
    violation: Violation | None
    clearance: float
    pieces: tuple[PieceComparison, ...]

    @property
    def is_disagreement(self) -> bool:
        """Whether the motion is certified although the second checker finds a violation."""
        return self.is_proven and self.violation is not None


def compare_checkers(
    required: RequiredClearance,
    scene: Scene,
    goal: PointingGoal,
    trajectory: Trajectory,
    escape_time: float = 0.0,
) -> MotionComparison:
    """
    Return the results of the three checkers for a motion.

    The scene is in the base frame [m]; the final ray must be clear as far as the target.
    Until `escape_time` [s] the motion escapes from boxes, so its pieces violate the margin.
    """
    arm, world = required.arm, world_of(required, scene)
    q_end: Array = trajectory.positions[-1]
    reach = reach_to(arm, goal.target, q_end)
    pieces = tuple(
        _of_piece(required, scene, world, trajectory, i) for i in range(len(trajectory.times) - 1)
    )
    end = trajectory.duration
    last = PieceComparison(
        begin=end,
        end=end,
        certificate='proven' if world.is_valid(q_end, reach) else 'violated',
        second=_closest(
            replace(required, ray_guard_length=reach), scene, q_end[None], np.array([end])
        ),
        reference=reference_checker.least_clearance(arm, scene, q_end[None], reach),
    )
    return MotionComparison(
        is_proven=is_proven_free(world, trajectory, required.margin, reach, escape_time),
        violation=violation_seen(required, scene, trajectory, reach, escape_time),
        clearance=min(piece.reference for piece in (*pieces, last)),
        pieces=(*pieces, last),
    )


def _of_piece(
    required: RequiredClearance, scene: Scene, world: World, trajectory: Trajectory, i: int
) -> PieceComparison:
    begin, end = (float(time) for time in trajectory.times[i : i + 2])
    piece = Trajectory(
        times=np.array([0.0, end - begin]),
        positions=trajectory.positions[i : i + 2],
        velocities=trajectory.velocities[i : i + 2],
        accelerations=trajectory.accelerations[i : i + 2],
    )
    certificate = certify(piece, world)
    times = np.linspace(0.0, end - begin, 2 + math.ceil((end - begin) / DISTANCE_PERIOD))
    # The reference checker solves for the curve by itself.
    _, q, _, _ = reference_checker.quintic_states(piece, DISTANCE_PERIOD)
    found = 'violated' if certificate.is_violated else 'undecided'
    return PieceComparison(
        begin=begin,
        end=end,
        certificate='proven' if certificate.is_proven else found,
        second=_closest(required, scene, positions_at(piece, times), begin + times),
        reference=reference_checker.least_clearance(
            required.arm, scene, q, required.ray_guard_length
        ),
    )


def _closest(required: RequiredClearance, scene: Scene, q: Array, times: Array) -> Violation:
    """Return where the second checker finds the arm closest at instants, q (n, dof), times [s]."""
    best = Violation(float(times[0]), math.inf, '', '')
    # Without a box there is nothing to be close to.
    for time, one in zip(times.tolist(), q if scene.boxes else (), strict=False):
        found = nearest(required, scene, one)
        if found.distance < best.distance:
            best = Violation(time, found.distance, found.bar, found.box)
    return best
