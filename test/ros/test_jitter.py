# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How steadiness is measured: by figures of known times, and with a playback for a moment."""

import numpy as np
import pytest

pytest.importorskip('rclpy')

from benchmarks.jitter import (
    __main__ as jitter,  # noqa: E402
    report,  # noqa: E402
)
from rrth_planner.model.trajectory import sample  # noqa: E402


def test_intervals_are_compared_with_the_period():
    times = np.arange(101) * 0.01
    times[50] += 0.002
    figures = jitter._steadiness(np.delete(times, [70, 71]), 100.0)
    assert figures['p50'] == pytest.approx(0.0, abs=1e-9)
    assert figures['max'] == pytest.approx(20.0)
    assert figures['missed'] == 2.0
    assert figures['intervals'] == 98.0


def test_a_position_that_is_late_for_its_stamp_is_seen():
    swings = jitter._swings(np.zeros(4), 6.0)
    assert swings.duration >= 6.0
    stamps = np.arange(0.0, 6.0, 0.002)
    late = np.where(np.arange(len(stamps)) == 300, 0.0005, 0.0)
    q = sample(swings, stamps + late)[0][:, 0]
    figures = jitter._time_errors(np.stack([stamps, stamps + 0.3, q], axis=1), swings)
    assert figures['p99'] < 1e-3
    assert figures['max'] == pytest.approx(0.5, abs=1e-3)


def test_the_page_has_a_line_for_each_figure():
    figures = {
        'published': {'p50': 0.05, 'p99': 0.2, 'max': 1.0, 'missed': 3.0, 'intervals': 98.0}
    }
    moving = {**figures, 'positions': {'p99': 0.1, 'max': 0.4}}
    text = report.page({100.0: {'idle': figures, 'moving': moving}}, 'python -m x', 60.0)
    assert 'Written by `python -m x`; do not edit.' in text
    assert '| 100 | idle | published | 0.050 | 0.200 | 1.000 | 3 | 98 |' in text
    assert '| 100 | moving | positions | – | 0.100 | 0.400 | – | – |' in text


@pytest.mark.slow
def test_a_playback_is_measured_at_rest_and_in_motion(monkeypatch):
    monkeypatch.setattr(jitter, 'SWING', 1.2)
    monkeypatch.setattr(jitter, 'REACH', 0.3)
    figures = jitter.measure(100.0, 1.2)
    assert list(figures) == ['no arm', 'idle', 'moving']
    for arm in ('idle', 'moving'):
        for by in ('published', 'received'):
            assert figures[arm][by]['intervals'] > 50
    assert figures['moving']['positions']['p99'] < 5.0
