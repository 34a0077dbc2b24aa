# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Both checks of a motion agree about starts at thin boxes, and so does the reference."""

from dataclasses import replace

import pytest

pytest.importorskip('fcl')
pytest.importorskip('coal')
pytest.importorskip('tqdm')

from benchmarks.thin_boxes.__main__ import lines_of
from benchmarks.thin_boxes.questions import question_of
from benchmarks.thin_boxes.verdict import faults_of, verdict_of
import numpy as np
from rrth_planner.collision.penetration import box_depths
from rrth_planner.collision.reference_checker import may_escape, penetration_depths
from rrth_planner.collision.world import arm_world
from rrth_planner.model.scene import Box, Scene
from rrth_planner.pipeline.plan_motion import plan_question

SEEDS = range(300)


def test_the_checkers_agree_about_starts_at_thin_boxes():
    verdicts = [verdict_of(seed) for seed in SEEDS]
    assert [v for v in verdicts if v.is_disagreement or v.faults] == []
    assert sum(v.is_escape for v in verdicts) >= 50
    rows = [line.split('|')[1:-1] for line in lines_of(verdicts)]
    assert [row[0].strip() for row in rows[2:]] == ['coal', 'fcl']
    assert sum(int(row[1]) for row in rows[2:]) == len(SEEDS)


def test_depths_in_thin_boxes_are_those_of_the_reference():
    n_across = 0
    for seed in SEEDS:
        question = question_of(seed)
        margin, ray = question.margin, question.ray_guard_length
        world = arm_world(question.arm, question.scene, margin, ray)
        found = box_depths(world, question.q_start)
        expected = penetration_depths(question.arm, question.scene, question.q_start, ray, margin)
        is_across = np.isinf(expected)
        halves = np.array([0.5 * box.size.min() for box in question.scene.boxes]) + margin
        assert (found >= halves - 1e-8)[is_across].all()
        is_near = ~is_across & (expected > -0.9)
        assert found[is_near] == pytest.approx(expected[is_near], abs=1e-8)
        n_across += int(is_across.any())
    assert 50 < n_across < 250


def test_motions_that_go_deeper_or_out_of_another_body_are_found_wrong():
    faults = set()
    for seed in SEEDS[:100]:
        question = question_of(seed)
        plan = plan_question(question)
        if plan.escape_time == 0.0:
            continue
        # The body is elsewhere, or larger, than it was planned for.
        for by, size in ((2e-3, 0.0), (0.0, 4e-3), (0.05, 0.0)):
            boxes = (
                Box(
                    box.name,
                    box.center + by * box.rotation[:, box.size.argmin()],
                    box.size + size,
                    box.rotation,
                )
                for box in question.scene.boxes
            )
            faults.update(faults_of(replace(question, scene=Scene(tuple(boxes))), plan))
        # The other way.
        given = plan.trajectory
        turned = replace(
            given,
            positions=2.0 * given.positions[0] - given.positions,
            velocities=-given.velocities,
            accelerations=-given.accelerations,
        )
        faults.update(faults_of(question, replace(plan, trajectory=turned)))
    assert faults == {
        'it is within the margin after its escape',
        'it begins near the middle of a box',
        'it begins deeper than an arm may that escapes',
        'a bar gets deeper than at the start',
    }


def test_an_arm_may_not_leave_a_box_from_its_middle():
    scene = Scene((Box('sheet', [0.0, 0.0, 0.0], [0.1, 0.1, 1e-3], np.eye(3)),))
    depths = np.array([[-0.1], [0.0], [0.019], [0.0195 + 1e-9], [np.inf]])
    found = may_escape(scene, depths, 0.02)
    assert found[:, 0].tolist() == [True, True, True, False, False]
