# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Section `reference`: commitments judged by the reference checker, which shares nothing with them.

Of each motion some commitments are drawn at random, and each instant of them is judged with the
body as the planner knew it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rrth_planner.collision.reference_checker import instants, separation_violations
from rrth_planner.io.wearer_file import load_body
from rrth_planner.kernels.layout import SIZE

from benchmarks.common.random_draws import random_wearer
from benchmarks.separation.lockstep import Controller, Eyes, INSTANT, PATIENCE, Planner, Timing
from benchmarks.separation.setting import (
    Case,
    FOLDED,
    MARGIN,
    random_plans,
    separation_of,
    the_arm,
)

# Motions of a chain, the first of which begins folded.
CHAIN = 10
# So many commitments are judged at least, if there are so many.
LEAST = 4000
# Of the wearers that sway: how far [m], and how often in a second at most.
SWAY, OFTEN = 0.05, 1.5
# Frames are at most so old [s].
OLDEST = 0.1
CASES = (
    Case(),
    Case(contact_speed=0.25),
    Case(stop='10/400'),
    Case(contact_speed=0.0, stop='10/400'),
)


@dataclass(slots=True, eq=False)
class Judged:
    """What was judged of the motions of a case."""

    case: Case
    n_motions: int = 0
    n_arrived: int = 0
    n_blocked: int = 0
    n_commitments: int = 0
    n_whole: int = 0
    n_judged: int = 0
    n_instants: int = 0
    n_violations: int = 0
    depth: float = 0.0


def chain_of_motions(n_drawn: int, n: int, seed: int) -> Judged:
    """
    Return what was judged of a chain of motions round a wearer at rest, or one who sways.

    n_drawn: how many commitments of each motion are judged; n: motions.
    """
    rng, case = np.random.default_rng(seed), CASES[seed % len(CASES)]
    settings, judged = separation_of(case), Judged(case)
    scene, q = load_body() if rng.random() < 0.5 else random_wearer(rng), FOLDED
    names = tuple(box.name for box in scene.boxes)
    sways = rng.random() < 0.5
    ways = SWAY * rng.standard_normal((len(names), 3)) * (np.array(names) != 'torso')[:, None]
    often, shift = rng.uniform(0.2, OFTEN, len(names)), rng.uniform(0.0, 2.0 * np.pi, len(names))
    for _ in range(n):
        timing = Timing(age=float(rng.uniform(0.0, OLDEST)), lag=0.0)
        plan = next(random_plans(rng, scene, q, case), None)
        if plan is None:
            q = FOLDED
            continue
        assert plan.trajectory is not None
        planner = Planner(settings, timing, rng, Controller(q))
        planner.begin(plan)
        eyes = Eyes(names, scene.numbers, np.zeros(len(names)))
        k, time = 0, 0.0
        while time < PATIENCE and not planner.has_arrived(time):
            time = k * timing.period
            rows = scene.numbers.copy()
            if sways:
                # Where the motion was planned he begins.
                angle = 2.0 * np.pi * often * (time - timing.age) + shift
                rows[:, :SIZE] += (np.sin(angle) - np.sin(shift))[:, None] * ways
            eyes.see(rows, time - timing.age)
            planner.frame(time, eyes)
            if planner.cannot_begin(time):
                judged.n_blocked += 1
                break
            if planner.is_stopped and planner.is_at_rest(time):
                break
            k += 1
        judged.n_motions += 1
        judged.n_arrived += planner.has_arrived(time)
        judged.n_commitments += len(planner.commitments)
        judged.n_whole += sum(one.is_whole for one in planner.commitments)
        _judge(judged, planner, n_drawn, rng)
        q = planner.place()
        if sways or not planner.commitments:
            # He is where he began again, the arm where it is clear of him.
            q = plan.trajectory.positions[-1] if planner.has_arrived(time) else FOLDED
    return judged


def _judge(judged: Judged, planner: Planner, n_drawn: int, rng: np.random.Generator) -> None:
    """Judge some commitments of a motion."""
    n = len(planner.commitments)
    for i in rng.choice(n, min(n_drawn, n), replace=False):
        trajectory, body = planner.commitments[i].trajectory, planner.bodies[i]
        found = separation_violations(
            the_arm(), body, trajectory, planner.settings.rules, MARGIN, period=INSTANT
        )
        judged.n_judged += 1
        judged.n_instants += len(instants(trajectory, INSTANT))
        judged.n_violations += len(found)
        judged.depth = max([judged.depth, *(one.depth for one in found)])


HEADER = (
    '| v_c [m/s] | stop | motions | arrived | could not begin | commitments | of them whole | '
    'judged, drawn at random | instants | violations | deepest [mm] |'
)


def lines_of(chains: Sequence[Judged]) -> list[str]:
    """Return the lines of the table: one of each case, and one of all."""
    lines = []
    for case in (*CASES, None):
        some = [one for one in chains if case is None or one.case == case]
        if not some:
            continue
        sums = [
            sum(getattr(one, name) for one in some)
            for name in (
                *('n_motions', 'n_arrived', 'n_blocked', 'n_commitments', 'n_whole'),
                *('n_judged', 'n_instants', 'n_violations'),
            )
        ]
        head = ['all', ''] if case is None else [f'{case.contact_speed:g}', case.stop]
        cells = [*head, *sums, f'{1e3 * max(one.depth for one in some):.3f}']
        lines.append(f'| {" | ".join(map(str, cells))} |')
    return lines
