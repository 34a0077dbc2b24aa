# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Records of incidents: exact to the bit, a hundred a folder, rejected in one sentence."""

from copy import deepcopy
from dataclasses import replace
from functools import cache
import os
from types import MappingProxyType

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.violation import Disagreement, Violation
from rrth_planner.io.incident import disagreement_incident, error_incident, Incident, IncidentKind
from rrth_planner.io.incident_file import (
    incident_from_mapping,
    incident_to_yaml,
    MOST_FILES,
    plain,
    read_incident,
    write_incident,
)
from rrth_planner.io.text_file import parse_yaml
from rrth_planner.model.errors import RecordError, RrthError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import SeparationRules
from rrth_planner.model.trajectory import MotionLimits, MotionState, StartState, Trajectory
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.options import PrintedRRTHOptions, RRTHOptions, RRTStarSmartOptions
from worlds import examples, FOLDED, limits, MARGIN, RAY, table_1_arm, wearer
import yaml

ANY = st.floats(allow_nan=False, allow_infinity=False)
POSITIVE = st.floats(min_value=5e-324, max_value=1e300)
NEAR = st.floats(min_value=-1e4, max_value=1e4)
# What may be printed: names, and sentences of one line.
LINES = st.text(st.characters().filter(str.isprintable))
NAMES = st.text(st.characters().filter(str.isprintable), min_size=1)


# Strategies are made once: a new one is looked through before anything is drawn from it.
@cache
def rows(n, element=ANY):
    """Return a strategy of arrays of n rows for the four joints."""
    row = st.lists(element, min_size=4, max_size=4)
    return st.lists(row, min_size=n, max_size=n).map(np.array)


@cache
@st.composite
def trajectories(draw):
    n = draw(st.integers(1, 4))
    steps = draw(st.lists(st.floats(1e-9, 1e3), min_size=n - 1, max_size=n - 1))
    return Trajectory(
        times=np.concatenate([[0.0], np.cumsum(steps)]),
        positions=draw(rows(n, NEAR)),
        velocities=draw(rows(n)),
        accelerations=draw(rows(n)),
    )


@cache
@st.composite
def boxes(draw):
    return Box(
        draw(NAMES),
        draw(st.tuples(NEAR, NEAR, NEAR)),
        draw(st.tuples(*[st.floats(5e-324, 1e4)] * 3)),
        np.eye(3)[list(draw(st.sampled_from([(0, 1, 2), (1, 2, 0), (2, 0, 1)])))],
    )


@cache
@st.composite
def rules(draw):
    speed = st.floats(0.0, 100.0)
    others = st.lists(st.tuples(st.floats(0.0, 10.0), speed), max_size=3)
    reach = st.builds(lambda v, lines: ((0.0, v), *lines), speed, others)
    return SeparationRules(
        contact_speed=draw(speed),
        body_speeds=(*draw(st.lists(st.tuples(LINES, speed), max_size=3)), ('', draw(speed))),
        body_reach=draw(st.none() | st.lists(st.tuples(LINES, reach), max_size=3).map(tuple)),
        body_error=draw(st.floats(0.0, 10.0)),
        controller_delay=draw(st.floats(0.0, 10.0)),
    )


SCENES = st.lists(boxes(), max_size=3).map(lambda found: Scene(tuple(found)))
SOME_SCENES, SOME_RULES = st.none() | SCENES, st.none() | rules()
SOME_TRAJECTORIES = st.none() | trajectories()


@st.composite
def incidents(draw):
    state = MotionState(
        positions=draw(rows(1))[0], velocities=draw(rows(1))[0], accelerations=draw(rows(1))[0]
    )
    moving = StartState(
        state=state, running=draw(SOME_TRAJECTORIES), time=draw(st.floats(0.0, 9.0))
    )
    question = PlanQuestion(
        arm=table_1_arm(),
        scene=draw(SCENES),
        q_start=draw(rows(1))[0],
        goal=PointingGoal(draw(st.tuples(NEAR, NEAR, NEAR))),
        limits=MotionLimits(
            velocity=draw(rows(1, POSITIVE))[0],
            acceleration=draw(rows(1, POSITIVE))[0],
            jerk=draw(rows(1, POSITIVE))[0],
        ),
        options=draw(
            st.sampled_from([RRTHOptions(goal_bias=0.1 + 0.2), RRTStarSmartOptions(max_samples=7)])
        ),
        margin=draw(st.floats(0.0, 1e4)),
        ray_guard_length=draw(st.floats(0.0, 1e4)),
        seed=draw(st.integers(0, 2**63)),
        moving=draw(st.sampled_from([None, moving])),
        escape_depth=draw(st.floats(0.0, 1.0)),
        rules=draw(SOME_RULES),
        stop_limits=draw(st.sampled_from([None, limits()])),
        body_age=draw(st.floats(0.0, 1e4)),
    )
    is_disagreement = draw(st.booleans())
    touch = Violation(draw(ANY), draw(ANY), draw(NAMES), draw(NAMES))
    return Incident(
        kind=IncidentKind.DISAGREEMENT if is_disagreement else IncidentKind.ERROR,
        sentence=draw(LINES),
        time=draw(LINES),
        question=question,
        trajectory=draw(trajectories()) if is_disagreement else None,
        violation=touch if is_disagreement else None,
        present=draw(SOME_SCENES),
        escape_time=draw(st.floats(0.0, 9.0)),
        error=draw(LINES),
        traceback=draw(st.text()),
        versions=draw(st.dictionaries(LINES, LINES, max_size=3)),
    )


def flat(value):
    """Return a mapping as text in which -0.0 is not 0.0, and every number is exact."""
    if isinstance(value, dict):
        return [[flat(key), flat(item)] for key, item in value.items()]
    if isinstance(value, list):
        return [flat(item) for item in value]
    return value.hex() if isinstance(value, float) else repr(value)


@examples(150)
@given(incidents())
def test_an_incident_survives_its_file_to_the_bit(incident):
    again = incident_from_mapping(as_mapping(incident))
    assert flat(plain(again)) == flat(plain(incident))
    for name in ('arm', 'limits', 'options'):
        assert type(getattr(again.question, name)) is type(getattr(incident.question, name))
    np.testing.assert_array_equal(again.question.q_start, incident.question.q_start)


def question(**changes):
    """Return a question about the arm, folded behind its wearer."""
    return replace(
        PlanQuestion(
            arm=table_1_arm(),
            scene=wearer(),
            q_start=FOLDED,
            goal=PointingGoal([1.5, 0.1, 0.3]),
            limits=limits(),
            options=RRTHOptions(),
            margin=MARGIN,
            ray_guard_length=RAY,
            seed=1,
            rules=SeparationRules(),
            stop_limits=limits(),
        ),
        **changes,
    )


def disagreement():
    """Return a record of a motion that is none, and of a touch."""
    still = Trajectory(
        times=np.zeros(1),
        positions=FOLDED[None],
        velocities=np.zeros((1, 4)),
        accelerations=np.zeros((1, 4)),
    )
    return disagreement_incident(
        question(), Disagreement(still, Violation(0.0, 0.01, 'ray', 'head'))
    )


def test_half_a_character_does_not_keep_a_file_from_being_written(tmp_path):
    incident = replace(disagreement(), sentence='half \ud800')
    assert read_incident(write_incident(incident, tmp_path)).sentence == 'half ?'


def test_an_incident_says_when_and_what_took_part():
    versions = disagreement().versions
    assert {'rrth_planner', 'numpy', 'numba', 'python-fcl', 'python', 'platform'} <= set(versions)
    assert disagreement().time.endswith('+00:00')
    record = error_incident(question(), ZeroDivisionError('of a test'), 'here', None)
    assert (record.error, record.sentence) == ('ZeroDivisionError', 'of a test')


def test_a_folder_keeps_the_last_hundred_and_what_is_not_its_own(tmp_path):
    folder = tmp_path / 'new' / 'folder'
    folder.mkdir(parents=True)
    (folder / 'notes.yaml').write_text('mine')
    for i in range(MOST_FILES + 3):
        old = folder / f'incident-{i:03}.yaml'
        old.write_text('')
        os.utime(old, (i, i))
    path = write_incident(disagreement(), folder)
    left = sorted(file.name for file in folder.iterdir())
    assert len(left) == MOST_FILES + 1
    assert {path.name, 'notes.yaml'} <= set(left)
    assert left[0] == 'incident-004.yaml'


def test_a_new_file_stays_when_the_clock_has_jumped_backwards(tmp_path):
    for i in range(MOST_FILES):
        future = tmp_path / f'incident-{i}.yaml'
        future.write_text('')
        os.utime(future, (4e9, 4e9))
    assert write_incident(disagreement(), tmp_path).exists()


def as_mapping(incident):
    """Return what the file of an incident holds."""
    return parse_yaml(incident_to_yaml(incident), 'incident')


@cache
def as_written():
    """Return what the file of a record holds."""
    return as_mapping(disagreement())


def changed(path, value):
    """Return the mapping of an incident with one entry replaced; `del`: left out."""
    data = deepcopy(as_written())
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    if value is del_:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return data


del_ = object()


@pytest.mark.parametrize(
    ('path', 'value', 'sentence'),
    [
        (('format',), 1, 'format: 1, expected 6'),
        (('kind',), 'storm', "kind: 'storm', expected disagreement or error"),
        (('kind',), [], 'kind: '),
        (('question',), None, 'question: None, expected a mapping'),
        (('question', 'seed'), del_, 'question: no seed, expected arm, scene'),
        (('question', 'seed'), -1, 'seed: -1, expected a whole number >= 0'),
        (('question', 'seed'), 'one', "seed: 'one', expected a whole number"),
        (('question', 'sed'), 1, 'question: sed, expected only arm'),
        (('question', 'margin'), float('nan'), 'margin: nan, expected a number [m]'),
        (('question', 'margin'), '2 cm', "margin: '2 cm', expected a number [m]"),
        (('question', 'q_start'), [0.0], 'q_start: shape (1,), expected (4) [rad]'),
        (('question', 'options', 'algorithm'), 'prm', "options: algorithm 'prm', expected one of"),
        (('question', 'options', 'algorithm'), [1], 'options: algorithm [1], expected one of'),
        (('question', 'options', 'goal_bias'), 2.0, 'goal_bias: 2.0, expected 0 to 1'),
        (('question', 'arm', 'joint_names'), 'abcd', "arm: joint_names: 'abcd', expected a list"),
        (('question', 'limits', 'jerk'), [1.0] * 3, 'max_jerk: shape (3,), expected (4)'),
        (('question', 'scene', 'boxes'), 7, 'scene: boxes: 7, expected a list'),
        (('question', 'scene', 'boxes'), [7], 'scene: boxes[0]: 7, expected a mapping'),
        (('question', 'body_age'), -1.0, 'body_age: -1.0, expected a number from 0'),
        (
            ('question', 'rules'),
            {},
            'rules: no contact_speed, body_speeds, body_reach,',
        ),
        (('question', 'rules', 'body_speeds'), [['hand']], 'rules: body_speeds'),
        (('question', 'rules', 'body_reach'), [['hand', 3.0]], 'rules: body_reach'),
        (('question', 'rules', 'contact_speed'), -1.0, 'contact_speed: -1.0, expected 0 to 100'),
        (('question', 'moving'), {}, 'moving: no state, running, time, expected'),
        (('trajectory',), None, 'incident: a disagreement without trajectory and violation'),
        (('trajectory', 'times'), [1.0], 'times: expected at least one, from 0'),
        (('violation', 'bar'), 3, 'violation: bar: 3, expected a text'),
        (('versions',), [], 'versions: [], expected a mapping'),
    ],
)
def test_a_bad_record_is_rejected_in_one_sentence(tmp_path, path, value, sentence):
    with pytest.raises(RrthError) as problem:
        incident_from_mapping(changed(path, value))
    assert str(problem.value).startswith(sentence)
    file = tmp_path / 'bad.yaml'
    file.write_text(yaml.safe_dump(changed(path, value)))
    with pytest.raises(RecordError, match='file .*bad.yaml: '):
        read_incident(file)


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.just(10**400),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.integers() | st.text(max_size=2), max_size=4),
    st.dictionaries(st.text(max_size=3) | st.integers(), st.none(), max_size=2),
)


def paths_in(data, path=()):
    """Return the paths to everything in nested mappings and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from paths_in(value, (*path, key))


PATHS = list(paths_in(as_written()))


@examples(400)
@given(st.sampled_from(PATHS), JUNK)
def test_whatever_a_record_holds_it_is_read_or_rejected(path, junk):
    try:
        again = incident_from_mapping(changed(path, junk))
    except RrthError as problem:
        assert 'expected' in str(problem) or 'without' in str(problem)
    else:
        assert isinstance(again, Incident)


@pytest.mark.parametrize('data', [None, 3, 'text', [], MappingProxyType({})])
def test_what_is_no_mapping_is_rejected(data):
    with pytest.raises(RecordError):
        incident_from_mapping(data)


def test_options_without_a_name_are_rejected():
    record = error_incident(question(options=PrintedRRTHOptions()), ValueError(), '', None)
    with pytest.raises(RecordError, match='PrintedRRTHOptions, expected those of rrt_h, rrt'):
        incident_to_yaml(record)


def test_a_question_is_about_one_arm():
    with pytest.raises(RrthError, match='limits: of 3 joints, expected those of the arm, 4'):
        question(
            limits=MotionLimits(velocity=np.ones(3), acceleration=np.ones(3), jerk=np.ones(3))
        )
