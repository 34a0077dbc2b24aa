# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents as YAML files: a folder keeps the last hundred."""

from contextlib import suppress
import os
from pathlib import Path
import uuid

from rrth_planner.io.incident import Incident, incident_from_mapping, incident_to_mapping
from rrth_planner.io.text_file import load_yaml, to_yaml
from rrth_planner.model.errors import RecordError, RrthError

MOST_FILES = 100
PATTERN = 'incident-*.yaml'
HEADER = '# An incident of rrth_planner. To replay it: ./run exec replay FILE\n'


def incident_to_yaml(incident: Incident) -> str:
    """Return the text of an incident's file; PyYAML writes numbers by repr, so to the bit."""
    return HEADER + to_yaml(incident_to_mapping(incident))


def write_incident(incident: Incident, folder: Path) -> Path:
    """
    Write an incident to a new file of a folder, and remove the oldest beyond a hundred.

    Creates the folder if needed; the file is written atomically.

    Raises
    ------
    OSError
        The file cannot be written.

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
    try:
        return incident_from_mapping(data)
    except RrthError as problem:
        raise RecordError(f'file {path}: {problem}') from problem


def _remove_oldest(folder: Path, newest: Path) -> None:
    """Remove the oldest files; the newest stays, whatever its time stamp."""
    others = [file for file in folder.glob(PATTERN) if file != newest]
    others.sort(key=lambda file: (file.stat().st_mtime_ns, file.name), reverse=True)
    for file in others[MOST_FILES - 1 :]:
        file.unlink(missing_ok=True)
