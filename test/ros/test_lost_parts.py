# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Parts that are missing: lost, removed, or replaced by another description."""

import pytest

pytest.importorskip('rclpy')

from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.body_publishers import (  # noqa: E402
    BodyPublishers,
    LONGEST_PAUSE,
)
from rrth_planner.ros.messages.marker_edits import read_edits  # noqa: E402
from rrth_planner.ros.messages.marker_order import MarkerOrder  # noqa: E402
from samples import array, box, command  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402

ALL = command(Marker.DELETEALL)
TORSO, HAND = box('torso'), box('hand', center=(0.5, 0.0, 0.0), size=(0.1, 0.1, 0.1))
KEPT = 2.0


def stamped(marker, stamp):
    """Return a copy of a marker that was measured at a time [s]."""
    copy = box(marker.ns, marker.id)
    copy.pose, copy.scale = marker.pose, marker.scale
    copy.header.stamp.sec, rest = divmod(round(stamp * 10**9), 10**9)
    copy.header.stamp.nanosec = rest
    return copy


def edits(*markers, now=0.0):
    """Return the edits of an array."""
    return read_edits(array(*markers), now, 'torso')


class Tracker:
    """Bodies that one publisher sends, and what is known of the wearer by them."""

    def __init__(self):
        """Begin with nothing."""
        self.body, self.order, self.publishers = WearerBody(), MarkerOrder(), BodyPublishers()
        self.n = 0

    def send(self, now, *markers, keep_removed=0.0, newer=None, number=None):
        """Send an array at a time [s]; return which parts are there, and which are lost."""
        self.n += 1
        found, sent = edits(*markers, now=now), (self.n, number or self.n)
        self.body = self.order.apply(
            self.body,
            found,
            sent,
            now,
            newer and (lambda other: other[0] in newer),
            is_description=self.publishers.is_description(array(*markers), sent, now),
            keep_removed=keep_removed,
        )
        return self.at(now)

    def at(self, now):
        """Return which parts are there at a time [s], and which are lost."""
        body = self.body.at(now)
        return [[key[0] for key, _ in parts] for parts in (body.parts, body.lost)]


def test_a_part_that_a_stream_leaves_out_is_lost_until_it_is_seen_again():
    for measured in (lambda marker, now: marker, stamped):
        tracker = Tracker()
        for k in range(3):
            now = 10.0 + k / 60.0
            tracker.send(now, ALL, measured(TORSO, now), measured(HAND, now))
        seen = {key[0]: part.measured for key, part in tracker.body.parts}['hand']
        for k in range(3, 600):
            now = 10.0 + k / 60.0
            assert tracker.send(now, ALL, measured(TORSO, now)) == [['torso'], ['hand']]
        ((_, part),) = tracker.body.lost
        # It is as old as it is, and where it was.
        assert part.measured == seen
        assert part.boxes[0].center.tolist() == [0.5, 0.0, 0.0]
        assert part.expires == pytest.approx(10.0 + 3 / 60.0)
        assert [b.name for b in scene_of(tracker.body).boxes] == ['torso/0', 'hand/0']
        now += 1.0 / 60.0
        assert tracker.send(now, ALL, measured(HAND, now)) == [['hand'], ['torso']]


def test_a_part_that_a_stream_leaves_out_of_its_ns_is_lost_and_others_stay():
    tracker = Tracker()
    tracker.send(0.0, TORSO, box('left'), box('left', 1))
    found = tracker.send(0.1, command(Marker.DELETEALL, 'left'), box('left', 1))
    assert found == [['torso', 'left'], ['left']]
    assert tracker.body.lost[0][0] == ('left', 0)


def test_nothing_that_is_seen_at_all_does_not_clear_the_wearer():
    tracker = Tracker()
    tracker.send(0.0, ALL, TORSO, HAND)
    assert tracker.send(0.1, ALL) == [[], ['torso', 'hand']]
    # Nor does the next sight of a part of him.
    assert tracker.send(0.2, ALL, TORSO) == [['torso'], ['hand']]


def test_another_description_leaves_nothing_of_the_one_before():
    tracker = Tracker()
    tracker.send(0.0, ALL, TORSO, HAND)
    assert tracker.send(1.5, ALL, TORSO, box('hat')) == [['torso', 'hat'], []]
    # Of another publisher, whose first it is.
    assert tracker.send(1.6, ALL, HAND, number=1) == [['hand'], []]
    # It has measured nothing, so it says nothing of what was.
    tracker.send(1.7, stamped(TORSO, 1.7))
    assert tracker.send(5.0, ALL, HAND) == [['hand'], ['torso']]


def test_a_description_clears_what_a_stream_without_stamps_has_lost():
    tracker = Tracker()
    tracker.send(0.0, ALL, TORSO, HAND)
    assert tracker.send(0.5, ALL, TORSO) == [['torso'], ['hand']]
    assert tracker.send(2.0, ALL, TORSO) == [['torso'], []]


def test_what_is_deleted_is_gone_at_once_or_while_a_motion_runs_after_a_while():
    tracker = Tracker()
    tracker.send(0.0, TORSO, HAND)
    assert tracker.send(0.1, command(Marker.DELETE, 'hand')) == [['torso'], []]
    tracker.send(0.2, HAND)
    # A driver deletes it again and again.
    for now in (0.3, 0.4, 2.2):
        gone = command(Marker.DELETE, 'hand')
        assert tracker.send(now, gone, keep_removed=KEPT) == [['torso'], ['hand']]
    assert tracker.at(0.3 + KEPT - 0.01) == [['torso'], ['hand']]
    assert tracker.at(0.3 + KEPT + 0.01) == [['torso'], []]
    # Seen again it is there, and no longer going.
    tracker.send(2.25, HAND)
    assert tracker.at(9.0) == [['torso', 'hand'], []]
    # Once the motion is over.
    tracker.send(9.0, command(Marker.DELETE, 'hand'), keep_removed=KEPT)
    assert tracker.send(9.1, command(Marker.DELETE, 'hand')) == [['torso'], []]


def test_a_lost_part_that_is_deleted_while_a_motion_runs_is_gone_after_a_while():
    tracker, hand = Tracker(), box('hand')
    hand.lifetime.nanosec = 10**8
    tracker.send(0.0, TORSO, hand)
    assert tracker.at(0.5) == [['torso'], ['hand']]
    tracker.send(0.5, command(Marker.DELETE, 'hand'), keep_removed=KEPT)
    # It has been lost since then.
    assert tracker.body.lost[0][1].expires == pytest.approx(0.1)
    assert tracker.at(0.5 + KEPT + 0.01) == [['torso'], []]


def test_what_a_description_replaces_while_a_motion_runs_stays_for_a_while():
    tracker = Tracker()
    tracker.send(0.0, ALL, TORSO, HAND)
    assert tracker.send(3.0, ALL, TORSO, keep_removed=KEPT) == [['torso'], ['hand']]
    assert tracker.at(3.0 + KEPT + 0.01) == [['torso'], []]


def test_a_late_body_loses_only_what_newer_ones_have_not_seen():
    tracker = Tracker()
    tracker.send(0.0, ALL, TORSO, HAND)
    tracker.send(0.1, TORSO)
    # Sent between these two.
    found = tracker.send(0.2, ALL, box('hat'), newer={2})
    assert found == [['torso', 'hat'], ['hand']]


def test_a_body_that_follows_within_a_second_is_a_stream_whoever_may_have_sent_it():
    bodies, plain = BodyPublishers(), array(ALL, TORSO)
    assert bodies.is_description(plain, (0, 1), 0.0)
    assert not bodies.is_description(plain, (0, 2), LONGEST_PAUSE)
    assert bodies.is_description(plain, (0, 3), 2.0 * LONGEST_PAUSE + 0.01)
    # The first of another publisher, and one whose number nobody can have reached.
    assert bodies.is_description(plain, (0, 1), 2.5)
    assert not bodies.is_description(plain, (0, 900), 2.6)
    # Not every middleware counts.
    assert not bodies.is_description(plain, (0, None), 2.7)
    assert not bodies.is_description(plain, (0, 1), 2.8)
    assert bodies.is_description(plain, (0, None), 4.0)


def test_what_has_no_box_begins_no_stream():
    bodies, none = BodyPublishers(), array(ALL)
    assert bodies.is_description(none, (0, 1), 0.0)
    assert bodies.is_description(array(TORSO), (0, 2), 0.1)
    assert not bodies.is_description(none, (0, 3), 0.2)


def test_a_body_with_a_stamp_is_no_description():
    bodies = BodyPublishers()
    assert not bodies.is_description(array(stamped(TORSO, 1.0)), (0, 1), 1.0)
    # What follows it belongs to its stream, with a stamp or not.
    assert not bodies.is_description(array(TORSO), (0, 2), 1.5)
    mixed = array(TORSO, stamped(HAND, 9.0))
    assert not bodies.is_description(mixed, (0, 3), 9.0)
    assert bodies.is_description(array(TORSO), (0, 4), 19.0)
