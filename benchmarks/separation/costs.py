# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Section `costs`: how long a commitment takes, its stop, and its proof."""

from collections.abc import Sequence
import math
import time as clock

import numpy as np
from rrth_planner.collision.separation import first_unproven
from rrth_planner.execution.commitment import extended
from rrth_planner.io.wearer_file import load_body
from rrth_planner.timing.fast_stop import fast_stop
from rrth_planner.timing.rate_profile import scaled

from benchmarks.separation.lockstep import Controller, Eyes, PATIENCE, Planner, Timing
from benchmarks.separation.setting import Case, FOLDED, MARGIN, random_plans, separation_of

# What is timed.
EXTENDED, BLOCKED = 'extended()', 'extended() where it is blocked'
STOP, PROOF, WHOLE = 'its stop', 'the proof of it', 'the proof of a whole rest'


def costs(case: Case, n: int, seed: int) -> dict[str, list[float]]:
    """Return the times of a chain of motions beside a wearer at rest [s]."""
    rng, q, scene = np.random.default_rng(seed), FOLDED, load_body()
    settings, timing = separation_of(case), Timing()
    found: dict[str, list[float]] = {what: [] for what in (EXTENDED, BLOCKED, STOP, PROOF, WHOLE)}
    for _ in range(n):
        plan = next(random_plans(rng, scene, q, case), None)
        if plan is None:
            break
        assert plan.trajectory is not None
        planner = Planner(settings, timing, rng, Controller(q))
        eyes = Eyes(tuple(box.name for box in scene.boxes), scene.numbers, np.zeros(0))
        planner.begin(plan)
        k, time = 0, 0.0
        while time < PATIENCE and not planner.has_arrived(time) and not planner.cannot_begin(time):
            time = k * timing.period
            k += 1
            eyes.see(scene.numbers, time - timing.age)
            n_before = len(planner.commitments)
            if planner.is_under_way and not planner.commitments[-1].is_whole:
                at = time + timing.thinking
                body = planner.body(at)
                begin = clock.perf_counter()
                extended(planner.commitments[-1], at, body, settings)
                took = clock.perf_counter() - begin
            else:
                took = math.nan
            planner.frame(time, eyes)
            if len(planner.commitments) == n_before:
                if not math.isnan(took) and not planner.is_at_rest(time):
                    found[BLOCKED].append(took)
                continue
            one, body = planner.commitments[-1], planner.bodies[-1]
            if not math.isnan(took):
                found[EXTENDED].append(took)
            intended = scaled(one.motion, one.profile)
            if not one.is_whole:
                begin = clock.perf_counter()
                fast_stop(intended, 0.0, settings.stop_limits, settings.stretch)
                found[STOP].append(clock.perf_counter() - begin)
            begin = clock.perf_counter()
            first_unproven(one.trajectory, 0.0, settings.arm, body, settings.rules, MARGIN)
            found[WHOLE if one.is_whole else PROOF].append(clock.perf_counter() - begin)
        q = planner.place()
    return found


HEADER = '| v_c [m/s] | stop | what | times | median [ms] | p99 [ms] | most [ms] |'


def lines_of(case: Case, found: Sequence[dict[str, list[float]]]) -> list[str]:
    """Return the lines of the table."""
    lines = []
    for what in (EXTENDED, BLOCKED, STOP, PROOF, WHOLE):
        times = 1e3 * np.array([took for one in found for took in one[what]])
        figures = (
            [f'{np.median(times):.3f}', f'{np.percentile(times, 99):.3f}', f'{times.max():.3f}']
            if len(times)
            else ['–'] * 3
        )
        cells = (f'{case.contact_speed:g}', case.stop, what, len(times), *figures)
        lines.append(f'| {" | ".join(map(str, cells))} |')
    return lines
