# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Lines that say how far the parts of a body get: their table, their texts, and joining them."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.model.body_reach import (
    BODY_REACH,
    check_lines,
    joined,
    KNOWN_FOR,
    least_lines,
    lines_of_text,
    lines_shown,
)
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.separation import BODY_SPEEDS

TIMES = np.concatenate([np.linspace(0.0, 3.0, 301), [10.0, 1000.0]])
NUMBERS = st.floats(0.0, 10.0, allow_subnormal=False)
LINES = st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=5)


def least(lines, times=TIMES):
    """Return the least of lines at some times, (n,) [m]."""
    c, w = np.array(lines).T
    return (c + w * times[:, None]).min(axis=1)


@given(LINES)
def test_lines_that_are_left_out_are_least_at_no_time(lines):
    found = least_lines(lines)
    assert (least(found) == least(lines)).all()
    offsets, speeds = np.array(found).T
    assert (np.diff(offsets) > 0.0).all()
    assert (np.diff(speeds) < 0.0).all()


@given(LINES, LINES)
def test_joined_lines_are_below_neither_of_the_two_sets(some, others):
    found = least(joined(some, others))
    assert (found >= np.maximum(least(some), least(others)) * (1.0 - 1e-12)).all()
    # And no higher than steeper ones from a greater offset.
    assert found[0] <= max(least(some)[0], least(others)[0])
    assert joined(some, [(0.0, 0.0)]) == least_lines(some)


@given(LINES)
def test_a_text_of_lines_is_read_as_they_are(lines):
    lines = tuple((round(c, 3), round(w, 3)) for c, w in lines)
    assert lines_of_text(lines_shown(lines)) == lines


@pytest.mark.parametrize(
    'text, lines',
    [
        ('3.6 t', ((0.0, 3.6),)),
        (' 3.6t ,.21+1.45t,  4e-1 + 7.5e-1 t', ((0.0, 3.6), (0.21, 1.45), (0.4, 0.75))),
        ('0 + 2 t', ((0.0, 2.0),)),
    ],
)
def test_a_text_may_be_written_in_several_ways(text, lines):
    assert lines_of_text(text) == lines


@pytest.mark.parametrize('text', ['', '2', 't', '2 t +', '2 t 3 t', '-2 t', '1 - 2 t', 'nan t'])
def test_what_is_no_line_is_rejected(text):
    with pytest.raises(ValueError):
        lines_of_text(text)


@pytest.mark.parametrize(
    'lines, sentence',
    [
        (((0.1, 2.0),), '"hand: 0.1 \\+ 2 t", expected one of its lines without c'),
        (((0.0, 101.0),), 'w from 0 to 100'),
        (((0.0, 1.0), (11.0, 0.0)), 'c from 0 to 10 '),
        (((float('nan'), 1.0), (0.0, 1.0)), 'c from 0 to 10 '),
        ((), 'expected one of its lines'),
    ],
)
def test_lines_that_no_part_has_are_rejected_in_a_sentence(lines, sentence):
    with pytest.raises(OptionsError, match=sentence):
        check_lines('hand', lines)


def test_the_table_has_a_greatest_speed_first_and_lines_that_each_count():
    for words, lines in BODY_REACH:
        check_lines(words, lines)
        assert least_lines(lines) == lines
        assert lines[0][0] == 0.0


def test_any_other_part_may_be_any_of_them():
    others = least(dict(BODY_REACH)[''])
    assert all((others >= least(lines) - 1e-12).all() for _, lines in BODY_REACH)


def test_legs_get_no_less_far_than_at_their_stated_speeds():
    speeds = dict(BODY_SPEEDS)
    for words, lines in BODY_REACH:
        if words in ('thigh', 'shin', 'foot'):
            assert (least(lines) >= speeds[words] * TIMES).all()


# What the bounds contained 99.99 % of, 0.1, 0.2 and 0.3 s after a sight [m]: CMU 62_01, 07, 13.
@pytest.mark.parametrize(
    'words, ways',
    [
        ('head', (0.11, 0.14, 0.15)),
        ('neck', (0.04, 0.05, 0.06)),
        ('upper arm', (0.20, 0.24, 0.26)),
        ('forearm', (0.25, 0.40, 0.48)),
        ('hand', (0.31, 0.50, 0.59)),
        ('pelvis', (0.11, 0.16, 0.18)),
        ('thigh', (0.29, 0.42, 0.44)),
        ('shin', (0.44, 0.75, 0.91)),
    ],
)
def test_the_table_is_above_what_was_measured(words, ways):
    found = least(dict(BODY_REACH)[words], np.array([0.1, 0.2, 0.3]))
    # They were rounded to centimetres.
    assert (found >= np.array(ways) - 0.005).all()
    assert KNOWN_FOR > 2.0
