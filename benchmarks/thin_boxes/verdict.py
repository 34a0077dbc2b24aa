# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What became of a question about a start at thin boxes, and what the reference makes of it."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.reference_checker import (
    bar_box_contact,
    bar_ends_at,
    first_contact,
    may_escape,
    penetration_depths,
)
from rrth_planner.model.arm import bars_of
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import positions_at
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_question
from rrth_planner.pipeline.request import PlanQuestion

from benchmarks.thin_boxes.questions import question_of

# Between the instants at which the reference looks at a motion [s].
SAMPLE_PERIOD = 1e-3
# Rounding, and what a certified escape may be deeper than at its start [m].
HAIR = 3e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """
    How a question ended.

    Parameters
    ----------
    seed : int
        Of the question.
    library : str
        Behind the second checker.
    status, sentence : str
        Of the answer.
    is_disagreement : bool
        The motion is certified, and the second checker finds a violation.
    is_escape : bool
        A motion was found, and it begins with an escape.
    faults : tuple of str
        What the reference checker finds wrong with it.

    """

    seed: int
    library: str
    status: str
    sentence: str
    is_disagreement: bool
    is_escape: bool
    faults: tuple[str, ...]


def verdict_of(seed: int) -> Verdict:
    """Return what became of the question of a seed."""
    question = question_of(seed)
    plan = plan_question(question)
    return Verdict(
        seed=seed,
        library=question.second_checker,
        status=plan.status.name,
        sentence=plan.sentence,
        is_disagreement=plan.disagreement is not None,
        is_escape=plan.escape_time > 0.0,
        faults=faults_of(question, plan),
    )


def faults_of(question: PlanQuestion, plan: MotionPlan) -> tuple[str, ...]:
    """Return what the reference checker finds wrong with a motion, at many instants."""
    trajectory, out = plan.trajectory, plan.escape_time
    if trajectory is None:
        return ()
    arm, scene, margin = question.arm, question.scene, question.margin
    ray = question.ray_guard_length
    faults = []
    times = np.union1d(
        np.arange(out, trajectory.duration, SAMPLE_PERIOD), [out, trajectory.duration]
    )
    q = positions_at(trajectory, times)
    if first_contact(arm, scene, q, ray, margin - HAIR) is not None:
        faults.append('it is within the margin after its escape')
    if out == 0.0:
        return tuple(faults)
    depths = penetration_depths(arm, scene, question.q_start, ray, margin)[:-1]
    if not may_escape(scene, depths, margin).all():
        faults.append('it begins near the middle of a box')
    elif depths.max(initial=0.0) >= question.escape_depth + HAIR:
        faults.append('it begins deeper than an arm may that escapes')
    elif _gets_deeper(
        question, positions_at(trajectory, np.arange(0.0, out, SAMPLE_PERIOD)), depths
    ):
        faults.append('a bar gets deeper than at the start')
    return tuple(faults)


def _gets_deeper(question: PlanQuestion, q: Array, depths: Array) -> bool:
    """Return whether a bar is deeper in a box at some q, (n, dof), than the deepest at first."""
    parts = bars_of(question.arm)[:-1]
    ends = bar_ends_at(question.arm, q, question.ray_guard_length)[:, : len(parts)]
    radii = np.array([bar.radius for bar in parts])[:, None]
    allowed = np.maximum(depths.max(axis=0), 0.0) + HAIR
    for box, depth in zip(question.scene.boxes, allowed.tolist(), strict=True):
        half = 0.5 * box.size + question.margin - depth
        if (half > 0.0).all() and bar_box_contact(
            ends, box.center, box.rotation, half + radii
        ).any():
            return True
    return False
