# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far parts get is measured as it should be, and lines are above it."""

import ast
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('tqdm')

from benchmarks.reach.__main__ import default_of, longest_time, main, table_of
from benchmarks.reach.containment import containment, corners_of, reaches, ways
from benchmarks.reach.lines import growth, least_steps, lines_above, needed, steepened, STEEPER
from benchmarks.reach.making import judged, Making
from benchmarks.reach.people import FRAMES, measured, persons_of, STATED, Take
from hypothesis import given, strategies as st
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.person_file import write_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.wearer.recorded_person import excerpt
from worlds import examples

TIMES = np.arange(1, 61) / FRAMES


def turn(axis, angle):
    """Return a rotation about an axis."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def row(center, size, rotation):
    """Return the numbers of a box."""
    return np.concatenate([center, size, rotation.ravel()])


def random_row(rng):
    """Return a box of any size anywhere near."""
    rotation = turn(rng.standard_normal(3), rng.uniform(0, np.pi))
    return row(rng.uniform(-0.3, 0.3, 3), rng.uniform(0.02, 0.5, 3), rotation)


def furthest(points, box):
    """Return how far the furthest of points is from a box, by their nearest points in it."""
    R, half = box[6:].reshape(3, 3), box[3:6] / 2
    nearest = box[:3] + np.clip((points - box[:3]) @ R, -half, half) @ R.T
    return np.linalg.norm(points - nearest, axis=1).max()


@examples(100)
@given(st.integers(0, 2**32 - 1))
def test_a_box_holds_another_one_once_it_is_grown_by_the_containment_and_not_before(seed):
    rng = np.random.default_rng(seed)
    before, after = random_row(rng), random_row(rng)
    found = containment(before[None], after[None])[0]
    share = rng.uniform(-0.5, 0.5, (2000, 3))
    inside = after[:3] + (share * after[3:6]) @ after[6:].reshape(3, 3).T
    assert furthest(inside, before) <= found + 1e-12
    corner = furthest(corners_of(after[None])[:, :, 0].T, before)
    assert found == pytest.approx(corner, abs=1e-12)
    assert found <= ways(before[None], after[None])[0] + 1e-12


def test_a_box_that_is_moved_across_a_face_gets_out_by_as_much():
    before = row([0.1, 0.2, 0.3], [0.2, 0.1, 0.4], turn([1, 2, 3], 0.7))
    for k in range(3):
        after = before.copy()
        after[:3] += 0.15 * before[6:].reshape(3, 3)[:, k]
        assert containment(before[None], after[None])[0] == pytest.approx(0.15)
        assert ways(before[None], after[None])[0] == pytest.approx(0.15)
    # Corners move along any way, and none of them gets further out.
    after = before.copy()
    after[:3] += [0.1, -0.2, 0.15]
    assert containment(before[None], after[None])[0] == pytest.approx(
        np.linalg.norm([0.1, 0.2, 0.15])
    )


def test_a_square_bar_that_rolls_by_a_quarter_gets_nowhere_though_its_corners_move():
    before = row([0.3, 0.0, 0.1], [0.1, 0.1, 0.4], np.eye(3))
    after = row([0.3, 0.0, 0.1], [0.1, 0.1, 0.4], turn([0, 0, 1], np.pi / 2))
    assert containment(before[None], after[None])[0] == pytest.approx(0.0, abs=1e-12)
    assert ways(before[None], after[None])[0] == pytest.approx(0.1)


def test_reaches_compare_each_two_frames_both_ways():
    rng = np.random.default_rng(3)
    rows = np.array([random_row(rng) for _ in range(9)])
    rows[4] = np.nan
    out, gone = reaches(rows, 20)
    for m in range(1, 20):
        for k in range(9):
            if k < m or 4 in (k, k - m):
                assert np.isnan(out[m - 1, k])
                continue
            pair = rows[[k - m]], rows[[k]]
            both = max(containment(*pair)[0], containment(*pair[::-1])[0])
            assert out[m - 1, k] == pytest.approx(both, abs=1e-6)
            assert gone[m - 1, k] == pytest.approx(ways(*pair)[0], abs=1e-6)


@examples(60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1.0]))
def test_lines_are_above_what_they_are_drawn_above(seed, least_speed):
    rng = np.random.default_rng(seed)
    bound = np.cumsum(rng.uniform(0.0, 0.02, len(TIMES))) ** rng.uniform(0.3, 1.0)
    lines = lines_above(TIMES, bound, least_speed)
    assert (growth(lines, TIMES) >= bound - 1e-12).all()
    assert lines[0][0] == 0.0
    assert all(w >= least_speed for _, w in lines)
    more = steepened(lines, 0.3)
    others = tuple(line for line in lines if line[0] > 0.0)
    if others:
        bound = np.minimum(STEEPER * lines[0][1] * TIMES, growth(others, TIMES) + 0.3 * TIMES)
        assert (growth(more, TIMES) >= bound - 1e-9).all()
    # Only what grows at once is steeper by a share.
    for (c, w), (d, u) in zip(sorted(lines), more, strict=True):
        assert 0.0 <= d - c < 0.01 + 1e-9
        assert -1e-5 <= u - (STEEPER * w if c == 0.0 else w + 0.3) < 0.05 + 1e-9


def test_a_part_needs_steeper_lines_by_how_far_it_leaves_them():
    lines = ((0.0, 2.0), (0.1, 0.5))
    out = np.tile((0.1 + 0.5 * TIMES)[:, None], 4) + [-0.1, 0.0, 0.0, 0.0] + 0.01
    # At short times a part is nearer by far than the line through the origin.
    out[:6] = 0.0
    out[20, 2] += 0.7 * TIMES[20]
    out[2, 3] = 2.0 * STEEPER * TIMES[2] + 0.02
    out[5, 0] = np.nan
    found = needed(out, lines, TIMES, 0.01)
    assert found[0] < 0.0
    np.testing.assert_allclose(found[1:3], [0.0, 0.7], atol=1e-12)
    assert np.isinf(found[3])


def test_steps_keep_each_person_within_the_limit_with_no_step_left():
    rng = np.random.default_rng(5)
    groups = {who: {kind: rng.gamma(4.0, 0.3, 2000) for kind in ('hand', 'head')} for who in 'ab'}
    del groups['b']['head']
    groups['a']['hand'][7] = np.inf
    limit = 0.02

    def shares(steps):
        return [
            np.mean(np.any([need > steps[kind] for kind, need in group.items()], axis=0))
            for group in groups.values()
        ]

    found = least_steps(groups, limit)
    assert max(shares(found)) <= limit
    for kind in ('hand', 'head'):
        assert max(shares({**found, kind: found[kind] - 0.05})) > limit


def take_of(person, speed, n=400, name=''):
    """Return a take of a hand that sways, the further the faster [m/s]."""
    rows = np.tile(row([0.0] * 3, [0.2] * 3, np.eye(3)), (n, 1))
    rows[:, 0] += speed / 10.0 * np.sin(10.0 * np.arange(n) / FRAMES)
    out, gone = reaches(rows, len(TIMES))
    is_faster = gone > 2.0 * TIMES[:, None] + STATED.body_error
    return Take(
        *(name or person, person, 1.0, n),
        out={'left hand': out},
        n_pairs={'left hand': int(np.isfinite(out).sum())},
        n_faster={'left hand': int(is_faster.sum())},
        is_faster={'left hand': is_faster.any(axis=0)},
    )


def test_each_person_is_judged_by_lines_that_were_made_without_him():
    slow, middle, fast = take_of('a', 1.0), take_of('b', 1.5), take_of('c', 3.0)
    making = Making([slow, middle, fast], (1.0,), 0.01)
    # The fastest one needs lines that the others do not give by themselves.
    assert making.steps['hand'] > 0.0
    assert growth(making.base_lines('hand', 'c'), TIMES)[0] < fast.out['left hand'][0, 1:].max()
    for take in making.takes:
        pairs, stated, lined = judged(making, take)
        assert stated.any() == (take is fast)
        assert lined.mean() <= 0.01
        assert pairs['hand'][0] == take.n_pairs['left hand']
    # All get as far as any other part.
    at = growth(making.lines['hand'], making.times)
    assert (growth(making.lines[''], making.times) >= at - 1e-9).all()


def test_of_one_person_takes_are_left_out():
    takes = [take_of('a', 1.5, name='one'), take_of('a', 3.0, name='two')]
    making = Making(takes, (1.0,), 0.01)
    assert making.people_of('hand') == ('a',)
    assert making.unit_of('hand', takes[1]) == 'two'
    assert making.steps['hand'] > 0.0


def test_a_person_is_known_by_his_bones_and_his_table_is_source(tmp_path):
    person = load_person()
    taller = replace(person, positions=1.05 * person.positions)
    files = [tmp_path / f'{name}.csv' for name in ('one', 'another', 'same')]
    for file, who, begin in zip(files, (person, taller, person), (0.0, 0.0, 4.0), strict=True):
        write_person(excerpt(who, begin, begin + 3.0), file, ['A test.'])
    people = persons_of(files)
    assert people[files[0]] == people[files[2]] != people[files[1]]
    skeleton = load_skeleton('cmu_bvh')
    takes = [measured((file, people[file], 1.0, 20, skeleton)) for file in files]
    assert all(take.n_frames == int(2.9 * FRAMES) for take in takes)
    making = Making(takes, (1.0,), 0.01)
    assert making.people_of('hand') == ('person 1', 'person 2')
    text = default_of(making)
    found = dict(ast.literal_eval(''.join(text).removeprefix('BODY_REACH = ')))
    assert list(found) == [words for words, _ in STATED.body_speeds]
    assert found['hand'] == making.lines['hand']
    assert found['chest'] == found['torso']
    rows = [line.split('|')[1:-1] for line in table_of(making)]
    assert len({len(row) for row in rows}) == 1
    for row in rows[2:]:
        assert float(row[-1].split('/')[1]) <= 1.0


def test_fewer_than_two_recordings_are_one_sentence(tmp_path, capsys):
    assert main([str(tmp_path)]) == 2
    assert 'expected two or more' in capsys.readouterr().err


def test_the_longest_time_is_that_of_a_lost_part_and_a_stop_from_full_acceleration():
    # 1.5 rad/s, 4 rad/s^2, 40 rad/s^3: 2 + 1.5 / 4 + 2 * 4 / 40.
    assert longest_time() == pytest.approx(2.575)
