# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Text is read as the data that was written, or rejected: at once, in one sentence."""

import math
from pathlib import Path

from hypothesis import given, strategies as st
import pytest
from rrth_planner.io.text_file import (
    DEEPEST,
    load_xml,
    load_yaml,
    MOST_BYTES,
    MOST_ELEMENTS,
    MOST_VALUES,
    parse_yaml,
    read_bytes,
    to_yaml,
)
from rrth_planner.model.errors import ModelError
from worlds import examples
import yaml

ROOT = Path(__file__).parents[2]
SHIPPED = sorted(f for d in ('config', 'msg_examples') for f in (ROOT / d).rglob('*.yaml'))
pytestmark = pytest.mark.timeout(120)

# Texts that some reader of YAML takes for something else.
WORDS = ['', '~', 'on', 'No', 'NULL', '.nan', '1', '-1', '1e5', '+.5', '1:30', '010', '2001-01-01']
WORDS += ['<<', '=', '*a', '&a', '!a', '- a', 'a: b', '# a', '0x1F', '1_000', '9' * 30, ' ', '\n']
TEXTS = st.sampled_from(WORDS) | st.text()
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXTS, inner, max_size=4),
    max_leaves=20,
)


def refusal(text):
    """Return the sentence in which a text is rejected."""
    with pytest.raises(ModelError) as caught:
        parse_yaml(text, 'text')
    sentence = str(caught.value)
    assert sentence.startswith('text: ')
    assert sentence.endswith('; expected a readable YAML file')
    assert sentence.isprintable()
    return sentence


@examples(500)
@given(PLAIN)
def test_plain_data_is_read_as_it_was_written(data):
    assert repr(parse_yaml(to_yaml(data), 'text')) == repr(data)


@pytest.mark.parametrize('file', SHIPPED, ids=lambda file: file.name)
def test_files_that_come_along_say_the_same_to_other_readers(file):
    expected = yaml.safe_load(file.read_text(encoding='utf-8'))
    assert repr(load_yaml(file)) == repr(expected)


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('7', 7),
        ('-0', 0),
        ('+7', 7),
        ('1e-3', 0.001),
        ('-1.5E+2', -150.0),
        ('.5', 0.5),
        ('5.', 5.0),
        ('-.inf', -math.inf),
        ('1' + '0' * 25, 1e25),
        ('yes', True),
        ('off', False),
        ('null', None),
        ('', None),
        # A text stays one, and what only some readers take for a number or a date is none.
        ('"7"', '7'),
        ("'yes'", 'yes'),
        ('010', '010'),
        ('0x1F', '0x1F'),
        ('1_000', '1_000'),
        ('1:30', '1:30'),
        ('2001-99-99', '2001-99-99'),
        ('2001-12-14t21:59:43.10-05:00', '2001-12-14t21:59:43.10-05:00'),
        ('=', '='),
        ('|\n  a\n  b\n', 'a\nb\n'),
    ],
)
def test_a_value_is_what_it_looks_like(text, value):
    found = parse_yaml(f'a: {text}', 'text')['a']
    assert (type(found), found) == (type(value), value)


def doubling(n):
    """Return a list that n aliases make eight times as long each."""
    text = '&a0 [1, 1]'
    for i in range(n):
        text = f'&a{i + 1} [{text}{f", *a{i}" * 7}]'
    return text


MERGES = 'm0: &m0 {k: 1}\n' + ''.join(
    f'm{i + 1}: &m{i + 1} {{<<: [{", ".join([f"*m{i}"] * 9)}]}}\n' for i in range(12)
)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        (doubling(12), 'line 1: an anchor or a tag, a12'),
        (f'boxes:\n  - {{name: b, center: {doubling(9)}}}', 'line 2: an anchor or a tag, a9'),
        (MERGES, 'line 1: an anchor or a tag, m0'),
        ('a: &b [*b]', 'an anchor'),
        ('*a', 'an alias'),
        ('!!binary aGVsbG8=', 'a tag, tag:yaml.org,2002:binary'),
        ('!!python/object/apply:os.getcwd []', 'a tag'),
        ('!!set {a, b}', 'a tag'),
        ('! 5', 'a tag'),
        ('a: 1\nb: 2\na: 3', 'line 1: a twice'),
        ('? [a]\n: 1', 'a key that is no text'),
        ('7: 1', 'a key that is no text'),
        ('a: 1\n---\na: 2', 'line 2: a second document'),
        ('[' * 20_000, 'line 1: '),
        ('- ' * 20_000, f'or {DEEPEST} in one another'),
        ('a: ' * 20_000, 'line 1: '),
        ('? ' * 20_000, f'or {DEEPEST} in one another'),
        ('{a: ' * 900, f'or {DEEPEST} in one another'),
        ('a: "\\ud800', 'line 1: '),
        ('a: [', 'line '),
        ('a: \x1b', 'characters are not allowed'),
        ('%YAML 9.9\n---\na', 'line 1: '),
    ],
)
def test_what_is_no_plain_data_is_rejected_at_its_line(text, words):
    assert words in refusal(text)


@examples(500)
@given(st.text(st.sampled_from(list('ab12.[]{}:,-? \n\t#&*!|>"\'%@`~<=\\\x00\x1b\ud7ff\u202e'))))
def test_any_text_is_data_or_rejected(text):
    try:
        data = parse_yaml(text, 'text')
    except ModelError as problem:
        assert str(problem).isprintable()
    else:
        assert repr(parse_yaml(to_yaml(data), 'text')) == repr(data)


def test_as_much_is_read_as_the_limits_say_and_no_more():
    assert len(parse_yaml(f'[{"1," * (MOST_VALUES - 1)}]', 'text')) == MOST_VALUES - 1
    assert f'more than {MOST_VALUES} values' in refusal(f'[{"1," * MOST_VALUES}]')
    parse_yaml('[' * DEEPEST + ']' * DEEPEST, 'text')
    assert f'or {DEEPEST} in one another' in refusal('[' * (DEEPEST + 1) + ']' * (DEEPEST + 1))


def test_a_file_without_end_is_read_as_far_as_the_limit(tmp_path):
    file = tmp_path / 'long.yaml'
    file.write_bytes(b'#' * MOST_BYTES)
    assert load_yaml(file) is None
    for longer in (file, Path('/dev/zero')):
        if longer is file:
            file.write_bytes(b'#' * (MOST_BYTES + 1))
        with pytest.raises(ModelError, match=f'file .*: expected at most {MOST_BYTES} bytes'):
            load_yaml(longer)


def test_what_cannot_be_read_is_named(tmp_path):
    for path in (tmp_path, tmp_path / 'none', tmp_path / 'a\x00b', tmp_path / ('x' * 300)):
        with pytest.raises(ModelError, match='file .*; expected a readable file') as rejected:
            read_bytes(path)
        assert str(rejected.value).isprintable()
    (tmp_path / 'latin').write_bytes(b'a: \xe4')
    with pytest.raises(ModelError, match='latin: .*expected text in UTF-8'):
        load_yaml(tmp_path / 'latin')


def test_a_file_of_a_windows_editor_is_read(tmp_path):
    (tmp_path / 'a.yaml').write_bytes(b'\xef\xbb\xbfa: 1\r\nb:\r\n  - c\r\n')
    assert load_yaml(tmp_path / 'a.yaml') == {'a': 1, 'b': ['c']}


LAUGHS = ''.join(f'<!ENTITY e{i + 1} "{f"&e{i};" * 10}">' for i in range(9))


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('<link name="x">' * 20_000 + '</link>' * 20_000, f'or {DEEPEST} in one another'),
        (f'<a>{"<b/>" * MOST_ELEMENTS}</a>', f'more than {MOST_ELEMENTS} elements'),
        (f'<!DOCTYPE a [<!ENTITY e0 "ha">{LAUGHS}]><a>&e9;</a>', 'a document type'),
        ('<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>', 'a document type'),
        ('<!DOCTYPE a SYSTEM "http://localhost/a.dtd"><a/>', 'a document type'),
        ('<a>', 'no element found'),
        ('', 'no element found'),
        ('<?xml version="1.0" encoding="none"?><a/>', 'unknown encoding'),
        ('<?xml version="1.0" encoding="utf-7"?><a/>', 'expected a readable XML file'),
    ],
)
def test_what_is_no_plain_xml_is_rejected(tmp_path, text, words):
    file = tmp_path / 'a.urdf'
    file.write_text(text)
    with pytest.raises(ModelError, match='a.urdf: .*; expected a readable XML file') as rejected:
        load_xml(file)
    assert words in str(rejected.value)
    assert str(rejected.value).isprintable()
