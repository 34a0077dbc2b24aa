# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Who hears messages rests where they come without end."""

import pytest

pytest.importorskip('rclpy')

from rclpy.node import Node  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.ros.middleware import breather  # noqa: E402
from rrth_planner.ros.middleware.open_subscription import OpenSubscription  # noqa: E402
from std_msgs.msg import Int32  # noqa: E402


@pytest.mark.usefixtures('ros_context')
def test_who_hears_may_rest_after_each_copy_of_a_message():
    node, n_heard, n_rested = Node('resting'), [], []
    try:
        heard = OpenSubscription(
            node, Int32, 'rests', lambda *_: n_heard.append(1), rest=lambda: n_rested.append(1)
        )
        data = serialize_message(Int32(data=1))
        for k in range(3):
            info = {'source_timestamp': k, 'publication_sequence_number': k}
            heard._on_live(data, info)
            # A copy that does not count takes its time, too.
            heard._on_copy(data, info, 'reliable')
        assert (len(n_heard), len(n_rested)) == (3, 6)
    finally:
        node.destroy_node()


@pytest.mark.parametrize(
    ('spacing', 'works', 'rests'),
    [
        # A body each 10 ms, one in four of which asks for much, and a flood.
        (10e-3, [1e-3], False),
        (10e-3, [10e-3, 10e-3, 10e-3, 1e-3], False),
        (0.5e-3, [0.45e-3], True),
        (0.5e-3, [0.5e-3], True),
    ],
)
def test_who_hears_rests_where_messages_come_without_end(monkeypatch, spacing, works, rests):
    now, ran, slept = [0.0], [0.0], []

    def sleep(seconds):
        now[0] += seconds
        slept.append(seconds)

    for name, function in (
        ('monotonic', lambda: now[0]),
        ('thread_time', lambda: ran[0]),
        ('sleep', sleep),
    ):
        monkeypatch.setattr(breather.time, name, function)
    rest = breather.Breather()
    for k in range(2000):
        now[0], ran[0] = now[0] + spacing, ran[0] + works[k % len(works)]
        rest()
    assert bool(slept) == rests
    # About half of the time is left to who plans.
    assert not rests or 0.4 < sum(slept) / now[0] < 0.6
