# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether bodies describe a wearer who stands still, or come as a stream."""

import pytest

pytest.importorskip('rclpy')

from rrth_planner.ros.messages.body_source import (  # noqa: E402
    after_body,
    as_stream,
    BodySource,
    has_body,
    is_stamped,
)
import samples  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402


def test_before_a_body_nothing_is_known():
    assert not BodySource().stands_still
    assert not BodySource().is_stream
    assert BodySource().time_until_known(5.0) <= 0.0
    assert as_stream(BodySource()).is_stream


def test_after_a_body_it_takes_half_a_second_until_it_is_known():
    source = after_body(True, 10.0, BodySource())
    assert source.stands_still
    assert source.time_until_known(10.2) == pytest.approx(0.3)
    assert source.time_until_known(10.5) == 0.0


def test_a_stream_is_one_for_good():
    source = after_body(False, 10.0, after_body(True, 9.0, BodySource()))
    assert source.is_stream
    assert after_body(True, 100.0, source) == BodySource(100.0, True)


def test_a_body_that_came_late_does_not_change_when_the_last_one_came():
    assert after_body(True, 9.0, BodySource(10.0)).came == 10.0


def test_a_stamp_of_any_part_is_a_measurement():
    msg = samples.wearer()
    assert not is_stamped(msg)
    msg.markers[-1].header.stamp.nanosec = 1
    assert is_stamped(msg)


def test_what_deletes_only_is_no_body():
    assert not has_body(samples.array(samples.command(Marker.DELETEALL)))
    assert has_body(samples.wearer())
