# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is measured of RRT-H's relatives and of references in the plane, in a table and words."""

from collections.abc import Iterable

import numpy as np
from rrth_planner.reproduction.experiments import (
    DUBINS,
    Extent,
    FIELD,
    HALVED,
    LATTICES,
    NO_FIELD,
    RELATIVES,
    ROADMAPS,
    RRT,
    RRT_H,
    with_near,
)
from rrth_planner.reproduction.problems import exact_length
from rrth_planner.reproduction.relatives.lattice import OCTILE_RATIO
from rrth_planner.reproduction.relatives.potential_field import PotentialFieldOptions
from rrth_planner.reproduction.statistics import (
    markdown_table,
    number,
    percent,
    Rows,
    share_of,
    spread,
)


def relatives_table(rows: Rows, extent: Extent) -> str:
    """Return the results of each relative on each map, beside those of RRT and RRT-H."""
    lines = []
    for problem in with_near(extent.maps):
        exact = exact_length(problem)
        for name in (RRT, RRT_H, *RELATIVES):
            few, many = (
                rows.where(problem=problem, algorithm=name, below=n)
                for n in (extent.few, extent.many)
            )
            lines.append(
                [
                    f'{problem} ({exact:.2f})',
                    name,
                    many.found(),
                    percent(many.share('is_valid')),
                    spread(many.values('draws_first'), 0),
                    spread(few.values('cost_final')),
                    spread(many.values('cost_final')),
                    number(many.median('cost_final') / exact, 4),
                ]
            )
    header = (
        *('map (exact shortest)', 'planner', 'found', 'valid', 'P_random (A*: nodes expanded)'),
        *(f'cost, {extent.few} runs', f'cost, {extent.many} runs', 'cost over exact'),
    )
    return markdown_table(header, lines)


def relatives_words(rows: Rows, extent: Extent) -> str:
    """Return for each relative what it is, what it finds, when it wins and what it leaves open."""
    words = (_field_words, _dubins_words, _lattice_words, _roadmap_words, _comparison)
    return '\n'.join(f'- {say(rows, extent)}' for say in words)


def _field_words(rows: Rows, extent: Extent) -> str:
    options = RELATIVES[FIELD]
    assert isinstance(options, PotentialFieldOptions)
    maps = with_near(extent.maps)
    ahead = {
        name: [
            problem
            for problem in maps
            if _median(rows, extent, FIELD, problem, 'draws_first')
            < _median(rows, extent, name, problem, 'draws_first')
        ]
        for name in (RRT, NO_FIELD)
    }
    behind = [problem for problem in maps if problem not in ahead[NO_FIELD]]
    return (
        f'**{FIELD}** (after Yang, as the paper cites it): a step of {options.step_size:g} along '
        f'u(draw) + {options.attraction:g} u(goal) + {options.repulsion:g} (1 - d / '
        f'{options.influence:g}) u(away from the wall), u the unit vector from the nearest node '
        'that way, the last term only where the nearest wall is at a distance d below '
        f'{options.influence:g}. Formula and constants are ours, and not tuned. It needs fewer '
        f'draws than RRT on {_listed(ahead[RRT])}. Part of that is the step, which never falls '
        'short: against the same steps without a field it is ahead on '
        f'{_listed(ahead[NO_FIELD])}, not on {_listed(behind)} (medians). The goal pulls through '
        'walls: it helps where the way leads towards it, and hinders where the way leads back and '
        'forth. The first path winds as that of RRT does. RRT finds a path in the end if there is '
        'one; of this we know no such proof.'
    )


def _dubins_words(rows: Rows, extent: Extent) -> str:
    parts = []
    for name in (*DUBINS, HALVED):
        some = rows.where(algorithm=name, below=extent.many)
        is_found = np.isfinite(some.aligned('cost_final'))
        excess = some.aligned('cost_final')[is_found] / some.aligned('cost_first')[is_found] - 1.0
        text = f'{name.removeprefix("RRT-H, Dubins, ")}: {share_of(is_found)}'
        if len(excess):
            text += f', {percent(float(np.median(excess)), 1)} longer'
        parts.append(text)
    return (
        "**RRT-H, Dubins** (after Zhou, as the paper cites it): RRT-H's path becomes arcs of one "
        'radius and lines through its waypoints, the shortest over eight headings at each; '
        'waypoints of one corner may be left out, and every piece is proven clear of the walls in '
        'closed form, its chords too. Found on all maps together, and how much longer than before '
        '(median): '
        f'{"; ".join(parts)}. It wins where something cannot turn on the spot. A point can, and '
        "so can an arm's joints, whose corners the planner rounds otherwise. The heading has no "
        'jump, but the curvature has. Where no free path of that radius leads through the '
        'waypoints it is "not found", or the radius is halved in as few places as will do, up to '
        'twice in each; no other way is looked for.'
    )


def _lattice_words(rows: Rows, extent: Extent) -> str:
    parts = [
        f'{problem}: {number(coarse / exact, 4)} by {n_coarse:.0f} nodes, '
        f'{number(fine / exact, 4)} by {n_fine:.0f}'
        for problem in with_near(extent.maps)
        for exact in [exact_length(problem)]
        for coarse, fine in [_of_lattices(rows, extent, problem, 'cost_final')]
        for n_coarse, n_fine in [_of_lattices(rows, extent, problem, 'draws_total')]
    ]
    return (
        '**A***: the shortest path along eight directions, one run, since nothing is left to '
        f'chance. Over the exact shortest, spacing 5 and spacing 1: {"; ".join(parts)}. A finer '
        f'lattice finds narrower ways but no other directions: in the open up to '
        f'{OCTILE_RATIO:.4f} remains, more where walls leave no row of points at the corner that '
        'the way leads round. It wins by what it promises: the best path on its lattice, or that '
        'there is none there. Half the spacing '
        'means four times as many nodes in the plane, and sixteen times with four joints.'
    )


def _roadmap_words(rows: Rows, extent: Extent) -> str:
    parts = []
    for name in ROADMAPS:
        some = rows.where(algorithm=name, below=extent.many)
        ratios = [
            _median(rows, extent, name, problem, 'cost_final') / exact_length(problem)
            for problem in with_near(extent.maps)
        ]
        finite = [ratio for ratio in ratios if np.isfinite(ratio)]
        text = f'{name.partition(", ")[2]}: {some.found()}'
        if finite:
            text += f', {number(min(finite), 4)} to {number(max(finite), 4)}'
        parts.append(text)
    return (
        '**PRM**: all draws that see each other within the radius of PRM* are joined, then the '
        'shortest path over them is taken. Found, and medians over the exact shortest from map '
        f'to map: {"; ".join(parts)}. More draws bring it as near as one likes, slowly, as RRT*. '
        'It wins where many paths are asked for among the same walls; a wearer moves, and so '
        'would a roadmap have to be checked anew for each. With few draws a narrow way is missed.'
    )


def _comparison(rows: Rows, extent: Extent) -> str:
    shorter = [
        f'{name} on {problem}'
        for problem in with_near(extent.maps)
        for name in RELATIVES
        if _median(rows, extent, name, problem, 'cost_final')
        < _median(rows, extent, RRT_H, problem, 'cost_final')
    ]
    return f'Shorter than RRT-H in the median: {", ".join(shorter) or "none, on no map"}.'


def _median(rows: Rows, extent: Extent, name: str, problem: str, column: str) -> float:
    return rows.where(problem=problem, algorithm=name, below=extent.many).median(column)


def _of_lattices(rows: Rows, extent: Extent, problem: str, column: str) -> tuple[float, float]:
    coarse, fine = (_median(rows, extent, name, problem, column) for name in LATTICES)
    return coarse, fine


def _listed(names: Iterable[str]) -> str:
    return ', '.join(names) or 'no map'
