# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents: plans that failed unexpectedly, and files with everything to replay them."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime, timezone
from enum import Enum
import functools
import hashlib
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
from typing import Any
import uuid

from rrth_planner.collision.violation import Disagreement, Violation
from rrth_planner.io.entries import number, text
from rrth_planner.io.serialization import (
    fields_of,
    plain,
    question_from_mapping,
    scene_from_mapping,
    trajectory_from_mapping,
    violation_from_mapping,
)
from rrth_planner.io.text_file import load_yaml, naming_file, to_yaml
from rrth_planner.model.errors import one_line, RecordError, shown
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.request import PlanQuestion

# Version of the record's layout; others are rejected.
FORMAT = 2
# A folder keeps the last hundred files.
MOST_FILES = 100
PATTERN = 'incident-*.yaml'
HEADER = '# An incident of rrth_planner. To replay it: ./run exec replay FILE\n'
PACKAGES = ('rrth_planner', 'numpy', 'numba', 'python-fcl')


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
        The clearance violation that python-fcl found.
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


def incident_from_mapping(data: Any) -> Incident:
    """Return the incident of a mapping; RrthError: an entry missing, unknown or out of range."""
    if isinstance(data, Mapping) and data.get('format') != FORMAT:
        raise RecordError(f'format: {shown(data.get("format"))}, expected {FORMAT}')
    given = fields_of(data, Incident, 'incident', ('format',))
    kinds = [kind.value for kind in IncidentKind]
    if given['kind'] not in kinds:
        raise RecordError(f'kind: {shown(given["kind"])}, expected {" or ".join(kinds)}')
    if not isinstance(given['versions'], Mapping):
        raise RecordError(f'versions: {shown(given["versions"])}, expected a mapping')
    present, violation = given['present'], given['violation']
    return Incident(
        kind=IncidentKind(given['kind']),
        question=question_from_mapping(given['question']),
        trajectory=trajectory_from_mapping(given['trajectory'], 'trajectory'),
        violation=None if violation is None else violation_from_mapping(violation),
        present=None if present is None else scene_from_mapping(present, 'present'),
        escape_time=number(given['escape_time'], 'escape_time', 's', RecordError),
        traceback=text(given['traceback'], 'traceback', RecordError),
        versions={
            _line(key, 'versions'): _line(value, f'versions: {key}')
            for key, value in given['versions'].items()
        },
        **{name: _line(given[name], name) for name in ('sentence', 'time', 'error')},
    )


def _line(value: Any, name: str) -> str:
    """Return a text as a line that may be printed, or raise RecordError."""
    return one_line(text(value, name, RecordError))


def incident_to_yaml(incident: Incident) -> str:
    """Return the text of an incident's file; PyYAML writes numbers by repr, so to the bit."""
    return HEADER + to_yaml({'format': FORMAT, **plain(incident)})


def write_incident(incident: Incident, folder: Path) -> Path:
    """
    Write an incident to a new file of a folder, and remove the oldest beyond a hundred.

    Creates the folder if needed; the file is written atomically, or OSError is raised.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stamp = ''.join(c for c in incident.time[:26] if c.isalnum())
    path = folder / f'incident-{stamp}-{uuid.uuid4().hex[:6]}.yaml'
    fresh = path.with_suffix('.part')
    try:
        fresh.write_text(incident_to_yaml(incident), encoding='utf-8')
        os.replace(fresh, path)
    finally:
        fresh.unlink(missing_ok=True)
    with suppress(OSError):
        _remove_oldest(folder, path)
    return path


def read_incident(path: Path) -> Incident:
    """Return the incident of a file, or raise RrthError."""
    data = load_yaml(path)
    with naming_file(path, RecordError):
        return incident_from_mapping(data)


def _remove_oldest(folder: Path, newest: Path) -> None:
    """Remove the oldest files; the newest stays, whatever its time stamp."""
    others = [file for file in folder.glob(PATTERN) if file != newest]
    others.sort(key=lambda file: (file.stat().st_mtime_ns, file.name), reverse=True)
    for file in others[MOST_FILES - 1 :]:
        file.unlink(missing_ok=True)
