# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Sixty seeded queries end as they always have; `python test_known_plans.py` writes how."""

import csv
from dataclasses import replace
from itertools import count
from pathlib import Path
import sys

import numpy as np
import pytest
from rrth_planner import (
    arm_world,
    brake,
    InformedRRTStarOptions,
    load_arm,
    load_body,
    load_map,
    map_problem,
    plan,
    PointingGoal,
    PrintedRRTHOptions,
    RRTHOptions,
    RRTOptions,
    RRTStarOptions,
    RRTStarSmartOptions,
    sample,
    Scene,
)
from rrth_planner.io.settings import load_settings
from rrth_planner.model.trajectory import MotionState, StartState
from rrth_planner.pipeline.plan_motion import plan_motion

ROOT, FILE = Path(__file__).parents[2], Path(__file__).with_suffix('.csv')
MARGIN, RAY = 0.02, 1.0
QUICK = RRTHOptions(time_limit=600.0, improve_time=0.0)
OTHERS = (
    RRTOptions(time_limit=600.0),
    RRTStarOptions(time_limit=600.0, max_samples=300),
    InformedRRTStarOptions(time_limit=600.0, max_samples=300),
    RRTStarSmartOptions(time_limit=600.0, max_samples=300),
)
ON_MAPS = tuple(
    replace(options, step_size=10.0)
    for options in (QUICK, *OTHERS, PrintedRRTHOptions(time_limit=600.0, club_radius=10.0))
)


def _cases():
    """Return arms and their wearers: standing, with a hand raised, seated."""
    back, body = load_arm(), load_body()
    chest = load_arm(ROOT / 'config' / 'examples' / 'chest_arm.yaml')
    seated = load_body(ROOT / 'config' / 'examples' / 'seated_body.yaml')
    return (back, body), (back, Scene(body.boxes[:-2])), (chest, seated)


def _free(arm, scene, rng, is_free=True):
    world = arm_world(arm, scene, MARGIN, RAY)
    return next(q for _ in count() if world.is_valid(q := rng.uniform(*arm.bounds)) is is_free)


def _asked(case, q, rng, options=QUICK, **more):
    arm, scene = case
    target = rng.uniform([-2.0, -2.0, -1.2], [2.5, 2.0, 1.8])
    limits = load_settings(arm.dof).limits
    return plan_motion(
        arm,
        scene,
        q,
        PointingGoal(target),
        limits,
        options,
        margin=MARGIN,
        ray_guard_length=RAY,
        seed=1,
        **more,
    )


def _row(kind, planned):
    path, motion = planned.path, getattr(planned, 'trajectory', None)
    return {
        'query': kind,
        'status': planned.status.value,
        'n_waypoints': 0 if path is None else len(path.waypoints),
        'length': 0.0 if path is None else path.length,
        'duration': 0.0 if motion is None else motion.duration,
        'middle': 0.0 if motion is None else sample(motion, [0.5 * motion.duration])[0].sum(),
    }


def rows():
    """Return what becomes of each query."""
    found, cases, rng = [], _cases(), np.random.default_rng(0)
    for n in range(18):
        case = cases[n % 3]
        found.append(_row('from rest', _asked(case, _free(*case, rng), rng)))
    for n, options in enumerate(OTHERS * 2):
        case = cases[n % 3]
        found.append(_row(type(options).__name__, _asked(case, _free(*case, rng), rng, options)))
    for n in range(6):
        case = cases[n % 3]
        found.append(_row('escape', _asked(case, _free(*case, rng, is_free=False), rng)))
    for n in range(9):
        case = arm, _ = cases[n % 3]
        motion = _asked(case, _free(*case, rng), rng).trajectory
        if motion is None:
            continue
        time = rng.uniform(0.1, 0.9) * motion.duration
        q, v, a = (values[0] for values in sample(motion, [time]))
        state = MotionState(positions=q, velocities=v, accelerations=a)
        moving = StartState(state=state, running=motion, time=time)
        found.append(_row('moving', _asked(case, q, rng, moving=moving)))
        stop = brake(motion, time, load_settings(arm.dof).limits)
        found.append(
            {
                **dict.fromkeys(found[-1], 0.0),
                'query': 'brake',
                'status': 'stopped',
                'n_waypoints': len(stop.times),
                'duration': stop.duration,
                'middle': stop.positions[-1].sum(),
            }
        )
    for name in ('c_shape', 'spiral'):
        for options in ON_MAPS:
            planned = plan(map_problem(load_map(name)), options, rng)
            found.append(_row(f'{name}: {type(options).__name__}', planned))
    return found


def test_seeded_queries_end_as_they_always_have():
    found = rows()
    with FILE.open(encoding='utf-8', newline='') as file:
        known = list(csv.DictReader(file))
    assert len(found) == len(known) >= 50
    for now, then in zip(found, known, strict=True):
        for name, value in now.items():
            if isinstance(value, str):
                assert value == then[name], (now, then)
            else:
                # Another machine rounds otherwise.
                assert value == pytest.approx(float(then[name]), rel=1e-6, abs=1e-6), (now, then)


if __name__ == '__main__':
    found = rows()
    writer = csv.DictWriter(sys.stdout, list(found[0]), lineterminator='\n')
    writer.writeheader()
    writer.writerows(found)
