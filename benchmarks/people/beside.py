# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Runs beside recorded people, and what is seen in each of them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
import time

from rrth_planner.rehearsal.rehearsal import recorded_wearer, rehearsed
from rrth_planner.rehearsal.scenario import Proof, Recorded, Requests, Scenario, Tracker
from rrth_planner.rehearsal.session import REACHED

from benchmarks.people.taken import Goals

# How fast people are played, of 1.
RATES = (1.0, 1.5)
# One run beside a person [s]; the next one beside him has other targets.
LENGTH = 240.0
# Edges of the boxes of hands [m]; 0: as the skeleton has them.
HANDS = (0.2, 0.0)
# A request has so long to have the arm aim at its target [s].
IN_TIME = 6.0
# Recordings but that of the package begin with a T-pose of so long [s].
T_POSE = 0.1
STOPS = {'4/40': (4.0, 40.0), '10/400': (10.0, 400.0)}


@dataclass(slots=True)
class Row:
    """
    What was seen beside a person at a rate, with hands of a size.

    Parameters
    ----------
    n_taken, n_aimed_taken : int
        Requests whose goal was taken, and those of them after which the arm aimed in time.
    ray : dict
        How long the ray of an arm in motion crossed a part, by how that began [s].
    contacts : Counter
        By class, and by whether the part had kept its bound.

    """

    name: str
    rate: float
    hands: float
    seconds: float = 0.0
    cpu: float = 0.0
    n_requests: int = 0
    n_aimed: int = 0
    n_taken: int = 0
    n_aimed_taken: int = 0
    n_plans: int = 0
    n_stops: int = 0
    ray: dict[str, float] = field(default_factory=dict)
    moving: float = 0.0
    contacts: Counter[tuple[str, bool]] = field(default_factory=Counter)
    lost: dict[tuple[str, str], float] = field(default_factory=dict)
    outcomes: Counter[str] = field(default_factory=Counter)
    sentences: list[str] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)

    def add(self, other: 'Row') -> None:
        """Add what was seen in another run."""
        for name in (
            *('seconds', 'cpu', 'moving', 'n_requests', 'n_aimed', 'n_taken', 'n_aimed_taken'),
            *('n_plans', 'n_stops'),
        ):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for word, seconds in other.ray.items():
            self.ray[word] = self.ray.get(word, 0.0) + seconds
        self.contacts += other.contacts
        for key, seconds in other.lost.items():
            self.lost[key] = self.lost.get(key, 0.0) + seconds
        self.outcomes += other.outcomes
        self.sentences += other.sentences
        self.digests += other.digests


def scenarios(
    recordings: Sequence[str],
    n: int,
    length: float,
    stop: str,
    seed: int,
    hands: Sequence[float] = HANDS,
) -> list[Scenario]:
    """
    Return n runs, with other seeds, beside each person at each rate with each size of hands.

    length: of each [s].
    """
    acceleration, jerk = STOPS[stop]
    people = [(file, rate) for file in ('', *recordings) for rate in RATES]
    return [
        Scenario(
            about=Path(file).stem or 'construction work',
            # The same targets with either size of hands.
            seed=seed + 1000 * k + number,
            seconds=length,
            recorded=Recorded(
                file=file,
                skeleton='tum_bvh' if 'tum' in Path(file).stem else 'cmu_bvh',
                rate=rate,
                begin=T_POSE if file else 0.0,
                hand_size=size,
            ),
            tracker=Tracker(rate=60.0),
            separation=Proof(stop_acceleration=acceleration, stop_jerk=jerk),
            requests=Requests(pause=0.1, gives_up=IN_TIME),
        )
        for k, (file, rate) in enumerate(people)
        for size in hands
        for number in range(n)
    ]


def row_of(scenario: Scenario) -> Row:
    """Rehearse, and return what was seen."""
    begin = time.process_time()
    found = rehearsed(scenario)
    cpu = time.process_time() - begin
    assert scenario.recorded is not None
    over = [one for one in found.pursuits if one.outcome]
    in_time = [one.outcome == REACHED and one.took <= IN_TIME for one in over]
    goals = Goals(recorded_wearer(scenario))
    is_taken = [goals.is_taken(one.target, one.asked, one.asked + IN_TIME) for one in over]
    seen = found.testimony
    return Row(
        name=scenario.about,
        rate=scenario.recorded.rate,
        hands=scenario.recorded.hand_size,
        seconds=scenario.seconds,
        cpu=cpu,
        n_requests=len(over),
        n_aimed=sum(in_time),
        n_taken=sum(is_taken),
        n_aimed_taken=sum(a and t for a, t in zip(in_time, is_taken, strict=True)),
        n_plans=sum(one.n_plans for one in over),
        n_stops=found.n_stops,
        ray=seen.ray,
        moving=seen.moving_seconds,
        contacts=seen.contacts,
        lost=found.lost,
        outcomes=Counter(one.outcome for one in over),
        sentences=[f'{_named(scenario)}: {s}' for s in seen.sentences],
        digests=[found.digest],
    )


def _named(scenario: Scenario) -> str:
    assert scenario.recorded is not None
    recorded = scenario.recorded
    return (
        f'{scenario.about}, rate {recorded.rate:g}, hands {recorded.hand_size:g} m, '
        f'seed {scenario.seed}'
    )
