# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents: plans that failed unexpectedly, recorded with everything to replay them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from enum import Enum
import functools
import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
import platform

from rrth_planner.collision.violation import Disagreement, Violation
from rrth_planner.model.errors import one_line, RecordError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.request import PlanQuestion

PACKAGES = ('rrth_planner', 'numpy', 'numba', 'python-fcl', 'coal')


class IncidentKind(Enum):
    """Kinds of incidents."""

    # Of the two collision checks.
    DISAGREEMENT = 'disagreement'
    ERROR = 'error'


@functools.cache
def versions() -> Mapping[str, str]:
    """Return the versions of what takes part in a plan, and the kind of machine."""
    return {
        **{package: _version(package) for package in PACKAGES},
        'sources': _digest_of_sources(),
        'python': platform.python_version(),
        'platform': platform.platform(),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        # A source tree, or a package of the system.
        return 'unknown'


def _digest_of_sources() -> str:
    """Return a short digest of this package: without a version, or between two."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob('*.py')):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def _now() -> str:
    return datetime.now(timezone.utc).isoformat(timespec='microseconds')


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Incident:
    """
    A plan that failed in a way that must never happen.

    Parameters
    ----------
    sentence, time : str
        Description, in one line; ISO 8601, by default now.
    trajectory : Trajectory or None
        The motion concerned, if there was one already.
    violation : Violation or None
        The clearance violation that the second checker found.
    present : Scene or None
        The wearer that the motion was checked against, where that is not the one it was planned
        for, since the wearer moved meanwhile.
    escape_time : float
        Until then the motion escapes from boxes that the arm was in [s].
    error, traceback : str
        Type and traceback of the error; empty for a disagreement.

    Raises
    ------
    RecordError
        A disagreement without a motion, or a motion whose number of joints is not the arm's.

    """

    kind: IncidentKind
    sentence: str
    time: str = field(default_factory=_now)
    question: PlanQuestion
    trajectory: Trajectory | None = None
    violation: Violation | None = None
    present: Scene | None = None
    escape_time: float = 0.0
    error: str = ''
    traceback: str = ''
    versions: Mapping[str, str] = field(default_factory=versions)

    def __post_init__(self) -> None:
        """Validate."""
        if self.kind is IncidentKind.DISAGREEMENT and None in (self.trajectory, self.violation):
            raise RecordError('incident: a disagreement without trajectory and violation')
        if self.trajectory is not None:
            width, dof = self.trajectory.positions.shape[1], self.question.arm.dof
            if width != dof:
                raise RecordError(f'trajectory: {width} joints, expected {dof}, as the arm')


def disagreement_incident(
    question: PlanQuestion, found: Disagreement, present: Scene | None = None
) -> Incident:
    """Return a new incident of a disagreement; `present` as in `Incident`."""
    return Incident(
        kind=IncidentKind.DISAGREEMENT,
        sentence=found.sentence(question.margin),
        question=question,
        trajectory=found.trajectory,
        violation=found.violation,
        present=present,
        escape_time=found.escape_time,
    )


def error_incident(
    question: PlanQuestion, problem: BaseException, where: str, trajectory: Trajectory | None
) -> Incident:
    """Return a new incident of an error; where: its traceback."""
    return Incident(
        kind=IncidentKind.ERROR,
        sentence=one_line(str(problem)),
        question=question,
        trajectory=trajectory,
        error=type(problem).__name__,
        traceback=where,
    )
