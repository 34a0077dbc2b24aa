# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Play back what never should have happened: plan the same once more, and ask all judges."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import sys
import traceback
from typing import TYPE_CHECKING

import numpy as np
from rrth_planner.cli.program import program, tell
from rrth_planner.io.incident import Incident, IncidentKind, versions
from rrth_planner.io.incident_file import read_incident
from rrth_planner.model.errors import RrthError
from rrth_planner.model.trajectory import Trajectory

if TYPE_CHECKING:
    from rrth_planner.collision.checker_comparison import Verdict
    from rrth_planner.pipeline.motion_plan import MotionPlan

DESCRIPTION = """\
Play back an incident of the planner: a motion that its certificate had proven free and that
python-fcl saw touch, or an error that nobody expected. Neither is ever published; the node
answers FAILURE and names the file that this command reads. It plans again from the same inputs
with the same seed, says whether the motion is the same to the bit, and asks three judges about
each of its pieces: the certificate, python-fcl, and plain numpy code that shares nothing with
either. It needs no ROS.
"""
EPILOG = """\
exit codes: 0  it happens again as recorded
            1  something else happens now (what, is printed)
            2  the file is no such record (why, is printed)

A plan whose time ran out (time_limit, improve_time) need not be the same on another machine, and
other versions of the libraries may round differently; where versions differ, that is printed.

example:    %(prog)s ~/.ros/log/rrth_planner/incident-20261121T213655123456-1f0c2a.yaml
"""


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What planning again led to: a plan, or an error and where it came from."""

    plan: 'MotionPlan | None' = None
    error: str = ''
    sentence: str = ''
    traceback: str = ''

    @property
    def trajectory(self) -> Trajectory | None:
        """The motion that was planned, whatever the judges think of it."""
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
        tell('replay', ' '.join(str(problem).split()))
        return 2
    return replay(incident)


def replay(incident: Incident) -> int:
    """Plan again as an incident did, print what comes of it, and return the exit code."""
    _print_record(incident)
    answer = plan_again(incident)
    print(f'planned again: {answer}')
    if answer.traceback:
        print(answer.traceback.rstrip())
    if incident.kind is IncidentKind.ERROR:
        return _conclude_error(incident, answer)
    assert incident.trajectory is not None
    is_same = is_same_motion(answer.trajectory, incident.trajectory)
    print(f'the same motion to the bit: {"yes" if is_same else "no"}')
    verdict = verdict_of_recorded(incident, incident.trajectory)
    _print_verdict(verdict, incident.question.margin)
    if is_same and verdict.is_disagreement:
        print('reproduced: the two judges disagree about the same motion as recorded')
        return 0
    reasons = []
    if not is_same:
        reasons.append('planning again does not lead to the same motion')
    if not verdict.is_disagreement:
        is_free = verdict.is_proven and verdict.touch is None
        what = 'is free' if is_free else 'is not proven free'
        reasons.append(f'the judges agree now that the recorded motion {what}')
    print(f'not reproduced: {", and ".join(reasons)}')
    return 1


def plan_again(incident: Incident) -> Answer:
    """Return what the question of an incident leads to now."""
    # Not for --help: loading the planner takes seconds, and compiling it, once, minutes.
    from rrth_planner.kernels.precompile import prepare_kernels

    prepare_kernels(partial(tell, 'replay'))
    from rrth_planner.pipeline.plan_motion import plan_motion, warm_up

    question = incident.question
    try:
        # What compiles here must not count as planning time.
        warm_up(question.arm, question.options)
        return Answer(plan_motion(**question.arguments))
    except Exception as problem:
        return Answer(None, type(problem).__name__, str(problem), traceback.format_exc())


def verdict_of_recorded(incident: Incident, trajectory: Trajectory) -> 'Verdict':
    """Return what the judges say now of a motion, round the wearer that it was judged for."""
    from rrth_planner.collision.checker_comparison import verdict_of

    question = incident.question
    return verdict_of(
        question.arm,
        question.scene if incident.present is None else incident.present,
        question.goal,
        trajectory,
        question.margin,
        question.ray_guard_length,
        incident.escape_time,
    )


def is_same_motion(one: Trajectory | None, other: Trajectory) -> bool:
    """Return whether two motions are the same to the bit."""
    return one is not None and all(
        np.array_equal(getattr(one, name).view(np.int64), getattr(other, name).view(np.int64))
        for name in ('times', 'positions', 'velocities', 'accelerations')
    )


def _conclude_error(incident: Incident, answer: Answer) -> int:
    if answer.error == incident.error:
        print(f'reproduced: {incident.error}, as recorded')
        return 0
    if incident.trajectory is not None and answer.plan is not None:
        is_same = is_same_motion(answer.trajectory, incident.trajectory)
        print(f'the same motion to the bit: {"yes" if is_same else "no"}')
        print(f'not reproduced: the {incident.error} came after the motion had been planned')
    else:
        print(f'not reproduced: recorded was {incident.error}, now: {answer}')
    return 1


def _print_record(incident: Incident) -> None:
    question = incident.question
    print(f'recorded: {incident.kind.value}, {incident.time}')
    print(f'  {incident.error + ": " if incident.error else ""}{incident.sentence}')
    moved = '' if incident.present is None else f', {len(incident.present.boxes)} when judged'
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


def _print_verdict(verdict: 'Verdict', margin: float) -> None:
    print(f'the recorded motion, distances to keep {margin:g} m:')
    columns = f'{"certificate":>12} {"fcl [m]":>12} {"oracle [m]":>12}  closest for fcl'
    print(f'  {"piece":>5} {"from [s]":>9} {"to [s]":>9} {columns}')
    for i, opinion in enumerate(verdict.opinions):
        name = 'end' if i == len(verdict.opinions) - 1 else str(i)
        fcl = opinion.fcl
        print(
            f'  {name:>5} {opinion.begin:9.4f} {opinion.end:9.4f} {opinion.certificate:>12} '
            f'{fcl.distance:12.7f} {opinion.oracle:12.7f}  {fcl.bar}, "{fcl.box}"'
        )
    touch = verdict.touch
    seen = 'free' if touch is None else f'{touch.bar} at {touch.distance:.7f} m from "{touch.box}"'
    if touch is not None:
        seen += f' at {touch.time:.4f} s'
    print(f'certificate: {"proven free" if verdict.is_proven else "not proven"}')
    print(f'python-fcl: {seen}')
    word = 'keeps the margin' if verdict.clearance >= margin else 'below the margin'
    print(f'numpy oracle: least clearance {verdict.clearance:.7f} m, {word}')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('replay'),
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('file', type=Path, metavar='FILE', help='the YAML file of the incident')
    return parser


if __name__ == '__main__':
    sys.exit(main())
