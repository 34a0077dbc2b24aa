# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planner is measured against, and why a target is missed where it is."""

from collections.abc import Mapping
from dataclasses import dataclass

from benchmarks.common.queries import MAPS, QUERIES
from benchmarks.planners.arms import NAMES

# By the key of a target: the measured reason why it is missed.
WHY_NOT: Mapping[str, str] = {
    'one configuration, p50': (
        'About 31 ns are kinematics, the rest separation tests of three bars; on this processor '
        'an operation on eight numbers takes two passes.'
    ),
    'one configuration, in batches along an edge, p50': (
        'Mostly one proof of the edge covers its fifty configurations; where that is too '
        'short, each of them is checked.'
    ),
    'full query: choose the goal configuration, plan, shorten, p90': (
        'What is left is due to the goal configuration. Of ten queries over 1 %, seven come below '
        'it with 4096 draws of these, which take 0.3 ms instead of 0.03; one with ten times the '
        'growths.'
    ),
    'full query: choose the goal configuration, plan, shorten, p95': (
        'Queries that no straight edge answers: a growth takes 0.1 ms, its shortcuts 0.2 ms, '
        'and the elastic band of the best of them 1 ms or more.'
    ),
    **dict.fromkeys(
        (f'first path, {name}, p50' for name in QUERIES),
        'Some 20 us are the calls from Python and the result; the draws vary with the seed.',
    ),
    'within 0.02 % of the exact shortest, c_shape, p50': (
        'Some 20 us are the calls from Python and the result, as on a map where the straight line '
        'is free; growth and shortcuts take the remaining time.'
    ),
    'path, trajectory and both checks, over the service, p50': (
        'A service that does nothing takes 0.6 ms when called as often. Planning, time '
        'parameterization and both checks take the time named as planning in the node, two thirds '
        'of it in a loop that does nothing else. In the remaining time the node reads the bodies '
        'that came, revalidates the motion and publishes it.'
    ),
    'path, trajectory and both checks, over the service, p99': (
        'Queries with several homotopy classes, where the elastic band of the shortest path takes '
        'some ms; paths with many corners take python-fcl up to 4 ms, and one query in 500 first '
        'fails with 5 mm to spare, which takes 80 ms.'
    ),
    **dict.fromkeys(
        (f'within 1 % of the best known, {name}, p50' for name in QUERIES),
        'After shortcuts alone a path is some 2 % too long. The elastic band, which shortens it '
        'further, takes a millisecond and more.',
    ),
    'cold start of the node to service ready, p50': (
        'Nearly 170 kernels are compiled, in two processes: more than half of the time is '
        "numba's own, the rest LLVM's. More than a third of it is for the kernels that monitor "
        'and stop a moving arm.'
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """
    A line of the table.

    Parameters
    ----------
    what : str
    measure, name : str
        As for `measures.measured`.
    statistic : str
        `p50` and the like, `mean`, `sum` or `greatest`.
    limit : float
        At most, or at least where `is_floor`.
    unit : str
    is_floor : bool
    peer : str
        Best peer seen before, where none of this run is comparable.

    """

    what: str
    measure: str
    name: str
    statistic: str
    limit: float
    unit: str
    is_floor: bool = False
    peer: str = ''

    @property
    def key(self) -> str:
        """Name of the target in WHY_NOT."""
        return f'{self.what}, {self.statistic}'

    def is_met_by(self, value: float) -> bool:
        """Return whether a value is good enough."""
        return value >= self.limit if self.is_floor else value <= self.limit


def _figure(what: str, name: str, limit: float, unit: str, **others: object) -> Target:
    chosen = {'statistic': 'p50', 'measure': 'figure', **others}
    return Target(what=what, name=name, limit=limit, unit=unit, **chosen)  # type: ignore[arg-type]


def _over(measure: str, what: str, statistic: str, limits: Mapping[str, float]) -> list[Target]:
    return [
        Target(
            what=what.format(name),
            measure=measure,
            name=name,
            statistic=statistic,
            limit=limit,
            unit='ms',
        )
        for name, limit in limits.items()
    ]


_FULL = 'full query: choose the goal configuration, plan, shorten'
_PROVEN = 'certified edges that collide at 0.0005 rad'

TARGETS = (
    _figure('one configuration', 'configuration, single', 90.0, 'ns', peer='70 ns, scalar C++'),
    _figure(
        'one configuration, in batches along an edge',
        'configuration, batch',
        30.0,
        'ns',
        peer='15 ns, VAMP',
    ),
    *(
        _figure(
            f'certified edge of {length} rad',
            f'edge of {length} rad',
            limit,
            'us',
            peer='uncertified only',
        )
        for length, limit in (('0.3', 1.0), ('1', 1.8), ('3', 2.4))
    ),
    _figure(
        'truly free shortcut edges certified',
        'shortcut edges certified',
        0.995,
        '',
        statistic='mean',
        is_floor=True,
        peer='none certifies',
    ),
    *_over(
        'first path',
        'first path, {}',
        'p50',
        dict(zip(QUERIES, (0.06, 0.11, 0.10, 0.20), strict=True)),
    ),
    *(
        Target(
            what=f'runs within 1 % of the best known, {name}',
            measure='share near',
            name=name,
            statistic='mean',
            limit=0.95,
            unit='',
            is_floor=True,
        )
        for name in QUERIES
    ),
    *_over('near', 'within 1 % of the best known, {}', 'p50', dict.fromkeys(QUERIES, 2.0)),
    *_over('near', 'within 1 % of the best known, {}', 'p95', dict.fromkeys(QUERIES, 10.0)),
    *(
        Target(
            what=_FULL,
            measure=measure,
            name='random target',
            statistic=statistic,
            limit=limit,
            unit=unit,
            peer='none does it',
        )
        for measure, statistic, limit, unit in (
            ('query time', 'p50', 0.1, 'ms'),
            ('query time', 'p95', 1.5, 'ms'),
            ('query gap', 'p90', 1.0, '% over a long run'),
        )
    ),
    *_over(
        'exact',
        'within 0.02 % of the exact shortest, {}',
        'p50',
        dict(zip(MAPS, (0.1, 0.5, 3.0), strict=True)),
    ),
    _figure('path, trajectory and both checks, over the service', 'round trip', 3.0, 'ms'),
    _figure(
        'path, trajectory and both checks, over the service',
        'round trip',
        10.0,
        'ms',
        statistic='p99',
    ),
    *(
        _figure(
            f'cost of a configuration, {n} boxes over 8',
            f'configuration, {n} boxes',
            limit,
            'x',
            measure='growth',
        )
        for n, limit in ((64, 2.0), (512, 6.0))
    ),
    *(
        _figure(
            f'cost per joint over that of the Table 1 arm, {name}',
            f'cost per joint, {name}',
            3.0,
            'x',
        )
        for name in NAMES
    ),
    *(
        _figure(
            f'pointing goals planned, {name}',
            f'pointing, {name}',
            0.95,
            '',
            statistic='mean',
            is_floor=True,
        )
        for name in NAMES
    ),
    _figure('memory of the node', 'memory', 250.0, 'MB', statistic='greatest'),
    _figure(
        'memory of the node, growth after the first tenth of the plans',
        'memory',
        5.0,
        'MB',
        measure='memory growth',
        statistic='greatest',
    ),
    _figure('cold start of the node to service ready', 'cold start', 20.0, 's'),
    _figure('warm start of the node to service ready', 'warm start', 2.0, 's'),
    _figure(_PROVEN, 'certified edges that collide', 0.0, '', statistic='sum'),
    _figure(
        f'{_PROVEN}, by the reference checker',
        'certified edges that collide by the reference checker',
        0.0,
        '',
        statistic='sum',
    ),
)
