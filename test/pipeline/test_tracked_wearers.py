# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm has room beside whoever is tracked: with every skeleton of the package and the pages."""

from pathlib import Path
import re

from fleshed_person import make_person, plates, posture_of, SEEN, seen_by
import numpy as np
import pytest
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.goal import PointingGoal
from rrth_planner.wearer.body_boxes import body_boxes

pipeline = pytest.importorskip('rrth_planner.pipeline.plan_motion', exc_type=ImportError)

from rrth_planner.collision.world import arm_world  # noqa: E402

PAGES = Path(__file__).parents[2] / 'docs'
PACKAGED = sorted(
    file.stem for file in resource_path('config/skeletons/xsens.yaml').parent.glob('*.yaml')
)
EXAMPLES = [
    (page.name, text)
    for page in sorted(PAGES.glob('*.md'))
    for text in re.findall(r'^```yaml\n(.*?)^```', page.read_text(encoding='utf-8'), re.M | re.S)
    if re.search(r'^base:', text, re.M) and 'without: [neck' in text
]
FOLDED, TARGET = np.array([0.0, -0.35, np.pi / 2, np.pi / 2]), [1.5, 0.1, 0.3]


def seen(name, person):
    """Return what a tracker reports: by names of ready-made skeletons, or rigid bodies."""
    return seen_by(name, person) if name in SEEN else posture_of(plates(person))


def plan_beside(skeleton, name):
    """Plan beside three people who stand upright."""
    arm = load_arm()
    settings = load_settings(arm.dof)
    q = np.random.default_rng(5).uniform(*arm.bounds, (2000, arm.dof))
    for seed in range(3):
        person = make_person(np.random.default_rng(seed), is_upright=True)
        scene, lost = body_boxes(skeleton, seen(name, person))
        assert not lost
        world = arm_world(arm, scene, settings.margin, settings.ray_guard_length)
        # Legs hinder it little: without them 250 of 2,000 are free.
        assert sum(world.is_valid(one) for one in q) > 100, name
        plan = pipeline.plan_motion(
            arm,
            scene,
            FOLDED,
            PointingGoal(TARGET),
            settings.limits,
            settings.options,
            margin=settings.margin,
            ray_guard_length=settings.ray_guard_length,
            seed=seed,
        )
        assert plan.trajectory is not None, (name, plan.sentence)


@pytest.mark.parametrize('name', PACKAGED)
def test_the_arm_plans_beside_a_wearer_of_each_packaged_skeleton(name):
    plan_beside(load_skeleton(name), name)


@pytest.mark.parametrize(('page', 'text'), EXAMPLES)
def test_the_arm_plans_beside_a_wearer_of_each_skeleton_of_the_pages(page, text, tmp_path):
    file = tmp_path / 'wearer.yaml'
    file.write_text(text, encoding='utf-8')
    plan_beside(load_skeleton(file), page)


def test_the_skeleton_of_the_page_is_the_packaged_one(tmp_path):
    ((_, text),) = EXAMPLES
    assert resource_path('config/skeletons/rigid_bodies.yaml').read_text().endswith(text)
