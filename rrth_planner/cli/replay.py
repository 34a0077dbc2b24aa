# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Replay an incident: plan again from the same inputs, and compare all collision checkers.

Or a flight record: decide about the same events again, and compare what is commanded.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
import sys
import traceback
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.file_question import plan_of
from rrth_planner.cli.parsers.replay import parser
from rrth_planner.cli.program import run, say
from rrth_planner.io.incident import Incident, IncidentKind, versions
from rrth_planner.io.incident_file import read_incident
from rrth_planner.model.trajectory import Trajectory

# How the name of a flight record ends.
FLIGHT = '.flight'

if TYPE_CHECKING:
    from rrth_planner.collision.checker_comparison import MotionComparison
    from rrth_planner.pipeline.motion_plan import MotionPlan


def main(arguments: Sequence[str] | None = None) -> int:
    """Replay the incident of a file and return the exit code."""
    options = parser().parse_args(arguments)
    return run('replay', lambda: _replay_file(Path(options.file)), 2)


def _replay_file(file: Path) -> int:
    if file.suffix == FLIGHT:
        # It compiles kernels before what needs them is loaded.
        from rrth_planner.kernels.precompile import prepare_kernels

        prepare_kernels(partial(say, 'replay'))
        from rrth_planner.cli.flight_replay import replay_flight

        return replay_flight(file)
    return replay(read_incident(file))


def replay(incident: Incident) -> int:
    """Plan again as in an incident, print the result, and return the exit code."""
    _print_record(incident)
    planned = _plan_again(incident)
    print(f'planned again: {_sentence_of(planned)}')
    if isinstance(planned, Exception):
        print(''.join(traceback.format_exception(planned)).rstrip())
    if incident.kind is IncidentKind.ERROR:
        return _conclude_error(incident, planned)
    assert incident.trajectory is not None
    is_same = _is_same_motion(planned, incident.trajectory)
    comparison = _compare_on_recorded(incident, incident.trajectory)
    _print_comparison(comparison, incident.question.margin, incident.question.second_checker)
    if is_same and comparison.is_disagreement:
        print('reproduced: the two collision checks disagree about the same motion as recorded')
        return 0
    reasons = []
    if not is_same:
        reasons.append('planning again gives another motion')
    if not comparison.is_disagreement:
        is_free = comparison.is_proven and comparison.violation is None
        what = 'is free' if is_free else 'is not proven free'
        reasons.append(f'the collision checks now agree that the recorded motion {what}')
    print(f'not reproduced: {", and ".join(reasons)}')
    return 1


def _plan_again(incident: Incident) -> 'MotionPlan | Exception':
    """Return the result of planning again from the request of an incident."""
    try:
        return plan_of(incident.question, 'replay')
    except Exception as problem:
        return problem


def _sentence_of(planned: 'MotionPlan | Exception') -> str:
    if isinstance(planned, Exception):
        return f'{type(planned).__name__}: {planned}'
    return f'{planned.status.value}: {planned.sentence}'


def _compare_on_recorded(incident: Incident, trajectory: Trajectory) -> 'MotionComparison':
    """Compare the checkers on a motion, with the wearer that it was checked against."""
    from rrth_planner.collision.checker_comparison import compare_checkers

    question = incident.question
    return compare_checkers(
        question.required,
        question.scene if incident.present is None else incident.present,
        question.goal,
        trajectory,
        incident.escape_time,
    )


def _is_same_motion(planned: 'MotionPlan | Exception', recorded: Trajectory) -> bool:
    """Return whether the planned motion, certified or not, is the recorded one; print it."""
    motion = None
    if not isinstance(planned, Exception):
        wrong = planned.disagreement
        motion = planned.trajectory if wrong is None else wrong.trajectory
    is_same = motion is not None and all(
        np.array_equal(
            getattr(motion, name).view(np.int64), getattr(recorded, name).view(np.int64)
        )
        for name in ('times', 'positions', 'velocities', 'accelerations')
    )
    print(f'motion identical to the bit: {"yes" if is_same else "no"}')
    return is_same


def _conclude_error(incident: Incident, planned: 'MotionPlan | Exception') -> int:
    is_error = isinstance(planned, Exception)
    if is_error and type(planned).__name__ == incident.error:
        print(f'reproduced: {incident.error}, as recorded')
        return 0
    if incident.trajectory is not None and not is_error:
        _is_same_motion(planned, incident.trajectory)
        print(f'not reproduced: the {incident.error} occurred after the motion had been planned')
    else:
        now = _sentence_of(planned)
        print(f'not reproduced: recorded was {incident.error}, now: {now}')
    return 1


def _print_record(incident: Incident) -> None:
    question = incident.question
    print(f'recorded: {incident.kind.value}, {incident.time}')
    print(f'  {incident.error + ": " if incident.error else ""}{incident.sentence}')
    moved = '' if incident.present is None else f', {len(incident.present.boxes)} when checked'
    at_rest = 'at rest' if question.moving is None else 'moving'
    print(
        f'  arm of {question.arm.dof} joints, {at_rest}; {len(question.scene.boxes)} boxes{moved};'
        f' {type(question.options).__name__}, margin {question.margin:g} m, '
        f'ray {question.ray_guard_length:g} m, seed {question.seed}'
    )
    now = versions()
    for name in sorted({*now, *incident.versions}):
        before, after = incident.versions.get(name, 'none'), now.get(name, 'none')
        if before != after:
            print(f'  {name}: {before} then, {after} now')


def _print_comparison(comparison: 'MotionComparison', margin: float, library: str) -> None:
    print(f'the recorded motion, margin {margin:g} m:')
    columns = f'{"certificate":>12} {"second [m]":>12} {"reference [m]":>13}  closest (second)'
    print(f'  {"piece":>5} {"from [s]":>9} {"to [s]":>9} {columns}')
    for i, piece in enumerate(comparison.pieces):
        name = 'end' if i == len(comparison.pieces) - 1 else str(i)
        second = piece.second
        print(
            f'  {name:>5} {piece.begin:9.4f} {piece.end:9.4f} {piece.certificate:>12} '
            f'{second.distance:12.7f} {piece.reference:13.7f}  {second.bar}, "{second.box}"'
        )
    found, wrong = 'free', comparison.violation
    if wrong is not None:
        found = f'{wrong.bar} at {wrong.distance:.7f} m from "{wrong.box}" at {wrong.time:.4f} s'
    print(f'certificate: {"proven free" if comparison.is_proven else "not proven"}')
    print(f'second checker, {library}: {found}')
    word = 'keeps the margin' if comparison.clearance >= margin else 'below the margin'
    print(f'reference checker: least clearance {comparison.clearance:.7f} m, {word}')


if __name__ == '__main__':
    sys.exit(main())
