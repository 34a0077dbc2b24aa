# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Random motions as the pipeline plans them, with what its steps were given and how they ended."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
import inspect
import time
from typing import Any
from unittest.mock import patch

import numpy as np
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.pipeline import time_path
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.pipeline.plan_motion import plan_motion
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.timing.corner_blends import Blend
from rrth_planner.timing.parameterization import parameterize

from benchmarks.common.clock import uncollected
from benchmarks.common.queries import table_1_arm
from benchmarks.planners.full_query import Case, cases, MARGIN, RAY

# The wearers of the other benchmark are the first hundred.
FIRST_BODY = 1000
STEPS = ('round_corners', 'in_time', 'first_proven', 'violation_seen')


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Call:
    """A call of a step of the pipeline: arguments by name, result, and how long it took [s]."""

    step: str
    arguments: dict[str, Any]
    result: Any
    duration: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Motion:
    """
    A query and its answer.

    Parameters
    ----------
    body, index : int
        Which wearer, which of its queries; the index is the seed.
    scene : Scene
    q_start : ndarray, shape (dof,)
        Of the query; not its world, whose kernels another process would compile again [rad].
    plan : MotionPlan
    rounded : tuple of Blend
        The corners as large as they are proven free; none unless a path was found.
    chosen : tuple of Blend
        How they are taken.
    step_times : dict
        By step of the pipeline, how long it took [s].

    """

    body: int
    index: int
    scene: Scene
    q_start: Array
    plan: MotionPlan
    rounded: tuple[Blend, ...]
    chosen: tuple[Blend, ...]
    step_times: dict[str, float]


def default_limits() -> MotionLimits:
    """Return the limits that the node starts with."""
    parameters = load_yaml(resource_path('config/planner.yaml'))['/**']['ros__parameters']
    return MotionLimits(
        velocity=parameters['max_velocity'],
        acceleration=parameters['max_acceleration'],
        jerk=parameters['max_jerk'],
    )


def planned_motions(body: int, n: int, limits: MotionLimits) -> list[Motion]:
    """Return the answers to the queries round a wearer, planned one after another, warm."""
    chosen = cases(FIRST_BODY + body, n)
    for k, case in enumerate(chosen):
        _plan(case, limits, k)
    with uncollected():
        noted = []
        for k, case in enumerate(chosen):
            with watched() as calls:
                noted.append((_plan(case, limits, k), calls))
    return [
        _motion(body, k, case, plan, calls)
        for k, (case, (plan, calls)) in enumerate(zip(chosen, noted, strict=True))
    ]


def _plan(case: Case, limits: MotionLimits, seed: int) -> MotionPlan:
    return plan_motion(
        table_1_arm(),
        case.scene,
        case.q_start,
        case.goal,
        limits,
        RRTHOptions(),
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=seed,
    )


@contextmanager
def watched() -> Iterator[list[Call]]:
    """Note the calls of the steps of the pipeline while the block runs."""
    calls: list[Call] = []
    originals = {step: getattr(time_path, step) for step in STEPS}
    with patch.multiple(time_path, **{s: _noting(s, f, calls) for s, f in originals.items()}):
        yield calls


def _noting(step: str, function: Callable[..., Any], calls: list[Call]) -> Callable[..., Any]:
    signature = inspect.signature(function)

    def noting(*given: Any, **named: Any) -> Any:
        begin = time.perf_counter()
        result = function(*given, **named)
        duration = time.perf_counter() - begin
        arguments = signature.bind(*given, **named).arguments
        calls.append(Call(step=step, arguments=arguments, result=result, duration=duration))
        return result

    return noting


def _motion(body: int, index: int, case: Case, plan: MotionPlan, calls: list[Call]) -> Motion:
    last = {call.step: call for call in calls}
    return Motion(
        body=body,
        index=index,
        scene=case.scene,
        q_start=case.q_start,
        plan=plan,
        rounded=last['round_corners'].result if 'round_corners' in last else (),
        chosen=_chosen(last['in_time'], last['first_proven'].result) if 'in_time' in last else (),
        step_times={
            step: sum(call.duration for call in calls if call.step == step) for step in STEPS
        },
    )


def _chosen(timing: Call, proven: Trajectory | None) -> tuple[Blend, ...]:
    """Return which way to take the corners the trajectory follows: the one that gives it again."""
    path, choices = timing.arguments['path'], timing.arguments['choices']
    for blends in choices:
        again = parameterize(path, blends, timing.arguments['limits'])
        if proven is not None and np.array_equal(again.times, proven.times):
            return tuple(blends)
    return tuple(choices[0])


def duration_stopping(path: Path, blends: tuple[Blend, ...], limits: MotionLimits) -> float:
    """Return how long the motion takes that stops at each corner [s]."""
    stops = tuple(replace(blend, half_length=0.0) for blend in blends)
    return parameterize(path, stops, limits).duration


def without_jerk(path: Path, blends: tuple[Blend, ...], limits: MotionLimits) -> Trajectory:
    """Return the trajectory where jerk hardly counts."""
    free = replace(limits, jerk=np.full(len(limits.jerk), 1e6))
    return parameterize(path, blends, free)
