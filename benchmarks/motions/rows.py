# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of judged motions: one motion each, in a Parquet file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rrth_planner.io.parquet_file import write_table
from rrth_planner.model.errors import RrthError
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionLimits

from benchmarks.common.controller_curve import Curve, curve_of, derivative, instants
from benchmarks.common.fcl_checker import least_distance, SAMPLE_PERIOD
from benchmarks.common.queries import table_1_arm
from benchmarks.common.task import origin, Row
from benchmarks.motions.path import distances, planned_pieces
from benchmarks.motions.plan import duration_stopping, Motion, without_jerk
from benchmarks.motions.toppra_peer import optimal_duration
from benchmarks.motions.verdict import speed_ratios, verdict
from benchmarks.planners.full_query import MARGIN, RAY

# A distance this much below the margin is rounding of python-fcl [m].
TOLERANCE = 3e-6
_FLOATS = (
    *('duration', 'duration_stopping', 'duration_unlimited', 'duration_toppra', 'path_length'),
    *('velocity_ratio', 'acceleration_ratio', 'jerk_ratio', 'beyond_range', 'deviation'),
    *('unlimited_ratio', 'fcl_distance', 'time_round', 'time_prove', 'time_second', 'time_plan'),
)
_POINTS = ('positions', 'velocities', 'accelerations')
SCHEMA = pa.schema(
    [
        *((name, pa.string()) for name in ('status', 'sentence', 'contact')),
        *((name, pa.int64()) for name in ('body', 'query', 'n_corners', 'n_stops', 'n_points')),
        ('n_cores', pa.int64()),
        *((name, pa.bool_()) for name in ('is_solved', 'is_stopping', 'is_at_rest')),
        *((name, pa.bool_()) for name in ('is_increasing', 'is_at_ends', 'is_sought')),
        *((name, pa.float64()) for name in _FLOATS),
        # Ways of the rounded corners to either side, as large as they are proven free [rad].
        ('half_lengths', pa.list_(pa.float64())),
        ('waypoints', pa.list_(pa.list_(pa.float64()))),
        ('times', pa.list_(pa.float64())),
        *((name, pa.list_(pa.list_(pa.float64()))) for name in _POINTS),
        *((name, pa.string()) for name in ('machine', 'commit', 'python_version')),
        *((name, pa.string()) for name in ('numpy_version', 'numba_version')),
    ]
)


def motion_row(motion: Motion, is_sought: bool, limits: MotionLimits) -> Row:
    """Return what is to be said of a motion; is_sought: it is kept for its corners alone."""
    plan = motion.plan
    row: Row = {
        **origin(),
        'status': plan.status.value,
        'sentence': plan.sentence,
        'body': motion.body,
        'query': motion.index,
        'is_sought': is_sought,
        'is_solved': plan.status is PlanStatus.SOLVED,
        'n_corners': len(motion.rounded),
        'half_lengths': [blend.half_length for blend in motion.rounded],
        'n_stops': sum(blend.half_length == 0.0 for blend in motion.rounded),
        'time_round': motion.step_times['round_corners'],
        'time_prove': motion.step_times['in_time'] + motion.step_times['first_proven'],
        'time_second': motion.step_times['violation_seen'],
        'time_plan': plan.planning_time,
    }
    return row | _judged(motion, limits) if row['is_solved'] else row


def _judged(motion: Motion, limits: MotionLimits) -> Row:
    arm, plan = table_1_arm(), motion.plan
    path, trajectory = plan.path, plan.trajectory
    assert path is not None and trajectory is not None
    found = verdict(
        *(arm, motion.scene, trajectory, limits),
        margin=MARGIN,
        ray_length=RAY,
        reach=plan.target_distance,
    )
    if not found.is_increasing:
        return found.columns()
    curve = curve_of(trajectory)
    pieces = [piece for part in planned_pieces(path, motion.chosen) for piece in part]
    q = derivative(curve, instants(curve), 0)
    ends = np.array([motion.q_start, path.waypoints[-1]])
    unlimited = without_jerk(path, motion.rounded, limits)
    is_bent = any(blend.half_length > 0.0 for blend in motion.rounded)
    return {
        **found.columns(),
        'duration': trajectory.duration,
        'duration_stopping': duration_stopping(path, motion.rounded, limits),
        'duration_unlimited': unlimited.duration,
        # A motion that breaks its limits is no peer of one that holds them.
        'unlimited_ratio': max(speed_ratios(curve_of(unlimited), limits)),
        'duration_toppra': optimal_duration(path, motion.rounded, limits),
        'path_length': path.length,
        'is_stopping': is_bent and not any(blend.half_length > 0.0 for blend in motion.chosen),
        'is_at_ends': np.array_equal(trajectory.positions[[0, -1]], ends),
        'deviation': float(distances(q, pieces).max()),
        'fcl_distance': _fcl_distance(motion, curve),
        'waypoints': path.waypoints.tolist(),
        'times': trajectory.times.tolist(),
        **{name: getattr(trajectory, name).tolist() for name in _POINTS},
    }


def _fcl_distance(motion: Motion, curve: Curve) -> float:
    """Return the least distance by python-fcl, at the end out to the target [m]."""
    arm, scene = table_1_arm(), motion.scene
    q = derivative(curve, instants(curve, SAMPLE_PERIOD), 0)
    along = least_distance(arm, scene, q, RAY, MARGIN)
    return min(
        along, least_distance(arm, scene, q[-1:], max(RAY, motion.plan.target_distance), MARGIN)
    )


def read_motions(path: Path) -> list[Row]:
    """
    Return the rows of a file.

    Raises
    ------
    RrthError
        There is none, or it holds something else.

    """
    try:
        rows: list[Row] = pq.read_table(path).select(SCHEMA.names).cast(SCHEMA).to_pylist()
    except (pa.ArrowException, KeyError, ValueError, OSError) as problem:
        raise RrthError(
            f'file {path}: {" ".join(str(problem).split())}; expected rows of motions'
        ) from problem
    return rows


def write_motions(path: Path, rows: Sequence[Row]) -> None:
    """Write all rows at once, or leave the file as it is."""
    table = pa.Table.from_pylist([{n: r.get(n) for n in SCHEMA.names} for r in rows], SCHEMA)
    write_table(path, table)
