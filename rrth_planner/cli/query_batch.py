# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Some queries of a campaign with all that they need, and their answers: what a worker does."""

# mypy: disable-error-code="import-untyped,import-not-found,no-untyped-call"

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
import hashlib
import json
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from rrth_planner.cli.file_question import figures_of, question_of, SEEDS, start_of
from rrth_planner.io.arm_file import arm_from_text
from rrth_planner.io.incident import versions
from rrth_planner.io.query_file import FILES, read_queries, SEED, start_columns, TARGET
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import checked_settings, PlanSettings
from rrth_planner.io.text_file import read_text
from rrth_planner.io.wearer_file import body_from_text
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import ModelError, one_line, OptionsError, RrthError
from rrth_planner.model.scene import Scene

# Of a query that no plan can be made for, and of one whose plan failed as it never should.
INVALID, ERROR = 'invalid query', 'error'
RESULTS = pa.schema(
    [
        # Of what the files of arm and wearer held.
        *((f'{name}_digest', pa.string()) for name in FILES),
        ('status', pa.string()),
        ('sentence', pa.string()),
        ('waypoints', pa.int64()),
        *((name, pa.float64()) for name in ('duration_s', 'length_rad', 'clearance_m', 'reach_m')),
        *((name, pa.float64()) for name in ('escape_time_s', 'planning_time_s')),
        # The joint positions at the end [rad or m].
        ('end', pa.list_(pa.float64())),
    ]
)
# Columns of the answers; the first ones of RESULTS belong to the queries.
_ANSWER = RESULTS.names[len(FILES) :]


@dataclass(frozen=True, slots=True)
class FileText:
    """
    What a file of an arm or a wearer held: workers on other machines need not have it.

    Parameters
    ----------
    place : str
        Where it is; empty: the one of the package.
    text : str
        Empty where it could not be read.
    problem : str
        Why not.

    """

    place: str
    text: str
    problem: str = ''

    def checked(self) -> tuple[str, str]:
        """Return the text, and what sentences call the file, or raise ModelError."""
        if self.problem:
            raise ModelError(self.problem)
        return self.text, self.place


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class QueryBatch:
    """
    Queries as a table, with the files of each.

    Parameters
    ----------
    table : pyarrow.Table
        The columns of the query file, seed and digests included.
    arms, bodies : tuple of FileText
        Of each query.
    settings : str
        All values of the settings, by name, as JSON.

    """

    table: Any
    arms: tuple[FileText, ...]
    bodies: tuple[FileText, ...]
    settings: str

    def after(self, n: int) -> 'QueryBatch':
        """Return the batch without its first n queries."""
        return QueryBatch(
            table=self.table.slice(n),
            arms=self.arms[n:],
            bodies=self.bodies[n:],
            settings=self.settings,
        )


def read_batches(
    paths: Sequence[Path],
    size: int,
    *,
    arm: str,
    body: str,
    seed: int | None,
    settings: Mapping[str, Any],
) -> Iterator[QueryBatch]:
    """
    Yield the queries of files in batches of at most `size`.

    Parameters
    ----------
    arm, body : str
        Files of the queries that name none; empty: those of the package.
    seed : int, optional
        Of the queries that have none; without, each of these has its number as seed, from 0 on.
    settings : mapping
        All values by name.

    """
    first, values = 0, json.dumps(settings, sort_keys=True)
    for path, table in read_queries(paths, size):
        n = len(table)
        found = {
            name: tuple(_places(path, table, name, default))
            for name, default in zip(FILES, (arm, body), strict=True)
        }
        texts = {name: tuple(read_file(place, name) for place in found[name]) for name in FILES}
        given = table[SEED].to_pylist() if SEED in table.schema.names else [None] * n
        seeds = [
            (first + k if seed is None else seed) if number is None else number
            for k, number in enumerate(given)
        ]
        first += n
        columns = {name: table[name] for name in table.schema.names}
        columns[SEED] = pa.array(seeds, pa.int64())
        for name in FILES:
            digests = [_digest(file.text) if not file.problem else None for file in texts[name]]
            columns[f'{name}_digest'] = pa.array(digests, pa.string())
        arms, bodies = (texts[name] for name in FILES)
        yield QueryBatch(table=pa.table(columns), arms=arms, bodies=bodies, settings=values)


def _places(path: Path, table: Any, name: str, default: str) -> Iterator[str]:
    """Yield where the file of each query is."""
    given = table[name].to_pylist() if name in table.schema.names else [None] * len(table)
    yield from (str(path.parent / place) if place else default for place in given)


# As many as a batch may have, and more, so that it has each text once.
@lru_cache(maxsize=1024)
def read_file(place: str, name: str) -> FileText:
    """Return what a file held; empty: the one of the package, of an arm or a body by name."""
    try:
        return FileText(place, read_text(place or resource_path(f'config/{name}.yaml')))
    except RrthError as problem:
        return FileText(place, '', str(problem))


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class _Fitted(NamedTuple):
    arm: ArmModel
    settings: PlanSettings


def prepare(batch: QueryBatch) -> dict[str, str]:
    """Load what the first query needs, kernels included; return the versions of this worker."""
    # The answer to that query says so.
    with suppress(RrthError):
        _fitted(batch.arms[0], batch.settings)
    return dict(versions())


def planned(batch: QueryBatch) -> Any:
    """Return the table of a batch with the columns of the answers."""
    answers = [
        _answer(batch, query, arm, body)
        for query, arm, body in zip(batch.table.to_pylist(), batch.arms, batch.bodies, strict=True)
    ]
    table = batch.table
    for name in _ANSWER:
        column = pa.array([answer.get(name) for answer in answers], RESULTS.field(name).type)
        table = table.append_column(name, column)
    return table


def _answer(
    batch: QueryBatch, query: Mapping[str, Any], arm_file: FileText, body_file: FileText
) -> dict[str, Any]:
    """Return the figures of the plan of a query, or why there is none."""
    from rrth_planner.pipeline.plan_motion import plan_question

    try:
        arm, settings = _fitted(arm_file, batch.settings)
        if not 0 <= query[SEED] < SEEDS:
            raise OptionsError(f'seed: {query[SEED]}, expected 0 to {SEEDS - 1} [-]')
        given = [query[name] for name in start_columns(list(query))]
        while given and given[-1] is None:
            # Of a joint that other arms have.
            given.pop()
        start = start_of(given or None, 'start', arm, is_packaged=not arm_file.place)
        target: Any = [query[name] for name in TARGET]
        plan = plan_question(
            question_of(arm, _body(body_file), start, target, settings, query[SEED])
        )
        figures = figures_of(arm, start, plan)
        return figures | {'end': figures['end']['q'] if 'end' in figures else None}
    except RrthError as problem:
        return {'status': INVALID, 'sentence': str(problem)}
    except Exception as problem:
        # No query may end the campaign of all others.
        return {'status': ERROR, 'sentence': one_line(f'{type(problem).__name__}: {problem}')}


# Each arm has kernels of its own, and the world that was made last of an arm and a wearer is kept
# as long as these are the same values.
@lru_cache(maxsize=64)
def _fitted(file: FileText, settings: str) -> _Fitted:
    """Return an arm, with which all is loaded by now, and the settings for it."""
    from rrth_planner.pipeline.plan_motion import warm_up

    arm = arm_from_text(*file.checked())
    fitting = checked_settings(json.loads(settings), {}, arm.dof)
    # Compiling and loading do not count as planning time.
    warm_up(arm, fitting.options, fitting.second_checker)
    return _Fitted(arm, fitting)


@lru_cache(maxsize=64)
def _body(file: FileText) -> Scene:
    return body_from_text(*file.checked())
