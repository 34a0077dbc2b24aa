# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Questions of arms whose start meets, nears or crosses thin boxes; the same of each seed."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from rrth_planner.collision.reference_checker import bar_ends_at
from rrth_planner.collision.world import arm_world
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel, bars_of
from rrth_planner.model.arrays import Array
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.rotation import rotation_matrix, turned_to
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import SeparationRules
from rrth_planner.model.trajectory import MotionLimits, MotionState, StartState
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import RRTHOptions

# Radii of all bars of the packaged arm [m]; None: the arm of the chest, as it is.
RADII = (0.0, 1e-3, 0.02, 0.05, None)
CHEST_ARM = Path(__file__).parents[2] / 'config' / 'examples' / 'chest_arm.yaml'
# Thinnest and thickest box [m].
THICKNESSES = 1e-7, 5e-3
# What the longer sides of a box are drawn between [m].
SIDES = 1e-2, 1.0
# The first is that of `config/planner.yaml` [m].
MARGINS = (0.02, 0.02, 0.02, 0.02, 0.0, 1e-6, 1e-3, 5e-3, 0.05)
RAYS = (1.0, 1.0, 0.0, 0.3)
# Configurations tried for one whose arm keeps clear of itself and of the body.
DRAWS = 200
# A search that finds no path costs time and shows nothing about the checks.
SAMPLES = 1000


@cache
def _arm(radius: float | None) -> ArmModel:
    if radius is None:
        return load_arm(CHEST_ARM)
    arm = load_arm()
    return replace(arm, radii=np.full(arm.dof + 1, radius))


@cache
def _body() -> Scene:
    return load_body()


def question_of(seed: int) -> PlanQuestion:
    """Return a question about a start at, near or in one to three thin boxes."""
    rng = np.random.default_rng(seed)
    arm = _arm(RADII[int(rng.integers(len(RADII)))])
    margin, ray = float(rng.choice(MARGINS)), float(rng.choice(RAYS))
    around = _body().boxes if rng.random() < 0.3 else ()
    world = arm_world(arm, Scene(around), margin, ray)
    for _ in range(DRAWS):
        q = rng.uniform(*arm.bounds)
        if world.is_valid(q):
            break
    n_sheets = 1 if rng.random() < 0.7 else int(rng.integers(2, 4))
    sheets = [_sheet(arm, q, ray, margin, f'sheet_{i}', rng) for i in range(n_sheets)]
    moving = None
    if rng.random() < 0.1:
        speeds = rng.uniform(-0.3, 0.3, arm.dof)
        still = np.zeros(arm.dof)
        state = MotionState(positions=q, velocities=speeds, accelerations=still)
        moving = StartState(state=state)
    ones = np.ones(arm.dof)
    limits = MotionLimits(velocity=1.5 * ones, acceleration=4.0 * ones, jerk=40.0 * ones)
    rules = SeparationRules() if rng.random() < 0.2 else None
    away = rng.standard_normal(3)
    return PlanQuestion(
        arm=arm,
        scene=Scene((*around, *sheets)),
        q_start=q,
        goal=PointingGoal(rng.uniform(1.0, 2.5) * away / np.linalg.norm(away)),
        limits=limits,
        options=RRTHOptions(
            club_attempts=0, improve_time=1e3, time_limit=1e3, max_samples=SAMPLES
        ),
        margin=margin,
        ray_guard_length=ray,
        seed=1,
        moving=moving,
        escape_depth=float(rng.choice([0.05, 0.05, 0.2])),
        reserve=float(rng.choice([0.0, 0.05])),
        second_checker=str(rng.choice(['fcl', 'coal'])),
        rules=rules,
        stop_limits=None if rules is None else limits,
    )


def _sheet(
    arm: ArmModel, q: Array, ray: float, margin: float, name: str, rng: np.random.Generator
) -> Box:
    """Return a thin box in a drawn relation to a drawn bar of the arm at q, (dof,)."""
    low, high = THICKNESSES
    thickness = _between(low, high, rng)
    size = np.array([_between(*SIDES, rng), _between(*SIDES, rng), thickness])
    kind = rng.random()
    if kind < 0.05:
        size = np.full(3, thickness)
    elif kind < 0.1:
        size[:2] = 10.0
    elif kind < 0.15:
        # A wire.
        size[0] = thickness
    bars = bars_of(arm)
    ends = bar_ends_at(arm, q[None], ray)[0, : len(bars)]
    k = int(rng.integers(len(bars)))
    begin, end = ends[k]
    length = float(np.linalg.norm(end - begin))
    along = (end - begin) / length if length > 0.0 else np.eye(3)[2]
    across = turned_to(along) @ _spun(rng)[:, 0]
    facing = rng.random()
    if facing < 0.4:
        # Parallel to the bar, which it faces.
        normal, share = across, rng.uniform(0.0, 1.0)
    elif facing < 0.55:
        # Perpendicular to it, before one of its ends.
        share = float(rng.integers(2))
        normal = along if share else -along
    else:
        random = rng.standard_normal(3)
        normal, share = random / np.linalg.norm(random), rng.uniform(0.0, 1.0)
        if rng.random() < 0.5:
            share = float(normal @ along > 0.0)
    place = begin + share * (end - begin)
    # How far the bar reaches beyond that place, towards the box; at times all bars, of which the
    # box then lies before the farthest, and at times it is run through.
    chosen = rng.random()
    reaches = (ends - place) @ normal + np.array([[bar.radius] for bar in bars])
    lead = float(reaches[k].max())
    if chosen < 0.5:
        reaches = reaches[: len(bars) - int(rng.integers(2))]
        farthest = np.unravel_index(int(reaches.argmax()), reaches.shape)
        lead, place = bars[farthest[0]].radius, ends[farthest]
    elif chosen < 0.6:
        lead = 0.0
    gap = _gap(margin, thickness, rng)
    rotation = turned_to(normal) @ _spun(rng)
    inside = rng.uniform(-0.5, 0.5, 2) * size[:2] * float(rng.choice([0.0, 0.9, 1.0, 1.1]))
    center = place + (lead + gap + 0.5 * thickness) * normal + rotation[:, :2] @ inside
    # Any of the three sides may be the thin one.
    order = rng.permutation(3)
    turned = rotation[:, order]
    if np.linalg.det(turned) < 0.0:
        turned[:, 0] *= -1.0
    return Box(name, center, size[order], turned)


def _spun(rng: np.random.Generator) -> Array:
    """Return a random rotation about z, shape (3, 3)."""
    half = rng.uniform(0.0, np.pi)
    return rotation_matrix([0.0, 0.0, np.sin(half), np.cos(half)])


def _gap(margin: float, thickness: float, rng: np.random.Generator) -> float:
    """Return a distance of the bar from the face of the box; < 0: how deep it is in it [m]."""
    hair = float(rng.choice([-1.0, 0.0, 1.0])) * _between(1e-10, 1e-3, rng)
    gaps = (
        hair,
        -0.5 * thickness + hair,
        rng.uniform(-1.0, 0.0) * thickness,
        rng.uniform(-0.05, 0.05),
        # Where an escape begins to be possible.
        1e-3 - 0.5 * thickness + hair,
        1e-3 - 0.5 * thickness + abs(hair),
        margin + hair,
        margin - abs(hair),
        _between(1e-3, 2e-3, rng),
        rng.uniform(0.0, 1.0) * margin,
        rng.uniform(0.0, 1.0) * margin,
        rng.uniform(0.0, 1.0) * margin,
    )
    return float(gaps[int(rng.integers(len(gaps)))])


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """Return a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
