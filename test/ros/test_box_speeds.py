# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Each box has the speed that its own messages tell, in whatever arrays they come."""

import numpy as np
import pytest

pytest.importorskip('rclpy')

from builtin_interfaces.msg import Duration  # noqa: E402
from rrth_planner.ros.box_speeds import BoxSpeeds, HELD, MOST_AGE  # noqa: E402
from rrth_planner.ros.messages import WearerBody  # noqa: E402
import samples  # noqa: E402

MOST = 2.0
# Of the hand, and of the head [m/s].
HAND, HEAD = 0.5, -1.0


def _hand(time, **more):
    return samples.box('hand', center=(1.0 + HAND * time, 0.0, 0.0), **more)


def _head(time, **more):
    return samples.box('head', 7, center=(0.0, 0.0, 1.0 + HEAD * time), **more)


def _heard(*arrays):
    """Return the speeds after each of some arrays, each (time [s], markers), by ns."""
    body, speeds, found = WearerBody(), BoxSpeeds(), []
    for time, *markers in arrays:
        body = body.apply(samples.array(*markers), time, 'torso').at(time)
        row = (speeds.look(body, time, MOST) or (None,))[0]
        names = [f'{ns}/{k}' for (ns, k), part in body.parts for _ in part.boxes]
        found.append(None if row is None else dict(zip(names, row, strict=True)))
    return found


def test_two_messages_tell_the_speeds():
    first, second = _heard((0.0, _hand(0.0), _head(0.0)), (0.1, _hand(0.1), _head(0.1)))
    assert first is None
    assert second == pytest.approx({'hand/0': 0.5, 'head/7': 1.0})


def test_a_box_keeps_its_speed_while_others_are_spoken_of():
    arrays = [(0.0, _hand(0.0), _head(0.0))]
    for k in range(1, 4):
        arrays += [(0.1 * k, _hand(0.1 * k)), (0.1 * k + 0.01, _head(0.1 * k + 0.01))]
    assert _heard(*arrays)[-1] == pytest.approx({'hand/0': 0.5, 'head/7': 1.0})
    assert _heard(*arrays)[-2] == pytest.approx({'hand/0': 0.5, 'head/7': 1.0})


def test_boxes_of_one_text_are_not_taken_for_each_other():
    # Where one was the other is a moment later.
    one = samples.box('arm', 0, center=(0.0, 0.0, 0.0), text='arm')
    other = samples.box('arm', 1, center=(0.1, 0.0, 0.0), text='arm')
    moved = samples.box('arm', 0, center=(0.1, 0.0, 0.0), text='arm')
    _, found = _heard((0.0, one, other), (0.1, moved, other))
    assert found == pytest.approx({'arm/0': 1.0, 'arm/1': 0.0})


def test_a_box_that_was_not_there_may_be_as_fast_as_any():
    _, came, again = _heard((0.0, _head(0.0)), (0.1, _hand(0.1)), (0.2, _hand(0.2)))
    assert came == pytest.approx({'head/7': 0.0, 'hand/0': MOST})
    assert again['hand/0'] == pytest.approx(0.5)


def test_a_box_that_was_gone_for_a_while_is_new():
    *_, found = _heard(
        (0.0, _hand(0.0, lifetime=Duration(nanosec=10**8)), _head(0.0)),
        (0.2, _head(0.2)),
        (0.3, _hand(0.3)),
    )
    assert found == pytest.approx({'head/7': 1.0, 'hand/0': MOST})


def test_the_same_body_tells_of_no_other_speed():
    body, speeds = WearerBody(), BoxSpeeds()
    for time in (0.0, 0.1):
        body = body.apply(samples.array(_hand(time)), time, 'torso')
        speeds.look(body, time, MOST)
    assert np.allclose(speeds.look(body, 0.101, MOST), [[0.5], [0.001]])
    assert np.allclose(speeds.look(body, 0.2, 0.3), [[0.3], [0.1]])
    # What nobody speaks of does not count as older and older.
    assert np.allclose(speeds.look(body, 9.0, MOST), [[0.5], [MOST_AGE]])
    # Where they do not count nothing is remembered.
    assert speeds.look(body, 9.1, 0.0) is None
    assert speeds.look(body, 9.2, MOST) is None


def test_a_tracker_that_repeats_itself_does_not_make_a_hand_stand_still():
    # At 50 Hz, but it sees the hand ten times a second.
    arrays = [(0.02 * k, _hand(0.1 * (k // 5))) for k in range(30)]
    found = [row['hand/0'] for row in _heard(*arrays)[6:]]
    assert min(found) >= 0.5
    # Once it has stood still for a while it does.
    still = [(0.6 + 0.02 * k, _hand(0.5)) for k in range(30)]
    rows = _heard(*arrays, *still)[30:]
    assert rows[2]['hand/0'] >= 0.5
    assert all(row['hand/0'] == 0.0 for row in rows[int(HELD / 0.02) + 2 :])


def test_a_hand_that_becomes_faster_is_as_fast_at_once():
    places = {0.0: 0.0, 0.1: 0.02, 0.2: 0.12, 0.3: 0.13}
    hands = [(t, samples.box('hand', center=(x, 0.0, 0.0))) for t, x in places.items()]
    assert [row['hand/0'] for row in _heard(*hands)[1:]] == pytest.approx([0.2, 1.0, 1.0])
