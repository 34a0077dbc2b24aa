# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A skeleton that describes no wearer is rejected in one sentence."""

import numpy as np
import pytest
from rrth_planner.model.errors import SceneError
from rrth_planner.wearer.skeleton import Direction, FrameBase, Joint, JointBase, Part, Skeleton

MARGINS = np.full((3, 2), 0.1)
UP, LEFT = Direction('up', 'a', 'b'), Direction('left', 'a', 'c')
A, B, C = (Joint(name, (name,)) for name in 'abc')
ARM = Part('arm', ('a', 'b'), MARGINS, (UP,))


def skeleton(joints=(A, B), parts=(ARM,), base=None, axes=None, names_by_id=()):
    """Return a skeleton."""
    axes = np.eye(3) if axes is None else axes
    return Skeleton(joints=joints, parts=parts, base=base, axes=axes, names_by_id=names_by_id)


def test_a_skeleton_is_a_value_that_nobody_changes():
    given = MARGINS.copy()
    part = Part('arm', ('a', 'b'), given, (UP,))
    given[0] = 7.0
    np.testing.assert_array_equal(part.margins, MARGINS)
    for array in (part.margins, FrameBase('chest', [0, 0, 0]).offset, skeleton().axes):
        assert not array.flags.writeable


@pytest.mark.parametrize(
    ('make', 'words'),
    [
        (lambda: Joint('a', ()), 'joint "a": no point, expected at least one'),
        (lambda: Joint('a', ('x', 'y'), [0, 0, 0]), 'joint "a": an offset from 2 points'),
        (lambda: Joint('a', ('x',), [0, 0, 6]), r'joint "a": offset: .*at most 5 \[m\]'),
        (lambda: Joint('a', ('x\n',)), 'joint "a": point: .*printable'),
        (lambda: Direction('top', 'a', 'b'), "axis 'top', expected one of forward, left, up"),
        (lambda: Direction('up', 'a', 'a'), 'axis up: from "a" to itself, expected two joints'),
        (lambda: Part('arm', (), MARGINS), 'part "arm": no joints, expected'),
        (lambda: Part('arm', ('a',), -MARGINS), r'part "arm": margins .*lengths >= 0.*\[m\]'),
        (lambda: Part('arm', ('a',), 0 * MARGINS), 'part "arm": margins .*one of each pair > 0'),
        (lambda: Part('arm', ('a',), [0.1]), r'part "arm": margins: shape \(1,\), expected'),
        (lambda: Part('arm', ('a',), MARGINS, (UP, UP)), 'part "arm": axes up, up, expected'),
        (lambda: Part('arm', ('a',), MARGINS, (UP,), [0, 0, 0]), 'part "arm": rest .*a direction'),
        (lambda: FrameBase('chest', [0, np.nan, 0]), r'base: offset: .*finite numbers \[m\]'),
        (lambda: JointBase('a', [0, 0, 0], (UP,)), 'base: 1 axes, expected two'),
        (lambda: skeleton((A, B, A)), 'joint "a": given twice'),
        (lambda: skeleton((A, B, Joint('base', ('x',)))), 'joint "base": given twice'),
        (lambda: skeleton(parts=(ARM, ARM)), 'part "arm": given twice'),
        (lambda: skeleton((), ()), 'parts: none, expected at least one'),
        (lambda: skeleton((A,)), 'part "arm": no joint "b", expected it among the joints'),
        (lambda: skeleton((A, B, C)), 'joint "c": used by no part and not by the base'),
        (
            lambda: skeleton(base=JointBase('a', [0, 0, 0], (UP, LEFT))),
            'base: no joint "c", expected it among the joints',
        ),
        (
            lambda: skeleton(base=JointBase('base', [0, 0, 0], (UP, Direction('left', 'b', 'a')))),
            'base: no joint "base"',
        ),
        (lambda: skeleton(axes=np.diag([1, 1, -1])), 'axes: .*expected right-handed'),
        (lambda: skeleton(axes=np.ones((3, 3))), 'axes: .*expected right-handed'),
        (lambda: skeleton(names_by_id=('x', 'x')), 'name of an id "x": given twice'),
    ],
)
def test_what_is_no_skeleton_is_rejected_in_one_sentence(make, words):
    with pytest.raises(SceneError, match=words):
        make()
