# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What it costs to prove two parts of an arm apart, beside what a bar and boxes near it cost."""

from dataclasses import replace
from itertools import combinations
import time

import numpy as np
from rrth_planner.collision.bar_pairs import pairs_of
from rrth_planner.collision.world import arm_world, World
from rrth_planner.kernels.kinematics.generated_fk import chain_of
from rrth_planner.kernels.layout import N_BARS
from rrth_planner.model.arm import ArmModel, bars_of, mount_bars
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene

from benchmarks.common.random_draws import random_edges
from benchmarks.planners import loops

# So many boxes are tested at once; how far they are from the mount, and how large [m].
N_BOXES, FAR, LARGE = 8, (0.5, 0.9), (0.1, 0.25)
# Short rounds, and many: one of them is not interrupted.
N_EDGES, N_ROUNDS = 3_000, 60


def costs(
    rng: np.random.Generator, arm: ArmModel, ray_length: float, length: float
) -> tuple[int, float, float, float]:
    """
    Return times of accepted edges of a length [rad], the least of some rounds [s].

    How many pairs the arm has, the time of a whole edge, of a pair, and of a bar beside eight
    boxes that are near.
    """
    names = [bar.name for bar in (*bars_of(arm), *mount_bars(arm))]
    meeting = replace(arm, allowed=tuple(combinations(names, 2)))
    scene, nothing = _boxes_round(rng, arm.T_base_mount[:3, 3]), Scene(())
    neither = arm_world(meeting, nothing, 0.0, ray_length)
    whole = arm_world(arm, scene, 0.0, ray_length)
    edges = _accepted(rng, whole, length)
    worlds = {
        'whole': whole,
        'pairs': arm_world(arm, nothing, 0.0, ray_length),
        'boxes': arm_world(meeting, scene, 0.0, ray_length),
        'neither': neither,
        'kinematics': _without_bars(neither),
    }
    least = dict.fromkeys(worlds, np.inf)
    flags = np.empty(len(edges[0]), dtype=np.bool_)
    for _ in range(N_ROUNDS):
        for name, world in worlds.items():
            begin = time.perf_counter()
            loops.check_edges(world, *edges, flags)
            least[name] = min(least[name], (time.perf_counter() - begin) / len(flags))
            assert flags.all()
    n_pairs = len(pairs_of(arm))
    pair = (least['pairs'] - least['neither']) / n_pairs
    bar = (least['boxes'] - least['kinematics']) / len(bars_of(arm))
    return n_pairs, least['whole'], pair, bar


def _without_bars(world: World) -> World:
    """Return a world whose arm moves as before and has no bar that is tested against boxes."""
    robot = world.robot.copy()
    robot[world.bounds.shape[1] + 1, N_BARS] = 0
    return replace(world, robot=robot, chain=chain_of(robot))


def _boxes_round(rng: np.random.Generator, center: Array) -> Scene:
    boxes = []
    for k in range(N_BOXES):
        direction = rng.standard_normal(3)
        place = center + rng.uniform(*FAR) * direction / np.linalg.norm(direction)
        rotation = rotation_matrix(rng.standard_normal(4))
        boxes.append(Box(f'box {k}', place, rng.uniform(*LARGE, 3), rotation))
    return Scene(tuple(boxes))


def _accepted(rng: np.random.Generator, world: World, length: float) -> tuple[Array, Array]:
    """Return random edges of a length that the edge check passes, (n, dof) each [rad]."""
    draws = rng.uniform(*world.bounds, (N_EDGES, world.bounds.shape[1]))
    first, last = random_edges(rng, world, draws, np.full(N_EDGES, length))
    flags = np.empty(len(first), dtype=np.bool_)
    loops.check_edges(world, first, last, flags)
    return first[flags], last[flags]
