# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of broken contracts; each says what was given, what was expected, and the unit."""

import reprlib
from typing import Any

from rrth_planner.model.status import ErrorCode

# Longest name in messages and pictures [characters].
LONGEST_NAME = 256

# The end of a text that was cut short.
CUT = ' ...'

# Longest sentence of an error, however long the input is [characters].
LONGEST_SENTENCE = 1000


def one_line(text: str, longest: int = LONGEST_SENTENCE) -> str:
    """Return a text as one printable line, cut short where it is too long."""
    cut = text if len(text) <= longest else f'{text[: longest - len(CUT)]}{CUT}'
    if cut.isprintable():
        return cut
    return ''.join(c if c.isprintable() else ' ' if c.isspace() else '?' for c in cut)


def shown(value: Any) -> str:
    """Return how a sentence quotes what was given, cut short where it is long or deep."""
    try:
        return _QUOTES.repr(value)
    except ValueError:
        # An integer of more digits than Python writes.
        return f'a {type(value).__name__}'


_QUOTES = reprlib.Repr()
_QUOTES.maxstring = _QUOTES.maxother = _QUOTES.maxlong = 80
_QUOTES.maxlist = _QUOTES.maxtuple = 16


class RrthError(Exception):
    """Base of every error that this package raises on purpose: one line each."""

    def __init__(self, sentence: str = '') -> None:
        """Keep the sentence, which may quote what came from outside, to one line."""
        super().__init__(one_line(sentence))


class ModelError(RrthError):
    """An arm that cannot be planned for."""


class SceneError(RrthError):
    """A box, target or map that describes nothing physical."""


class OptionsError(RrthError):
    """A planner option or motion limit outside its range."""


class NotInstalledError(RrthError):
    """A library that not every installation has, and that is needed now."""


class MessageError(RrthError):
    """A message that is rejected."""


class RequestError(RrthError):
    """A request that ends without a motion, with the code of its answer."""

    def __init__(self, code: ErrorCode, sentence: str) -> None:
        """Keep the code beside the sentence."""
        super().__init__(sentence)
        self.code = code


class RecordError(RrthError):
    """An incomplete or invalid record."""


def check_type(value: Any, kind: Any, name: str, error: type[RrthError] = RrthError) -> None:
    """Raise an error unless an argument is of a class, which the sentence names."""
    if not isinstance(value, kind):
        article = 'an' if kind.__name__[0] in 'AEIO' else 'a'
        raise error(f'{name}: {shown(value)}, expected {article} {kind.__name__}')


def printable(value: Any, name: str, error: type[RrthError]) -> str:
    """
    Return a name, which sentences may quote, or raise.

    Line ends, escape sequences of terminals and marks that turn the direction of writing round
    are not printable.
    """
    if not isinstance(value, str):
        raise error(f'{name}: {shown(value)}, expected a text')
    if not 0 < len(value) <= LONGEST_NAME or not value.isprintable():
        raise error(f'{name}: {shown(value)}, expected 1 to {LONGEST_NAME} printable characters')
    return value
