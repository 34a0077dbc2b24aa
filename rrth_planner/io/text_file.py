# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files of text, read within limits whatever they hold: YAML as plain data, and XML."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
import math
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree

from rrth_planner.model.errors import ModelError, RrthError
import yaml

# The largest files that are written here are incidents with 10,000 boxes, stored twice: 600,000
# values in 8 MiB, read in two seconds.
MOST_BYTES, MOST_VALUES = 16 * 2**20, 700_000
DEEPEST, MOST_ELEMENTS = 20, 50_000
# libyaml is thirty times as fast as what PyYAML does where it comes without it.
_Parser = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_Dumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
_ENDS = yaml.SequenceEndEvent, yaml.MappingEndEvent
# Numbers as in YAML 1.2, decimal only: 010, 1:30 and dates, of which every reader makes something
# else, are texts. Of 64 bits an integer is exact; longer ones are numbers like others.
_INTEGER = re.compile(r'[-+]?(0|[1-9][0-9]{0,19})')
_FLOAT = re.compile(r'[-+]?([0-9]+\.[0-9]*|\.[0-9]+|0|[1-9][0-9]*)([eE][-+]?[0-9]+)?')
_WORDS = {
    write(word): value
    for value, words in (
        (None, ('', '~', 'null')),
        (True, ('true', 'yes', 'on')),
        (False, ('false', 'no', 'off')),
        (math.inf, ('.inf', '+.inf')),
        (-math.inf, ('-.inf',)),
        (math.nan, ('.nan',)),
    )
    for word in words
    for write in (str.lower, str.title, str.upper)
} | {'.NaN': math.nan}


def read_bytes(path: str | Path) -> bytes:
    """Return what a file holds, or raise ModelError: unreadable, or longer than 16 MiB."""
    try:
        with Path(path).open('rb') as file:
            data = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, 'strerror', None) or problem
        raise ModelError(f'file {path}: {reason}; expected a readable file') from problem
    if len(data) > MOST_BYTES:
        raise ModelError(f'file {path}: expected at most {MOST_BYTES} bytes')
    return data


def read_text(path: str | Path) -> str:
    """Return what a file of UTF-8 holds, or raise ModelError."""
    try:
        return read_bytes(path).decode('utf-8-sig')
    except UnicodeDecodeError as problem:
        raise ModelError(f'file {path}: {problem}; expected text in UTF-8') from problem


@contextmanager
def naming_file(path: str | Path, error: type[RrthError]) -> Iterator[None]:
    """Raise errors of the values that a file describes as one whose sentence names the file."""
    try:
        yield
    except RrthError as problem:
        raise error(f'file {path}: {problem}') from problem


def load_yaml(path: str | Path) -> Any:
    """
    Return what a YAML file holds: mappings by texts, lists, texts, numbers, booleans and None.

    Raise ModelError where it cannot be read, is no YAML, is too long or too deep, or has an alias,
    an anchor, a tag, or a key that is no text or there twice.
    """
    return parse_yaml(read_text(path), f'file {path}')


def parse_yaml(text: str, name: str) -> Any:
    """Return what a text of YAML holds, as `load_yaml` does; name: what sentences call it."""
    try:
        return _parsed(text)
    except yaml.MarkedYAMLError as problem:
        reason = f'line {problem.problem_mark.line + 1}: {problem.problem}'
        raise ModelError(f'{name}: {reason}; expected a readable YAML file') from problem
    except (yaml.YAMLError, ValueError) as problem:
        # A character that may not be there, or the number of one that does not exist.
        reason = ' '.join(str(problem).split())
        raise ModelError(f'{name}: {reason}; expected a readable YAML file') from problem


def to_yaml(data: Any, width: int = 80) -> str:
    """Return plain data as a text that is read to the bit, with lists of numbers in one line."""
    return str(
        yaml.dump(data, Dumper=_Writer, sort_keys=False, default_flow_style=None, width=width)
    )


class _Writer(_Dumper):  # type: ignore[misc,valid-type]
    """Quotes the texts that are read as numbers here and are none elsewhere, as 1e5."""


_Writer.add_implicit_resolver(
    'tag:yaml.org,2002:float', re.compile(f'({_FLOAT.pattern})$'), list('-+.0123456789')
)


def _parsed(text: str) -> Any:
    """
    Return the data of a text, from its events one by one.

    Nothing is constructed that has not been counted: what an alias repeats, or what a tag or a
    word makes of a text, cannot grow.
    """
    next_event = _Parser(text).get_event
    n_values = 0

    def value_of(event: Any, depth: int) -> Any:
        nonlocal n_values
        kind = type(event)
        if kind is yaml.AliasEvent:
            raise _rejection(event, 'an alias')
        if event.anchor or event.tag:
            raise _rejection(event, f'an anchor or a tag, {event.anchor or event.tag}')
        n_values += 1
        is_scalar = kind is yaml.ScalarEvent
        if n_values > MOST_VALUES or depth - is_scalar >= DEEPEST:
            raise _rejection(event, f'more than {MOST_VALUES} values, or {DEEPEST} in one another')
        if is_scalar:
            # The first says whether it stands without quotes.
            return _plain(event.value) if event.implicit[0] else event.value
        items = []
        while type(inner := next_event()) not in _ENDS:
            items.append(value_of(inner, depth + 1))
        return items if kind is yaml.SequenceStartEvent else _mapping(event, items)

    documents: list[Any] = []
    while type(event := next_event()) is not yaml.StreamEndEvent:
        if type(event) is yaml.DocumentStartEvent:
            if documents:
                raise _rejection(event, 'a second document')
            documents.append(value_of(next_event(), 0))
    return documents[0] if documents else None


def _mapping(event: Any, items: list[Any]) -> dict[str, Any]:
    """Return a mapping from its keys and values in turn."""
    keys = items[::2]
    if not all(type(key) is str for key in keys):
        raise _rejection(event, 'a key that is no text')
    mapping = dict(zip(keys, items[1::2], strict=True))
    if len(mapping) < len(keys):
        # Of two, the first would be dropped without a word.
        twice = next(key for key, n in Counter(keys).items() if n > 1)
        raise _rejection(event, f'{twice} twice')
    return mapping


def _plain(text: str) -> Any:
    """Return what a text without quotes stands for."""
    if text in _WORDS:
        return _WORDS[text]
    if text[0] in '-+.0123456789':
        if _INTEGER.fullmatch(text):
            return int(text)
        if _FLOAT.fullmatch(text):
            return float(text)
    return text


def _rejection(event: Any, what: str) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=what, problem_mark=event.start_mark)


class _Tree(ElementTree.TreeBuilder):
    """Builds the elements of an XML file as long as it keeps to what is taken."""

    def __init__(self) -> None:
        super().__init__()
        self._n_elements = self._depth = 0

    def start(self, tag: Any, attrs: Any) -> Any:
        """Begin an element."""
        self._n_elements, self._depth = self._n_elements + 1, self._depth + 1
        if self._n_elements > MOST_ELEMENTS or self._depth > DEEPEST:
            raise ValueError(f'more than {MOST_ELEMENTS} elements, or {DEEPEST} in one another')
        return super().start(tag, attrs)

    def end(self, tag: Any) -> Any:
        """End it."""
        self._depth -= 1
        return super().end(tag)

    def doctype(self, *_: Any) -> None:
        """Reject declarations of entities, which may expand to gigabytes or to other files."""
        raise ValueError('a document type')


def load_xml(path: str | Path) -> ElementTree.Element:
    """
    Return the root of an XML file.

    Raise ModelError where it cannot be read, is no XML, is too long or too deep, or declares a
    document type.
    """
    return parse_xml(read_bytes(path), f'file {path}')


def parse_xml(data: bytes, name: str) -> ElementTree.Element:
    """Return the root of XML, as `load_xml` does; name: what sentences call it."""
    try:
        try:
            root = _root_of(data)
        except ElementTree.ParseError as problem:
            if 'unbound prefix' not in str(problem):
                raise
            root = _root_of(_with_prefixes(data))
    except (SyntaxError, LookupError, ValueError) as problem:
        raise ModelError(f'{name}: {problem}; expected a readable XML file') from problem
    return root


def _root_of(data: bytes) -> ElementTree.Element:
    parser = ElementTree.XMLParser(target=_Tree())
    parser.feed(data)
    root: ElementTree.Element = parser.close()
    return root


def _with_prefixes(data: bytes) -> bytes:
    """Return XML with the prefixes declared that it uses without: TinyXML asks for none."""
    used = dict.fromkeys(re.findall(rb'[<\s]([A-Za-z_][\w.-]*):[A-Za-z_]', data))
    declared = set(re.findall(rb'xmlns:([\w.-]+)', data)) | {b'xml', b'xmlns'}
    new = b''.join(b' xmlns:%b="%b"' % (name, name) for name in used if name not in declared)
    return re.sub(rb'<([A-Za-z_][\w.-]*)', rb'<\1' + new, data, count=1)
