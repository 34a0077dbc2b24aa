# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The checks of a soak: motions by the reference checker, memory; nothing of ROS but bytes."""

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from rrth_planner.collision.reference_checker import first_contact
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory

from benchmarks.common.controller_curve import positions_of

MARGIN, RAY, SLACK = 0.02, 1.0, 1e-6
# Between two instants at which a motion is sampled, and one in a hundred [s].
COARSE, FINE, EACH = 5e-3, 5e-4, 100
# A motion keeps the margin from the newest body or the one before it, which may be on its way.
IN_FLIGHT = 2
FREE, OLDER, NEAR, COLLIDES = 'free', 'free of an older body', 'within the margin', 'collides'


@dataclass(frozen=True, slots=True)
class Growth:
    """
    How the memory of a process grew after the first tenth of its samples.

    Parameters
    ----------
    begin, most : float
        At the end of the first tenth, and the most after it [MB].

    """

    begin: float
    most: float

    @property
    def growth(self) -> float:
        """How much was added at most [MB]."""
        return self.most - self.begin


def growth_of(memory: Sequence[float]) -> Growth:
    """Return how a series of memory samples grew [MB]."""
    values = np.asarray(memory, dtype=float)
    first = max(1, len(values) // 10)
    return Growth(float(values[first - 1]), float(values[first - 1 :].max()))


def verdict_on(
    arm: ArmModel,
    scenes: Iterable[Scene],
    trajectory: Trajectory,
    period: float = COARSE,
    margin: float = MARGIN,
) -> str:
    """
    Return what is to be said of a published motion.

    Parameters
    ----------
    arm : ArmModel
    scenes : iterable of Scene
        The bodies before it was published, the newest first; taken as far as needed.
    trajectory : Trajectory
    period : float
        Between two samples [s].
    margin : float
        To be kept [m].

    """
    q = positions_of(trajectory, period)
    checked: list[Scene] = []
    for k, scene in enumerate(scenes):
        checked.append(scene)
        if first_contact(arm, scene, q, RAY, margin - SLACK) is None:
            return FREE if k < IN_FLIGHT else OLDER
    is_colliding = all(
        first_contact(arm, scene, q, RAY, 0.0) is not None for scene in checked[:IN_FLIGHT]
    )
    return COLLIDES if is_colliding else NEAR


def name_of(verdict: tuple[str, bool]) -> str:
    """Return what to call a verdict of `judge_bytes`."""
    word, is_brake = verdict
    return f'stop: {word}' if is_brake else word


def newest_before(sent: Sequence[int], time: int, n: int) -> list[int]:
    """Return the indices of the last messages sent before a time [ns], the newest first."""
    newest = bisect_left(sent, time) - 1
    return list(range(newest, max(-1, newest - n), -1))


def judge_bytes(task: tuple[bytes, tuple, bool]) -> tuple[str, bool]:
    """
    Return the verdict on a serialized motion, and whether it is a handover, as stops are.

    Parameters
    ----------
    task : (bytes, tuple of BodyAt, bool)
        The message, the bodies before it, and whether it is sampled finely.

    """
    from rclpy.serialization import deserialize_message
    from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
    from trajectory_msgs.msg import JointTrajectory

    from benchmarks.soak.body import scene_of_body

    data, bodies, is_fine = task
    arm = _arm()
    msg = deserialize_message(data, JointTrajectory)
    trajectory = joint_trajectory_from_msg(msg, arm.joint_names)
    scenes = map(scene_of_body, bodies)
    word = verdict_on(arm, scenes, trajectory, FINE if is_fine else COARSE)
    return word, bool(msg.header.stamp.sec or msg.header.stamp.nanosec)


@cache
def _arm() -> ArmModel:
    return load_arm()
