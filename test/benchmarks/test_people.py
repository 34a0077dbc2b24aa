# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Goals that the wearer takes are told from those that were missed."""

import numpy as np
import pytest

pytest.importorskip('tqdm')

from benchmarks.people.__main__ import line_of, ray_lines
from benchmarks.people.beside import Row, row_of, scenarios
from benchmarks.people.taken import Goals
from rrth_planner.rehearsal.contacts import FAST
from rrth_planner.rehearsal.ray_time import CLASSES, WENT_IN

TARGET = np.array([1.2, 0.0, -0.3])
FAR, NEAR = [9.0, 9.0, 9.0], [1.2, 0.0, -0.3]


class Barrier:
    """A box that is round the target but for a time; a part that is always lost beside it."""

    names = ('hand', 'foot')

    def __init__(self, leaves, returns):
        self.leaves, self.returns = leaves, returns

    def rows_at(self, time):
        """Return where it is."""
        place = FAR if self.leaves <= time < self.returns else NEAR
        row = np.concatenate([place, [0.4] * 3, np.eye(3).ravel()])
        return np.stack([row, np.full(15, np.nan)])


@pytest.mark.parametrize(
    ('leaves', 'returns', 'is_taken'),
    [
        (90.0, 90.0, True),
        (0.0, 99.0, False),
        (11.0, 13.05, False),
        # Free for 1.6 s only; from the last second of its six on.
        (11.0, 12.65, True),
        (15.0, 99.0, True),
    ],
)
def test_a_goal_is_taken_unless_it_is_free_for_two_seconds_in_a_row(leaves, returns, is_taken):
    goals = Goals(Barrier(leaves, returns))
    assert goals.is_free(TARGET, leaves - 0.01) == (leaves == 0.0 and is_taken)
    assert goals.is_taken(TARGET, 10.0, 16.0) == is_taken


def test_each_person_is_rehearsed_with_each_size_of_hands_and_the_same_targets():
    found = scenarios(['a/tum_x.bvh'], 2, 30.0, '10/400', 5, (0.2, 0.0))
    assert len(found) == 2 * 2 * 2 * 2
    by_size = {0.2: [], 0.0: []}
    for one in found:
        by_size[one.recorded.hand_size].append((one.about, one.recorded.rate, one.seed))
    assert by_size[0.2] == by_size[0.0]
    assert len(set(by_size[0.2])) == 8
    assert {one.separation.stop_jerk for one in found} == {400.0}


def test_a_run_says_what_was_taken_and_how_the_ray_came_across():
    row = row_of(scenarios([], 1, 8.0, '4/40', 3, (0.2,))[0])
    assert row.n_requests >= row.n_aimed >= row.n_aimed_taken
    assert row.n_taken >= row.n_aimed_taken
    assert set(row.ray) <= set(CLASSES)
    total = Row('all', 1.0, 0.2)
    total.add(row)
    total.add(Row('b', 1.0, 0.2, 232.0, 1.0, 10, 5, 4, 1, ray={WENT_IN: 0.5}))
    total.contacts[FAST, False] += 1
    cells = [cell.strip() for cell in line_of(total).split('|')[1:-1]]
    assert cells[:4] == ['all', '1', '0.2', '240']
    assert cells[4].startswith(f'{row.n_taken + 4} ')
    n_free = row.n_requests - row.n_taken + 6
    assert cells[5].startswith(f'{row.n_aimed - row.n_aimed_taken + 4} of {n_free} ')
    assert cells[6].startswith(f'{row.n_aimed + 5} of {row.n_requests + 10} ')
    across = row.ray.get(WENT_IN, 0.0) + 0.5
    assert f'{across:.2f}' in ray_lines([total])[-1]
