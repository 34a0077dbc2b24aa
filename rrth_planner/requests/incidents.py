# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Incidents of requests and stops: what is recorded, and where its file is kept."""

from datetime import datetime, timezone
from pathlib import Path
import shlex
import traceback
from typing import cast

from rrth_planner.collision.violation import Disagreement
from rrth_planner.execution.flight_recorder import FlightRecorder
from rrth_planner.execution.watch import Stop
from rrth_planner.io.incident import disagreement_incident, error_incident, Incident
from rrth_planner.io.incident_file import write_incident, write_record
from rrth_planner.model.errors import RecordError, RrthError
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.host import Host
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.requests.parameters import RequestParameters

# A folder keeps so many flight records, of up to some 20 MB each.
MOST_FLIGHTS = 10


class PlanError(RrthError):
    """An unexpected error, its cause, with the question that led to it."""

    def __init__(self, question: PlanQuestion, trajectory: Trajectory | None = None) -> None:
        """Keep the question, and the motion if there was one already."""
        super().__init__('planning failed')
        self.question, self.trajectory = question, trajectory


def keep(incident: Incident, folder: Path) -> tuple[str, Path | None]:
    """
    Write an incident to its file; return what to add to the answer, and the file.

    An error in writing does not change the answer.
    """
    try:
        path = write_incident(incident, folder)
    except Exception as problem:
        reason = ' '.join(f'{type(problem).__name__}: {problem}'.split())
        return f'; no file was written to replay it: {reason}', None
    return f'; to replay it: ./run exec replay {shlex.quote(str(path))}', path


def keep_flight(flight: FlightRecorder, folder: Path) -> Path:
    """Write the last events of the monitor to a file; raise RecordError where that fails."""
    time = datetime.now(timezone.utc).isoformat(timespec='microseconds')
    try:
        return write_record(flight.to_bytes(), folder, 'flight', time, '.flight', MOST_FLIGHTS)
    except Exception as problem:
        what = f'{type(problem).__name__}: {problem}'
        raise RecordError(f'no flight record was written: {what}') from problem


def incident_of(problem: BaseException) -> Incident | None:
    """Return the record of an error, where its question is known."""
    if not isinstance(problem, PlanError):
        return None
    cause = cause_of(problem)
    where = ''.join(traceback.format_exception(type(cause), cause, cause.__traceback__))
    try:
        return error_incident(problem.question, cause, where, problem.trajectory)
    except Exception:
        # The answer comes without it; the error itself is in the log.
        return None


def cause_of(problem: BaseException) -> BaseException:
    """Return the error itself, unwrapped."""
    if isinstance(problem, PlanError) and problem.__cause__ is not None:
        return problem.__cause__
    return problem


def sentence_of(problem: BaseException) -> str:
    """Return the sentence of an unexpected error."""
    cause = cause_of(problem)
    return f'planning failed unexpectedly: {type(cause).__name__}: {cause}'


async def incident_of_stop(stop: Stop, host: Host) -> Incident | None:
    """
    Return the record of a stop that is proven free but violates for the second checker, or None.

    That is asked after the stop is published: a moving arm does not wait for it.
    """
    if stop.scene is None or stop.goal is None:
        return None
    parameters, trajectory = cast(RequestParameters, stop.parameters), stop.trajectory
    required = parameters.required
    violation = await host.violation_seen(
        required, stop.scene, trajectory, required.ray_guard_length
    )
    if violation is None:
        return None
    question = PlanQuestion(
        arm=required.arm,
        scene=stop.scene,
        q_start=trajectory.positions[0],
        goal=stop.goal,
        limits=parameters.limits,
        options=parameters.options,
        margin=required.margin,
        ray_guard_length=required.ray_guard_length,
        seed=max(0, parameters.seed),
        escape_depth=parameters.escape_depth,
        reserve=parameters.reserve,
        second_checker=required.library,
    )
    return disagreement_incident(question, Disagreement(trajectory, violation))
