# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run as values: what counts when, and how far the arm was from the wearer."""

from collections.abc import Sequence

import numpy as np
import pytest
from rrth_planner.collision.reference_checker import least_clearance
from rrth_planner.execution.recording import (
    at,
    commanded_at,
    commanded_stops,
    CommandedMotion,
    measured_clearances,
    Recording,
    section,
)
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.errors import RecordError
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import sample, Trajectory

ARM = load_arm()
FOLDED = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])


def motion(begin, end, duration=1.0, v_begin=0.0):
    """Return a motion between two configurations, at rest at its end."""
    return Trajectory(
        times=[0.0, duration],
        positions=[begin, end],
        velocities=[np.full(4, v_begin), np.zeros(4)],
        accelerations=np.zeros((2, 4)),
    )


def seen(n=50, **fields):
    """Return a recording of an arm on a straight path for a second."""
    times = np.linspace(0.0, 1.0, n)
    q = FOLDED + np.outer(times, [0.5, -0.5, 0.3, 0.2])
    return Recording(times=times, positions=q, velocities=np.zeros((n, 4)), **fields)


def scene(*centers):
    """Return a wearer of cubes."""
    return Scene(
        tuple(Box(f'{k}', center, [0.3, 0.2, 0.4], np.eye(3)) for k, center in enumerate(centers))
    )


def test_the_motion_that_began_last_counts_and_its_end_is_held():
    first, second = motion(FOLDED, FOLDED + 0.4), motion(FOLDED + 0.2, FOLDED, v_begin=0.3)
    recording = seen(commanded=(CommandedMotion(0.1, first), CommandedMotion(0.5, second)))
    q, v = commanded_at(recording, np.array([0.0, 0.3, 0.5, 0.9, 1.5, 9.0]))
    assert np.isnan(q[0]).all()
    assert np.isnan(v[0]).all()
    np.testing.assert_array_equal(q[1], sample(first, [0.3 - 0.1])[0][0])
    np.testing.assert_array_equal(q[2], second.positions[0])
    np.testing.assert_array_equal(v[3], sample(second, [0.9 - 0.5])[1][0])
    np.testing.assert_allclose(q[4:], [FOLDED, FOLDED], atol=1e-12)
    np.testing.assert_array_equal(v[5], np.zeros(4))


def test_the_distance_is_the_one_to_the_wearer_of_that_time():
    # Far enough that nothing collides: what is inside a box is signed otherwise.
    bodies = (scene([0.4, 0.5, 0.3]), scene([-0.5, 0.7, 0.9], [1.5, 0.0, 0.1]))
    recording = seen(bodies=((0.2, bodies[0]), (0.6, bodies[1])))
    found = measured_clearances(recording, ARM, 0.4)
    for time, q, clearance in zip(recording.times, recording.positions, found, strict=True):
        if time < 0.2:
            assert np.isnan(clearance)
            continue
        body = bodies[0] if time < 0.6 else bodies[1]
        expected = least_clearance(ARM, body, q[None], 0.4)
        assert expected > 0.0
        assert clearance == pytest.approx(expected, abs=1e-6)


def test_nobody_there_is_no_distance():
    assert np.isnan(measured_clearances(seen(bodies=((0.0, Scene(())),)), ARM, 1.0)).all()


def test_a_stop_begins_in_motion_while_the_monitor_is_stopping():
    plain = CommandedMotion(0.0, motion(FOLDED, FOLDED + 0.4))
    turn = CommandedMotion(0.5, motion(FOLDED + 0.2, FOLDED, v_begin=0.3))
    stop = CommandedMotion(2.0, motion(FOLDED, FOLDED + 0.05, v_begin=0.3))
    again = CommandedMotion(2.1, motion(FOLDED + 0.05, FOLDED))
    recording = seen(
        commanded=(plain, turn, stop, again),
        monitor_states=((0.0, 'monitoring'), (2.05, 'stopping'), (2.2, 'holding')),
    )
    assert commanded_stops(recording) == (stop,)
    assert commanded_stops(seen(commanded=(plain, turn, stop))) == ()


def test_what_was_the_case_is_what_came_last():
    changes = [(1.0, 'a'), (2.0, 'b')]
    assert [at(changes, t) for t in (0.5, 1.0, 1.9, 2.0, 9.0)] == [None, 'a', 'a', 'b', 'b']
    assert at([], 1.0) is None


class Counted(Sequence):
    """A sequence that counts its accesses."""

    def __init__(self, items):
        """Begin at 0."""
        self._items, self.n_looks = items, 0

    def __len__(self):
        """Return how many items there are."""
        return len(self._items)

    def __getitem__(self, index):
        """Return an item."""
        self.n_looks += 1
        return self._items[index]


def test_of_many_changes_few_are_looked_at():
    changes = Counted([(float(k), k) for k in range(20_000)])
    assert at(changes, 12_345.5) == 12_345
    assert changes.n_looks < 20


def test_a_section_keeps_its_times_and_what_led_to_it():
    commanded = (CommandedMotion(0.0, motion(FOLDED, FOLDED + 0.4)),)
    part = section(seen(commanded=commanded), 0.25, 0.75)
    assert part.times[0] >= 0.25
    assert part.times[-1] <= 0.75
    assert len(part.times) == len(part.positions) == len(part.velocities) == 24
    assert part.commanded == commanded
    with pytest.raises(RecordError, match=r'from 3 to 4, expected times between 0\.00 and 1\.00'):
        section(seen(), 3.0, 4.0)


@pytest.mark.parametrize(
    'fields',
    [
        {'times': []},
        {'times': [0.0, 0.0]},
        {'times': [0.0, 1.0, 2.0]},
        {'positions': np.full((2, 4), np.nan)},
        {'velocities': np.zeros((2, 3))},
    ],
)
def test_what_is_no_run_is_rejected(fields):
    good = {'times': [0.0, 1.0], 'positions': np.zeros((2, 4)), 'velocities': np.zeros((2, 4))}
    Recording(**good)
    with pytest.raises(RecordError):
        Recording(**{**good, **fields})
