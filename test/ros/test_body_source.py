# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether bodies describe a wearer who stands still, by stamps, times and numbers of messages."""

import pytest

pytest.importorskip('rclpy')

from rrth_planner.ros.messages.body_source import (  # noqa: E402
    after_body,
    as_stream,
    BodySource,
    has_body,
    is_description,
)
import samples  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402


def stamped():
    """Return a body whose head alone has a stamp."""
    msg = samples.wearer()
    msg.markers[-1].header.stamp.nanosec = 1
    return msg


def after(*bodies):
    """Return the source after bodies, each (message, number, time of arrival)."""
    source = BodySource()
    for msg, number, came in bodies:
        source = after_body(msg, (int(1e9 * came), number), came, source)
    return source


def test_before_a_body_nothing_is_known():
    assert not BodySource().stands_still
    assert not BodySource().is_stream
    assert BodySource().time_until_known(5.0) <= 0.0
    assert as_stream(BodySource()).is_stream


def test_after_a_body_it_takes_half_a_second_until_it_is_known():
    source = after((samples.wearer(), 1, 10.0))
    assert source.stands_still
    assert source.time_until_known(10.2) == pytest.approx(0.3)
    assert source.time_until_known(10.5) == 0.0


@pytest.mark.parametrize(
    ('number', 'came', 'is_still'),
    [
        (2, 11.01, True),
        (2, 11.0, False),
        (2, 10.03, False),
        # Another publisher's first one.
        (1, 10.03, True),
        # Not every middleware numbers messages.
        (None, 10.03, False),
        (None, 11.01, True),
        # One that came late.
        (7, 9.9, False),
    ],
)
def test_another_body_is_a_description_or_one_of_a_stream(number, came, is_still):
    source = after((samples.wearer(), 1, 10.0), (samples.wearer(), number, came))
    assert source.stands_still == is_still
    assert source.is_stream != is_still
    assert source.came == max(came, 10.0)


def test_a_stream_is_one_for_good():
    source = after((samples.wearer(), 1, 10.0), (samples.wearer(), 2, 10.03))
    later = after_body(samples.wearer(), (0, 1), 100.0, source)
    assert later.is_stream
    assert is_description(samples.wearer(), (0, 1), 100.0, source)


def test_a_stamp_of_any_part_is_a_measurement():
    assert after((stamped(), 1, 10.0)).is_stream


def test_what_deletes_only_is_no_body():
    assert not has_body(samples.array(samples.command(Marker.DELETEALL)))
    assert has_body(samples.wearer())
