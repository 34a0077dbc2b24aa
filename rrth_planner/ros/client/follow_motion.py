# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Follow an arm to the end of its commanded motion, with a progress bar."""

import time

import numpy as np
from rrth_planner.model.arm import ArmModel, pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import positions_at, Trajectory
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.client.planner_client import motions_of, NotInTimeError, PlannerClient
from rrth_planner.ros.messages.joint_state import gaps_between
from tqdm import tqdm  # type: ignore[import-untyped]

# A motion that points so far past the target was planned for another one [m].
OTHER_TARGET = 1e-3
# An arm that has arrived stays there for so long [s].
SETTLED = 0.1
SPACING = 0.01


def follow(
    client: PlannerClient,
    arm: ArmModel,
    motion: Trajectory,
    target: Array | None,
    tolerance: float,
    answer: Answer,
) -> None:
    """
    Return once the arm stands at the end of its motion, or of one that has replaced it.

    A motion that does not point to the target, (3,) [m], as a stop, is not the last one. A joint
    may be off the end by the tolerance [rad]. Raises GivenUpError as soon as the planner has given
    the goal of its answer up, and another NotInTimeError where the arm is not there within the
    duration of the motion and the client's timeout.
    """
    n_commanded = len(client.commanded)
    begin = present = time.monotonic()
    arrived_at: float | None = None
    with tqdm(
        total=round(motion.duration, 2),
        desc='the arm moves',
        unit='s',
        bar_format='{desc}: {percentage:3.0f}% |{bar}| {n:.1f} of {total:.1f} s',
        leave=False,
        # Only on a terminal.
        disable=None,
    ) as bar:
        while present - begin <= motion.duration + client.timeout:
            client.take_messages(0.02)
            present = time.monotonic()
            newer = motions_of(client.commanded[n_commanded:], arm.joint_names)
            n_commanded = len(client.commanded)
            if newer:
                # The wearer moved, and the planner stopped the arm or replanned.
                motion, begin, arrived_at = newer[-1], present, None
                bar.reset(total=round(motion.duration, 2))
            bar.n = max(bar.n, _time_along(motion, client.positions()))
            bar.refresh()
            is_there = client.is_still_at(motion.positions[-1], tolerance)
            if not is_there or present - begin < motion.duration:
                arrived_at = None
                client.require_pursued(answer)
                continue
            arrived_at = present if arrived_at is None else arrived_at
            if present - arrived_at >= SETTLED and _aims_at(arm, motion, target):
                return
            if not _aims_at(arm, motion, target):
                client.require_pursued(answer)
    topic = client.resolve_topic_name('joint_trajectory')
    if not _aims_at(arm, motion, target):
        raise NotInTimeError(
            'the arm was stopped, and no motion to the target was published on '
            f'{topic} within {client.timeout:g} s'
        )
    gaps = gaps_between(client.positions(), motion.positions[-1])
    k = int(np.argmax(gaps))
    hint = '' if client.count_arms() > 0 else f'; {topic} has no other subscriber'
    raise NotInTimeError(
        f'{arm.joint_names[k]} is {gaps[k]:.4f} from the end of its motion of '
        f'{motion.duration:.2f} s, expected at most {tolerance:g} [rad] and an arm at rest within '
        f'{client.timeout:g} s more{hint}'
    )


def _time_along(motion: Trajectory, q: Array) -> float:
    """Return when the motion is closest to where the arm is [s]."""
    times = np.linspace(0.0, motion.duration, 2 + int(motion.duration / SPACING))
    gaps = np.linalg.norm(positions_at(motion, times) - q, axis=1)
    return round(float(times[int(np.argmin(gaps))]), 2)


def _aims_at(arm: ArmModel, motion: Trajectory, target: Array | None) -> bool:
    return target is None or pointing_error(arm, motion.positions[-1], target) <= OTHER_TARGET
