# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How the ray came to cross a part is told from what moved first."""

import numpy as np
import pytest
from rrth_planner.rehearsal.ray_time import (
    CAME,
    CAME_AT_REST,
    CAME_AT_THE_END,
    seconds_by_class,
    WENT_IN,
)

PERIOD = 0.05


def of(text):
    """Return booleans of a text of `x` and `.`."""
    return np.array([letter == 'x' for letter in text])


@pytest.mark.parametrize(
    ('moving', 'crossed', 'went_in', 'found'),
    [
        ('..xxxxxxxx', '.xxxx.....', '..........', {CAME_AT_REST: 3 * PERIOD}),
        ('xxxx......', '..xxxx....', '..........', {CAME_AT_THE_END: 2 * PERIOD}),
        # Within 0.15 s after the part has left.
        ('xxxxxx....', '..xx......', '..........', {CAME_AT_THE_END: 2 * PERIOD}),
        ('xxxxxxxxxx', '..xx......', '..........', {CAME: 2 * PERIOD}),
        ('xxxxxxxxxx', '..xx......', '..x.......', {WENT_IN: 2 * PERIOD}),
        ('xxxx......', '..xxxx....', '..x.......', {WENT_IN: 2 * PERIOD}),
        ('..........', '..xxxx....', '..........', {}),
        ('xxxxxxxxxx', '..........', '..........', {}),
        ('xxxxxxxxxx', 'x........x', 'x.........', {WENT_IN: PERIOD, CAME: PERIOD}),
    ],
)
def test_time_across_a_part_is_of_the_class_of_its_beginning(moving, crossed, went_in, found):
    seconds = seconds_by_class(of(moving), of(crossed), of(went_in), PERIOD)
    assert seconds == pytest.approx(found)
