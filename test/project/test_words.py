# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pages and sources say the field's words, not the private ones that once stood for them."""

from functools import cache
import io
from os.path import relpath
from pathlib import Path
import re
import tokenize

import pytest

ROOT = Path(__file__).parents[2]
# A private word, what to say instead, and a made-up sentence with it. Parts of identifiers count
# as words: an underscore is read as a space, and a capital within a name begins another word.
WORDS = (
    (r'guard(s|ed|ing)?', 'monitor, monitored; checked (of the ray)', 'The guard stops the arm.'),
    (r'untaut|tauten\w*|taut', 'shortcut', 'A taut path is shorter.'),
    (r'lean(s|ed|ing)? (on|against|into)|leaning', 'contact, elastic band', 'It leaned on a box.'),
    (r'underway', 'remaining motion', 'What is underway is free.'),
    (r'last looks?', 'revalidation', 'After a last look it is out.'),
    (r'take ?overs?|tak(es?|en|ing) over|took over', 'handover', 'A motion takes over.'),
    (r'told|tells?|telling', 'published, commanded; reported', 'The arm is told to stop.'),
    (r'refus(e[sd]?|al\w?|ing)', 'reject, rejection', 'The array is refused.'),
    (r'ways? out', 'escape', 'There is no way out of it.'),
    (r'emergency (stops?|brakes?)|quick stops?', 'fail-safe stop', 'An emergency stop is due.'),
    (r'snaps?', 'the limit of jerk', 'The snap along the path.'),
    (r'grips?', 'v_max, a_max, j_max', 'The grip of the joint limits.'),
    (r'catching up', 'processing pending messages', 'It is catching up.'),
    (r'rights? of way', 'priority', 'The brake has the right of way.'),
    (r'touch(es|ed|ing)?', 'violation, contact, collides', 'No bar touches a box.'),
    (r'nowhere near', 'deviates from', 'It is nowhere near its motion.'),
    (r'held against', 'checked against', 'It is held against a new body.'),
    (r'oracles?', 'reference checker', 'As the oracle says.'),
    (r'second opinions?', 'second checker', 'The second opinion is asked.'),
)
PATTERNS = tuple(
    (re.compile(rf'\b(?:{word})\b'.replace(' ', r'\s+').replace(r'\s+?', r'\s*'), re.I), say)
    for word, say, _ in WORDS
)
# What others call so: a parameter, rclpy, sockets, the switch that cuts the drives, files.
ALLOWED = re.compile(
    r'\bray guard length\b|\bguard condition\b|\bconnection refused\b'
    r'|\bemergency stop\s+switch\b|^\.(tell|touch| guard|guards)$',
    re.I,
)


@cache
def private_words(text):
    """Return (line within the text, private word, what to say instead) of each private word."""
    text = ALLOWED.sub('allowed', re.sub(r'(?<=[a-z0-9])(?=[A-Z])|[_-]', ' ', text))
    return [
        (text.count('\n', 0, match.start()), match[0], say)
        for word, say in PATTERNS
        for match in word.finditer(text)
    ]


def texts_of(file):
    """Return (first line, text) of what people read: a page, or names, strings and comments."""
    text = file.read_text(encoding='utf-8')
    if file.suffix != '.py':
        return [(1, text)]
    found, before = [], ''
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        # The parts of an f-string are tokens since Python 3.12.
        if tokenize.tok_name[token.type] in ('NAME', 'STRING', 'COMMENT', 'FSTRING_MIDDLE'):
            is_attribute = before == '.' and token.type == tokenize.NAME
            found.append((token.start[0], '.' * is_attribute + token.string))
        before = token.string
    return found


def faults_in(files):
    """Return a sentence for each private word: where it is, and what to say instead."""
    return [
        f'{relpath(file, ROOT)}:{first + line}: "{word}", say: {say}'
        for file in files
        for first, text in texts_of(file)
        for line, word, say in private_words(text)
    ]


@pytest.mark.parametrize(
    'names',
    [
        '*.md docs/**/*.md *.rst */*.yaml',
        'benchmarks/**/*.py docs/**/*.py */*.md',
        'rrth_planner/**/*.py',
    ],
)
def test_no_private_word_is_left(names):
    found = faults_in(file for name in names.split() for file in sorted(ROOT.glob(name)))
    assert not found, '\n'.join([f'{len(found)} private words:', *found])


@pytest.mark.parametrize(('word', 'say', 'sentence'), WORDS)
def test_each_private_word_is_found(word, say, sentence, tmp_path):
    assert [found[2] for found in private_words(sentence)] == [say], word
    source = tmp_path / 'source.py'
    for text in (f'"""{sentence}"""', f'# {sentence}', f"x = f'{{y}}: {sentence}'"):
        source.write_text(f'y = 1\n{text}\n')
        (fault,) = faults_in([source])
        assert 'source.py:2: "' in fault
        assert fault.endswith(f', say: {say}')


def test_a_private_word_is_found_in_names_and_across_lines():
    for text in ('_is_guarded', 'GuardRecord', 'A motion takes\nover.', 'last_look', 'takeover'):
        assert len(private_words(text)) == 1, text
    assert private_words('One.\nA way\nout.')[0][:2] == (1, 'way\nout')


def test_what_others_call_so_is_allowed():
    for text in (
        '`ray_guard_length`, create_guard_condition, ConnectionRefusedError',
        'an emergency-stop switch',
        '.tell',
        '.guards',
        '._guard',
        'A rest of 0.1 s; a look at it; the right way; the depth; a clean sample; grippers.',
    ):
        assert not private_words(text), text
