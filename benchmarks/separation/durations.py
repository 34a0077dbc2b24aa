# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Section `durations`: how much longer motions take with separation, the wearer at rest."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rrth_planner.execution.command import ahead
from rrth_planner.execution.commitment import Commitment
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import MotionLimits, sample
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.timing.parameterization import excess

from benchmarks.separation.lockstep import Controller, Eyes, PATIENCE, Planner, Timing
from benchmarks.separation.setting import (
    Case,
    FOLDED,
    planned,
    random_plans,
    separation_of,
)

# Motions of a chain, the first of which begins folded.
CHAIN = 5
# Dead times: what the delay of the controller leaves of them is the age of a frame [s].
DEAD_TIMES, DELAY = (0.03, 0.05, 0.1), 0.01
CONTACT_SPEEDS, STOPS = (0.1, 0.25, 0.0), ('4/40', '10/400')
# How late after its publication an extension comes that jumps [s], looked at so often until then.
LATE, LOOKS = 0.02, 9
# A stop is one that ended so much before the next commitment came [s].
ENDED = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Timed:
    """
    What became of a motion.

    Parameters
    ----------
    planned, took : float
        Durations without and with separation [s]; infinite: it is not reachable.
    n_stops : int
        Full stops on its way.
    excess : float
        Greatest ratio of a commitment to the greater limits of motions and stops [-].
    jump, speed_jump : float
        The greatest ones where an extension comes late [rad, rad/s].
    first : float
        How long the first commitment took to come [s].

    """

    planned: float
    took: float
    n_stops: int
    excess: float
    jump: float
    speed_jump: float
    first: float


def cases() -> list[tuple[float, Case]]:
    """Return dead times and cases."""
    return [
        (dead, Case(contact_speed=speed, stop=stop, controller_delay=DELAY))
        for dead in DEAD_TIMES
        for stop in STOPS
        for speed in CONTACT_SPEEDS
    ]


def chain_of_timed(dead: float, case: Case, n: int, seed: int) -> list[Timed]:
    """Return what becomes of a chain of motions, the same ones for each case."""
    rng, draws = np.random.default_rng(seed), np.random.default_rng(seed)
    q, found = FOLDED, []
    while len(found) < n:
        plan = next(random_plans(draws, load_body(), q), None)
        if plan is None:
            q = FOLDED
            continue
        assert plan.trajectory is not None
        found.append(timed(dead, case, plan, rng))
        q = plan.trajectory.positions[-1]
    return found


def timed(dead: float, case: Case, plan: MotionPlan, rng: np.random.Generator) -> Timed:
    """Return what becomes of a motion to the target of a plan without separation."""
    settings, scene = separation_of(case), load_body()
    assert plan.path is not None and plan.trajectory is not None
    T = tool_pose(settings.arm, plan.path.waypoints[-1])
    target = T[:3, 3] + plan.target_distance * T[:3, 2]
    separate = planned(scene, plan.path.waypoints[0], target, plan.seed, case)
    assert separate.trajectory is not None
    timing = Timing(age=dead - DELAY, thinking=0.0, lag=0.0)
    planner = Planner(settings, timing, rng, Controller(separate.trajectory.positions[0]))
    eyes = Eyes(tuple(box.name for box in scene.boxes), scene.numbers, np.zeros(0))
    planner.begin(separate)
    k, time = 0, 0.0
    while time < PATIENCE and not planner.has_arrived(time) and not planner.cannot_begin(time):
        time = k * timing.period
        eyes.see(scene.numbers, time - timing.age)
        planner.frame(time, eyes)
        k += 1
    given = planner.commitments
    has_arrived = planner.has_arrived(time)
    begun = given[0].start_time if given else np.inf
    limits, stop = settings.limits, settings.stop_limits
    greater = MotionLimits(
        *(np.maximum(one, other) for one, other in zip(limits.rows, stop.rows, strict=True))
    )
    jumps = np.array([jump_of(*pair) for pair in zip(given[:-1], given[1:], strict=True)])
    jumps = jumps.reshape(-1, 2).max(axis=0, initial=0.0)
    return Timed(
        planned=plan.trajectory.duration,
        took=given[-1].end_time - begun if has_arrived else np.inf,
        n_stops=sum(
            one.end_time + ENDED < other.start_time
            for one, other in zip(given[:-1], given[1:], strict=True)
        ),
        excess=max((excess(one.trajectory, greater) for one in given), default=0.0),
        jump=float(jumps[0]),
        speed_jump=float(jumps[1]),
        first=begun,
    )


def jump_of(before: Commitment, after: Commitment) -> Array:
    """Return by how much the arm jumps where a commitment comes up to LATE late [rad, rad/s]."""
    # It begins once a controller has it.
    late = np.linspace(0.0, LATE - ahead(DELAY), LOOKS)
    one = sample(before.trajectory, after.start_time - before.start_time + late)
    other = sample(after.trajectory, late)
    return np.array([np.abs(one[k] - other[k]).max() for k in (0, 1)])


HEADER = (
    '| dead time [ms] | stop | v_c [m/s] | motions | duration over the planned one: mean | median '
    '| p90 | not reachable | full stops | greatest excess [%] | jump of an extension up to 20 ms '
    'late [rad] | [rad/s] |'
)


def line_of(dead: float, case: Case, found: Sequence[Timed]) -> str:
    """Return a line of the table."""
    ratios = np.array([one.took / one.planned for one in found if np.isfinite(one.took)])
    most = max((one.excess for one in found), default=0.0)
    n_out = sum(not np.isfinite(one.took) for one in found)
    shares = (
        [f'{ratios.mean():.2f}', f'{np.median(ratios):.2f}', f'{np.percentile(ratios, 90):.2f}']
        if len(ratios)
        else ['–'] * 3
    )
    cells = (
        f'{1e3 * dead:.0f}',
        case.stop,
        f'{case.contact_speed:g}',
        len(found),
        *shares,
        f'{n_out} ({100.0 * n_out / max(1, len(found)):.0f} %)',
        sum(one.n_stops for one in found),
        f'{100.0 * (most - 1.0):.2f}' if most > 0.0 else '–',
        f'{max((one.jump for one in found), default=0.0):.1e}',
        f'{max((one.speed_jump for one in found), default=0.0):.1e}',
    )
    return f'| {" | ".join(map(str, cells))} |'
