# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Runs beside recorded people, and what is seen in each of them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count, islice
import math
from pathlib import Path
import time

from rrth_planner.rehearsal.rehearsal import rehearsed
from rrth_planner.rehearsal.scenario import Proof, Recorded, Requests, Scenario, Tracker
from rrth_planner.rehearsal.session import REACHED

# How fast people are played, of 1.
RATES = (1.0, 1.5)
# One run beside a person [s]; the next one beside him has other targets.
LENGTH = 300.0
# A request has so long to have the arm aim at its target [s].
IN_TIME = 6.0
# Recordings but that of the package begin with a T-pose of so long [s].
T_POSE = 0.1
STOPS = {'4/40': (4.0, 40.0), '10/400': (10.0, 400.0)}


@dataclass(slots=True)
class Row:
    """What was seen beside a person at a rate."""

    name: str
    rate: float
    seconds: float = 0.0
    cpu: float = 0.0
    n_requests: int = 0
    n_aimed: int = 0
    n_plans: int = 0
    n_stops: int = 0
    ray: float = 0.0
    moving: float = 0.0
    contacts: Counter[tuple[str, bool]] = field(default_factory=Counter)
    lost: dict[tuple[str, str], float] = field(default_factory=dict)
    outcomes: Counter[str] = field(default_factory=Counter)
    sentences: list[str] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def add(self, other: 'Row') -> None:
        """Add what was seen in another run."""
        for name in ('seconds', 'cpu', 'n_requests', 'n_aimed', 'n_plans', 'n_stops', 'ray'):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.moving += other.moving
        self.contacts += other.contacts
        for key, seconds in other.lost.items():
            self.lost[key] = self.lost.get(key, 0.0) + seconds
        self.outcomes += other.outcomes
        self.sentences += other.sentences
        self.digests += other.digests


def scenarios(
    recordings: Sequence[str], hours: float, length: float, stop: str, seed: int
) -> list[Scenario]:
    """
    Return runs beside all people at all rates, for so many hours, neighbours beside one.

    length: of each [s].
    """
    people = [(file, rate) for file in ('', *recordings) for rate in RATES]
    n = math.ceil(3600.0 * hours / length)
    acceleration, jerk = STOPS[stop]
    found = []
    for k, (file, rate) in enumerate(people):
        recorded = Recorded(
            file=file,
            skeleton='tum_bvh' if 'tum' in Path(file).stem else 'cmu_bvh',
            rate=rate,
            begin=T_POSE if file else 0.0,
        )
        # The first ones have one more where it does not come out even.
        runs = n // len(people) + (k < n % len(people))
        found += [
            Scenario(
                about=Path(file).stem or 'construction work',
                seed=number,
                seconds=length,
                recorded=recorded,
                tracker=Tracker(rate=60.0),
                separation=Proof(stop_acceleration=acceleration, stop_jerk=jerk),
                requests=Requests(pause=0.1, gives_up=IN_TIME),
            )
            for number in islice(count(seed + 1000 * k), runs)
        ]
    return found


def row_of(scenario: Scenario) -> Row:
    """Rehearse, and return what was seen."""
    begin = time.process_time()
    found = rehearsed(scenario)
    cpu = time.process_time() - begin
    assert scenario.recorded is not None
    over = [one for one in found.pursuits if one.outcome]
    seen = found.testimony
    return Row(
        name=scenario.about,
        rate=scenario.recorded.rate,
        seconds=scenario.seconds,
        cpu=cpu,
        n_requests=len(over),
        n_aimed=sum(one.outcome == REACHED and one.took <= IN_TIME for one in over),
        n_plans=sum(one.n_plans for one in over),
        n_stops=found.n_stops,
        ray=seen.ray_seconds,
        moving=seen.moving_seconds,
        contacts=seen.contacts,
        lost=found.lost,
        outcomes=Counter(one.outcome for one in over),
        sentences=[f'{scenario.about}, seed {scenario.seed}: {s}' for s in seen.sentences],
        digests=[found.digest],
    )
