# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of messages: each counts once, and what a publisher sent last stays last."""

import pytest

pytest.importorskip('rclpy')

from hypothesis import given, strategies as st  # noqa: E402
from rrth_planner.ros.subscriptions import DuplicateFilter  # noqa: E402


def test_a_copy_counts_once_whichever_comes_first():
    copies = DuplicateFilter()
    assert copies.counts_live((10, 1))
    assert not copies.counts_reliable((10, 1))
    assert copies.counts_reliable((20, 2))
    assert not copies.counts_live((20, 2))


def test_a_latched_message_of_a_late_publisher_counts():
    copies = DuplicateFilter()
    assert copies.counts_live((100, 7))
    assert copies.counts_reliable((50, 1))


@given(
    st.integers(1, 12).flatmap(
        lambda n: st.tuples(st.just(n), st.sets(st.integers(1, n)), st.randoms())
    )
)
def test_the_last_message_of_a_publisher_is_applied_last(case):
    n, lost, random = case
    # Live copies, some lost, and all reliable ones, each stream in its order, mixed at random.
    live = [(10 * k, k) for k in range(1, n + 1) if k not in lost]
    reliable = [(10 * k, k) for k in range(1, n + 1)]
    copies, applied = DuplicateFilter(), []
    while live or reliable:
        if live and (not reliable or random.random() < 0.5):
            stamp = live.pop(0)
            counts = copies.counts_live(stamp)
        else:
            stamp = reliable.pop(0)
            counts = copies.counts_reliable(stamp)
        if counts:
            applied.append(stamp[1])
    assert applied[-1] == n
    assert set(applied) == set(range(1, n + 1))
