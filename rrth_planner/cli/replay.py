# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Replay an incident: plan again from the same inputs, and compare all collision checkers."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import sys
import traceback
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.program import program, say
from rrth_planner.io.incident import Incident, IncidentKind, versions
from rrth_planner.io.incident_file import read_incident
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import Trajectory

if TYPE_CHECKING:
    from rrth_planner.collision.checker_comparison import MotionComparison
    from rrth_planner.pipeline.motion_plan import MotionPlan

DESCRIPTION = """\
Replay an incident of the planner: a certified motion in which python-fcl found a clearance
violation, or an unexpected error. Neither is ever published; the node answers FAILURE and names
the file that this command reads. The command plans again from the same inputs with the same seed,
reports whether the motion is identical to the bit, and checks each piece of the recorded motion
by three collision checkers: the certificate, python-fcl, and the reference checker, which is
plain numpy and shares nothing with the others. It needs no ROS.
"""
EPILOG = """\
exit codes: 0  reproduced as recorded
            1  not reproduced (the difference is printed)
            2  the file is not an incident (the reason is printed)

A plan that reached a time limit (time_limit, improve_time) may differ on another machine, and
other versions of the libraries may round differently; differing versions are printed.

example:    %(prog)s ~/.ros/log/rrth_planner/incident-20261121T213655123456-1f0c2a.yaml
"""


@dataclass(frozen=True, slots=True, eq=False)
class Replanned:
    """Result of planning again: a plan, or an error with its traceback."""

    plan: 'MotionPlan | None' = None
    error: str = ''
    sentence: str = ''
    traceback: str = ''

    @property
    def trajectory(self) -> Trajectory | None:
        """The planned motion, certified or not."""
        if self.plan is None:
            return None
        if self.plan.disagreement is not None:
            return self.plan.disagreement.trajectory
        return self.plan.trajectory

    def __str__(self) -> str:
        """Return it in a sentence."""
        if self.plan is None:
            return f'{self.error}: {self.sentence}'
        return f'{self.plan.status.value}: {self.plan.sentence}'


def main(arguments: Sequence[str] | None = None) -> int:
    """Replay the incident of a file and return the exit code."""
    options = _parser().parse_args(arguments)
    try:
        incident = read_incident(options.file)
    except RrthError as problem:
        say('replay', ' '.join(str(problem).split()))
        return 2
    return replay(incident)


def replay(incident: Incident) -> int:
    """Plan again as in an incident, print the result, and return the exit code."""
    _print_record(incident)
    replanned = plan_again(incident)
    print(f'planned again: {replanned}')
    if replanned.traceback:
        print(replanned.traceback.rstrip())
    if incident.kind is IncidentKind.ERROR:
        return _conclude_error(incident, replanned)
    assert incident.trajectory is not None
    is_same = is_same_motion(replanned.trajectory, incident.trajectory)
    print(f'motion identical to the bit: {"yes" if is_same else "no"}')
    comparison = compare_on_recorded(incident, incident.trajectory)
    _print_comparison(comparison, incident.question.margin)
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


def plan_again(incident: Incident) -> Replanned:
    """Return the result of planning again from the request of an incident."""
    # Not for --help: loading the planner takes seconds, and compiling it, once, minutes.
    from rrth_planner.kernels.precompile import prepare_kernels

    prepare_kernels(partial(say, 'replay'))
    from rrth_planner.pipeline.plan_motion import plan_motion, warm_up

    question = incident.question
    try:
        # Compilation must not count as planning time.
        warm_up(question.arm, question.options)
        return Replanned(plan_motion(**question.arguments))
    except Exception as problem:
        return Replanned(None, type(problem).__name__, str(problem), traceback.format_exc())


def compare_on_recorded(incident: Incident, trajectory: Trajectory) -> 'MotionComparison':
    """Compare the checkers on a motion, with the wearer that it was checked against."""
    from rrth_planner.collision.checker_comparison import compare_checkers

    question = incident.question
    return compare_checkers(
        question.arm,
        question.scene if incident.present is None else incident.present,
        question.goal,
        trajectory,
        question.margin,
        question.ray_guard_length,
        incident.escape_time,
    )


def is_same_motion(one: Trajectory | None, other: Trajectory) -> bool:
    """Return whether two motions are identical to the bit."""
    return one is not None and all(
        np.array_equal(getattr(one, name).view(np.int64), getattr(other, name).view(np.int64))
        for name in ('times', 'positions', 'velocities', 'accelerations')
    )


def _conclude_error(incident: Incident, replanned: Replanned) -> int:
    if replanned.error == incident.error:
        print(f'reproduced: {incident.error}, as recorded')
        return 0
    if incident.trajectory is not None and replanned.plan is not None:
        is_same = is_same_motion(replanned.trajectory, incident.trajectory)
        print(f'motion identical to the bit: {"yes" if is_same else "no"}')
        print(f'not reproduced: the {incident.error} occurred after the motion had been planned')
    else:
        print(f'not reproduced: recorded was {incident.error}, now: {replanned}')
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


def _print_comparison(comparison: 'MotionComparison', margin: float) -> None:
    print(f'the recorded motion, margin {margin:g} m:')
    columns = f'{"certificate":>12} {"fcl [m]":>12} {"reference [m]":>13}  closest by fcl'
    print(f'  {"piece":>5} {"from [s]":>9} {"to [s]":>9} {columns}')
    for i, piece in enumerate(comparison.pieces):
        name = 'end' if i == len(comparison.pieces) - 1 else str(i)
        fcl = piece.fcl
        print(
            f'  {name:>5} {piece.begin:9.4f} {piece.end:9.4f} {piece.certificate:>12} '
            f'{fcl.distance:12.7f} {piece.reference:13.7f}  {fcl.bar}, "{fcl.box}"'
        )
    violation = comparison.violation
    found = 'free'
    if violation is not None:
        found = (
            f'{violation.bar} at {violation.distance:.7f} m from "{violation.box}" '
            f'at {violation.time:.4f} s'
        )
    print(f'certificate: {"proven free" if comparison.is_proven else "not proven"}')
    print(f'python-fcl: {found}')
    word = 'keeps the margin' if comparison.clearance >= margin else 'below the margin'
    print(f'reference checker: least clearance {comparison.clearance:.7f} m, {word}')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('replay'),
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('file', type=Path, metavar='FILE', help='YAML file of the incident')
    return parser


if __name__ == '__main__':
    sys.exit(main())
