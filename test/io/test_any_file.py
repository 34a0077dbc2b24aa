# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a file holds, what reads it makes a value of it or rejects it in one sentence."""

from copy import deepcopy
import functools
from pathlib import Path
import random
import re
import warnings

from hypothesis import given, strategies as st
import numpy as np
import pytest
from recordings import bvh_text, write_c3d
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.incident_file import incident_to_yaml, read_incident
from rrth_planner.io.map_file import load_map
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.person_file import write_person
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.text_file import load_yaml, parse_yaml, to_yaml
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arrays import FARTHEST
from rrth_planner.model.errors import LONGEST_SENTENCE, RrthError
from rrth_planner.wearer.recorded_person import excerpt
from test_incident import disagreement
from worlds import examples

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.timeout(300)


@functools.cache
def incident_text():
    """Return a record, as it is written."""
    return incident_to_yaml(disagreement())


def shipped(*names):
    """Return the bytes of files that come along."""
    return [(ROOT / name).read_bytes() for name in names]


def read_chain(path):
    """Return the arm of a URDF."""
    pytest.importorskip('yourdfpy')
    from rrth_planner.io.urdf.chain import read_chain
    from rrth_planner.io.urdf.import_chain import import_chain

    return import_chain(read_chain(path, ray='+x'), np.eye(4), 0.02)


def read_message(path):
    """Return a body as messages."""
    pytest.importorskip('rclpy')
    from rrth_planner.ros.messages.body_writer import body_from_file

    return body_from_file(path, 'torso')


def recording(folder, suffix):
    """Return a recorded person, as other programs write one, or as he is written here."""
    pytest.importorskip({'.bvh': 'pybvh', '.c3d': 'c3d', '.csv': 'yaml'}[suffix])
    file = folder / f'written{suffix}'
    if suffix == '.bvh':
        file.write_text(bvh_text()[0])
    elif suffix == '.c3d':
        write_c3d(file, ('a', 'b'), np.ones((9, 2, 3)), lost=[(3, 1)])
    else:
        write_person(excerpt(load_person(), 0.0, 0.2), file)
    return [file.read_bytes()]


BODIES = ('config/body.yaml', 'msg_examples/body.yaml', 'msg_examples/body_bad.yaml')
SKELETONS = ('config/skeletons/xsens.yaml', 'config/skeletons/azure_kinect.yaml')
# What reads a file, the end of its name, and files that it reads.
READERS = {
    'arm': (load_arm, '.yaml', lambda _: shipped('config/arm.yaml')),
    'map': (load_map, '.yaml', lambda _: shipped('config/maps/fence.yaml')),
    'body': (load_body, '.yaml', lambda _: shipped('config/body.yaml')),
    'wearer': (load_body, '.yaml', lambda _: shipped(*BODIES)),
    'settings': (lambda p: load_settings(4, p), '.yaml', lambda _: shipped('config/planner.yaml')),
    'skeleton': (load_skeleton, '.yaml', lambda _: shipped(*SKELETONS)),
    'incident': (read_incident, '.yaml', lambda _: [incident_text().encode()]),
    'chain': (read_chain, '.urdf', lambda _: shipped('config/examples/chest_arm.urdf')),
    **{
        name: (load_person, suffix, functools.partial(recording, suffix=suffix))
        for name, suffix in (('bvh', '.bvh'), ('c3d', '.c3d'), ('person', '.csv'))
    },
    'messages': (read_message, '.yaml', lambda _: shipped(*BODIES)),
}
NUMBER = re.compile(rb'(?<![\w.])-?\d+(\.\d+)?(e-?\d+)?')
NASTY = [
    *(b'true', b'"1"', b'.nan', b'nan', b'.inf', b'inf', b'1e400', b'-1', b'0', b'1e300', b'-1e5'),
    *(b'9' * 5000, b'1' * 25, b'5e-324', b'010', b'1:30', b'2001-99-99', b'1 2', b'null', b''),
    *(b'&a ', b'*a', b'<<: ', b'!!binary ', b'!!set {', b'[' * 30, b'{a: ' * 30, b'{}', b'[]'),
    *(b'"\\n\\e[31m\\r"', b'"\\u202e"', b'\\ud800', b'\x1b[2J', b'\xc2\x9b', b'\x00', b'\xff\xfe'),
    *(b'---\n', b'...', b'%YAML 1.1', b'? ', b'- ', b': ', b', ', b'"', b"'", b'#', b'\t', b'\r'),
    *(b'<link>' * 30, b'<!DOCTYPE a>', b'&#x9b;', b'&b;', b'</link>', b'/>', b'\xef\xbb\xbf'),
]


def spoilt(data, rng):
    """Return bytes with a few changes."""
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(data) + 1)
        end = min(len(data), at + rng.choice([0, 1, 1, 5, 40]))
        numbers = list(NUMBER.finditer(data))
        kind = rng.randrange(5)
        if kind == 0 and numbers:
            found = rng.choice(numbers)
            at, end = found.span()
            put = rng.choice(NASTY)
        elif kind == 1:
            put = rng.randbytes(end - at)
        elif kind == 2:
            put = 2 * data[at:end]
        else:
            put = rng.choice([b'', rng.choice(NASTY)])
        data = data[:at] + put + data[end:]
    return data


def taken(read, file):
    """Return whether a file is taken; without a word but one sentence where it is not."""
    with warnings.catch_warnings():
        # They would be lines on the terminal.
        warnings.simplefilter('error')
        try:
            value = read(file)
        except RrthError as problem:
            assert 0 < len(str(problem)) <= LONGEST_SENTENCE
            assert str(problem).isprintable()
            return False
    for box in getattr(value, 'boxes', ()):
        assert box.name.isprintable()
        assert np.abs(box.numbers).max() <= FARTHEST
    return True


@pytest.mark.parametrize('kind', READERS)
def test_a_file_that_is_spoilt_anywhere_is_read_or_rejected(tmp_path, kind):
    read, suffix, files = READERS[kind]
    originals, file = files(tmp_path), tmp_path / f'spoilt{suffix}'

    @examples(200)
    @given(st.integers(0, 2**32))
    def spoil(seed):
        rng = random.Random(seed)
        file.write_bytes(spoilt(rng.choice(originals), rng))
        taken(read, file)

    file.write_bytes(originals[0])
    assert taken(read, file)
    spoil()


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from([1e4, 1.0001e4, -1e5, 1e300, 5e-324, 10**400, -0.0]),
    st.sampled_from(['', '1', 'nan', 'a\nb', '\x1b[31m', '\u202e', '\x9b', 'x' * 2000, 'ø 🦾']),
    st.lists(st.floats() | st.integers() | st.booleans() | st.text(max_size=2), max_size=4),
    st.lists(st.lists(st.floats(), max_size=4), max_size=4),
    st.dictionaries(st.text(max_size=3), st.none() | st.floats(), max_size=2),
)


def places(data, path=()):
    """Return the paths to everything in nested mappings and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


@pytest.mark.parametrize('kind', [k for k, (_, suffix, _) in READERS.items() if suffix == '.yaml'])
def test_a_value_of_any_type_in_any_place_is_taken_or_rejected(tmp_path, kind):
    read, suffix, files = READERS[kind]
    text, file = files(tmp_path)[0].decode(), tmp_path / f'spoilt{suffix}'
    original = parse_yaml(text, 'text')
    everywhere = list(places(original))

    @examples(200)
    @given(st.sampled_from(everywhere), JUNK, st.sampled_from(['put', 'leave out', 'add']))
    def spoil(path, junk, how):
        data = deepcopy(original)
        inner = data
        for key in path[:-1]:
            inner = inner[key]
        if how == 'put':
            inner[path[-1]] = junk
        elif how == 'leave out':
            del inner[path[-1]]
        elif isinstance(inner, dict):
            inner['more'] = junk
        else:
            inner.append(junk)
        file.write_text(to_yaml(data), encoding='utf-8')
        taken(read, file)

    spoil()


# A number of a kind, where a length or an angle should be, in each kind of file.
LENGTHS = {
    'arm': [('joints', 0, 'd'), ('joints', 1, 'alpha'), ('joints', 2, 'upper'), ('tool', 'a')],
    'map': [('bounds', 1), ('rectangles', 2, 3), ('start', 0), ('goal', 1)],
    'body': [('boxes', 0, 'center', 0), ('boxes', 3, 'size', 2)],
    'settings': [
        ('/**', 'ros__parameters', name)
        for name in ('margin', 'ray_guard_length', 'step_size', 'seed', 'max_samples')
    ]
    + [('/**', 'ros__parameters', 'max_jerk', 0)],
    'incident': [
        ('question', 'margin'),
        ('question', 'arm', 'dh', 0, 3),
        ('question', 'scene', 'boxes', 0, 'size', 1),
        ('question', 'goal', 'target', 0),
        ('trajectory', 'positions', 0, 0),
        ('violation', 'distance'),
    ],
    'messages': [('boxes', 0, 'center', 0)],
}


@pytest.mark.parametrize('value', [True, False, '1', '0.5', None, [0.1], {}])
@pytest.mark.parametrize(('kind', 'path'), [(k, p) for k, paths in LENGTHS.items() for p in paths])
def test_what_only_looks_like_a_number_is_none(tmp_path, kind, path, value):
    read, suffix, files = READERS[kind]
    data = parse_yaml(files(tmp_path)[0].decode(), 'text')
    inner = data
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    file = tmp_path / f'typed{suffix}'
    file.write_text(to_yaml(data))
    with pytest.raises(RrthError, match='expected'):
        read(file)


@pytest.mark.parametrize(
    'name', ['a\nb', '\x1b[31mb', '\x9b31m', '\u202egnp', '\u2028', '', 7, None]
)
def test_names_that_are_not_printable_are_rejected_wherever_they_stand(tmp_path, name):
    body = load_yaml(ROOT / 'config/body.yaml')
    body['boxes'][0]['name'] = name
    arm, named = load_yaml(ROOT / 'config/arm.yaml'), load_yaml(ROOT / 'config/arm.yaml')
    arm['joints'][0]['name'] = name
    named['name'] = name
    fence = {**load_yaml(ROOT / 'config/maps/fence.yaml'), 'name': name}
    for read, data in (
        (load_body, body),
        (load_arm, arm),
        (load_arm, named),
        (load_map, fence),
    ):
        file = tmp_path / 'named.yaml'
        file.write_text(to_yaml(data))
        with pytest.raises(
            RrthError, match='name.*expected (a text|1 to 256 printable)'
        ) as rejected:
            read(file)
        assert str(rejected.value).isprintable()


def test_a_text_of_a_marker_names_its_box_in_one_line(tmp_path):
    message = load_yaml(ROOT / 'msg_examples/body.yaml')
    message['markers'][1]['text'] = 'left\nhand \x1b[31m' + 'x' * 1000
    file = tmp_path / 'body.yaml'
    file.write_text(to_yaml(message))
    name = load_body(file).boxes[0].name
    assert name.startswith('left hand ?[31mxxx')
    assert len(name) == 100
