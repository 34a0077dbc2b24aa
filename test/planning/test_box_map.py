# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Another map as a YAML file works, a bad one is rejected in one sentence."""

import numpy as np
import pytest
from rrth_planner.io.map_file import map_from_mapping
from rrth_planner.io.text_file import load_yaml
from rrth_planner.kernels.layout import MAX_DOF
from rrth_planner.model.errors import RrthError, SceneError
from rrth_planner.planning.box_map import BoxMap, map_problem
from rrth_planner.planning.options import RRTHOptions, RRTOptions, RRTStarOptions
from rrth_planner.planning.planner import plan
from rrth_planner.planning.visibility_graph import enters, extended_obstacles, shortest_path

GATE = """
name: gate
bounds: [0, 0, 60, 40]
start: [5, 20]
goal: [55, 20]
rectangles:
  - [28, 0, 32, 25]
"""


def read(tmp_path, text):
    """Return the map of a YAML file with this text."""
    file = tmp_path / 'map.yaml'
    file.write_text(text, encoding='utf-8')
    return map_from_mapping(load_yaml(file), file.stem)


def test_another_map_is_read_and_planned_on(tmp_path):
    box_map = read(tmp_path, GATE)
    assert box_map.name == 'gate'
    exact = 2.0 * np.hypot(23.0, 5.0) + 4.0
    assert shortest_path(box_map)[0] == pytest.approx(exact)
    options = RRTHOptions(step_size=10.0, corner_spacing=0.05, time_limit=60.0)
    result = plan(map_problem(box_map), options, np.random.default_rng(0))
    assert result.path.length == pytest.approx(exact, rel=1e-3)


def test_a_map_without_a_name_has_that_of_its_file(tmp_path):
    assert read(tmp_path, GATE.replace('name: gate\n', '')).name == 'map'


def test_a_map_without_walls_is_a_map(tmp_path):
    box_map = read(tmp_path, GATE.replace('\n  - [28, 0, 32, 25]', ' []'))
    assert shortest_path(box_map)[0] == pytest.approx(50.0)


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        ('start: [5, 20]', 'start: [30, 20]', 'start [30.0, 20.0] is inside obstacle 0'),
        ('goal: [55, 20]', 'goal: [30, 20]', 'goal [30.0, 20.0] is inside obstacle 0'),
        ('[28, 0, 32, 25]', '[32, 0, 28, 25]', 'expected a positive size along every axis'),
        ('[28, 0, 32, 25]', '[28, 0, 28, 25]', 'expected a positive size along every axis'),
        ('goal: [55, 20]', 'goal: [65, 20]', 'goal [65.0, 20.0], expected within'),
        ('start: [5, 20]', 'start: [5, -1]', 'start [5.0, -1.0], expected within'),
        ('rectangles:', 'rectangels:', 'rectangels unknown, expected only'),
        ('goal: [55, 20]', 'goal: [55, 20]\nwalls: []', 'walls unknown, expected only'),
        ('rectangles:', 'boxes: []\nrectangles:', 'rectangles and boxes, expected one of them'),
        ('rectangles:', 'rectangles: []\nboxes:', 'rectangles and boxes, expected one of them'),
        ('25]', '25, 30]\n  - [1, 1, 2]', 'expected numbers of shape (n, 4) [map]'),
        (
            '[28, 0, 32, 25]',
            '[0, 0, 1, 1, 2, 2]\n  - [3, 3, 4, 4, 5, 5]',
            'shape (2, 6), expected (n, 4) [map]',
        ),
        ('goal: [55, 20]\n', '', "no 'goal', expected bounds, rectangles or boxes"),
        ('bounds: [0, 0, 60, 40]\n', '', "no 'bounds', expected bounds, rectangles or boxes"),
        ('start: [5, 20]', 'start: [.nan, 20]', 'start: [nan, 20.0], expected finite numbers'),
        ('[28, 0, 32, 25]', '[28, .nan, 32, 25]', 'expected finite numbers'),
        ('[28, 0, 32, 25]', '[28, 0, .inf, 25]', 'expected finite numbers'),
        ('[28, 0, 32, 25]', '[28, 0, 32]', 'shape (1, 3), expected (n, 4) [map]'),
        ('[28, 0, 32, 25]', '[28, 0, wide, 25]', 'expected numbers of shape (n, 4) [map]'),
        ('[0, 0, 60, 40]', '[60, 0, 0, 40]', 'expected lower < upper'),
        ('[0, 0, 60, 40]', '[0, 0, 60]', 'bounds: shape (3,), expected (4) [map]'),
        ('0, 60, 40]', '0, 60, 1.1e4]', '[60.0, 11000.0]], expected numbers of at most 10000'),
        ('start: [5, 20]', 'start: here', "start: 'here', expected numbers of shape (n) [map]"),
    ],
)
def test_a_bad_map_is_rejected_in_one_sentence(tmp_path, old, new, told):
    text = GATE.replace(old, new)
    assert text != GATE
    with pytest.raises(SceneError) as refusal:
        read(tmp_path, text)
    sentence = str(refusal.value)
    assert told in sentence
    assert 'map "' in sentence
    assert '\n' not in sentence
    assert len(sentence) < 250


def test_a_wall_that_a_second_one_of_its_name_would_hide_is_no_silent_loss(tmp_path):
    with pytest.raises(RrthError, match='rectangles twice') as refusal:
        read(tmp_path, GATE + 'rectangles: []\n')
    assert '\n' not in str(refusal.value)


@pytest.mark.parametrize('text', ['', '[1, 2]', 'a wall'])
def test_a_file_that_holds_no_map_is_rejected_in_one_sentence(tmp_path, text):
    with pytest.raises(SceneError, match='expected a mapping with bounds, rectangles or boxes'):
        read(tmp_path, text)


@pytest.mark.parametrize('text', ['bounds: [0, 0', '\t- :'])
def test_a_file_that_is_no_yaml_is_rejected_in_one_sentence(tmp_path, text):
    with pytest.raises(RrthError) as refusal:
        read(tmp_path, text)
    assert '\n' not in str(refusal.value)


def test_touching_a_wall_is_no_entering():
    box_map = BoxMap(
        name='touching',
        bounds=[[0, 0], [9, 9]],
        obstacles=[[[3, 3], [6, 6]]],
        start=[3, 4],
        goal=[6, 4],
    )
    assert shortest_path(box_map)[0] == pytest.approx(5.0)


def walled(n):
    """Return a map of n dimensions with a wall between start and goal, open at the top."""
    return BoxMap(
        name='wall',
        bounds=[[0.0] * n, [10.0] * n],
        obstacles=[[[4.5] + [0.0] * (n - 1), [5.5] + [6.0] * (n - 1)]],
        start=[1.0] * n,
        goal=[9.0] + [1.0] * (n - 1),
    )


@pytest.mark.parametrize('kind', [RRTHOptions, RRTOptions, RRTStarOptions])
def test_a_map_of_as_many_dimensions_as_there_may_be_is_planned_on(kind):
    box_map = walled(MAX_DOF)
    options = kind(step_size=20.0, max_samples=200, time_limit=1000.0)
    q = plan(map_problem(box_map), options, np.random.default_rng(1)).path.waypoints
    assert len(q) > 2
    assert not enters(q[:-1], q[1:], extended_obstacles(box_map)).any()


def test_a_map_of_no_dimensions_or_of_too_many_is_rejected():
    with pytest.raises(SceneError, match='bounds of 65 dimensions, expected 1 to 64'):
        walled(MAX_DOF + 1)
    with pytest.raises(SceneError, match='bounds of 0 dimensions, expected 1 to 64'):
        BoxMap(name='none', bounds=[[], []], obstacles=[], start=[], goal=[])
