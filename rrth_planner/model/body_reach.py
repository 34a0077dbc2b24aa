# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How far the parts of a body get within a time: the least of lines c + w t."""

from collections.abc import Iterable, Sequence
import re

from rrth_planner.model.errors import OptionsError

# c [m] and w [m/s]; the lines of a part, of which at each time the least counts.
Line = tuple[float, float]
Lines = tuple[Line, ...]

# Lines by words of the names of parts, in the frame of the torso: how far a box of a part gets out
# of where it was seen, in 99.99 % of the pairs of frames 0.1 to 0.6 s apart of CMU motions 62_01,
# 62_07 and 62_13 (one person at work), a little widened by takes of other people. The first line
# of each meets the second one about 0.1 s after a sight. Legs are of that person only, shins and
# feet of six takes of him: no lower at any time than their greatest speeds in `BODY_SPEEDS`. Any
# other part (no words) may be any of these.
BODY_REACH: tuple[tuple[str, Lines], ...] = (
    ('head', ((0.0, 1.3), (0.1, 0.25))),
    ('neck', ((0.0, 0.5), (0.03, 0.15))),
    ('upper arm', ((0.0, 2.2), (0.16, 0.6))),
    ('forearm', ((0.0, 2.7), (0.14, 1.3), (0.36, 0.6))),
    ('hand', ((0.0, 3.6), (0.21, 1.45), (0.42, 0.75))),
    ('pelvis', ((0.0, 1.2), (0.07, 0.45))),
    ('thigh', ((0.0, 3.0), (0.17, 1.25), (0.23, 1.0))),
    ('shin', ((0.0, 5.6), (0.26, 3.05), (0.45, 2.0))),
    ('foot', ((0.0, 6.6), (0.26, 3.95), (0.7, 2.0))),
    ('', ((0.0, 6.6), (0.26, 3.95), (0.7, 2.0))),
)
# Reach is known up to so long after a sight: as long as a lost part may be waited for by default,
# and a stop. Beyond that the greatest speeds count [s].
KNOWN_FOR = 2.5
# Further than any part of a body gets [m], faster than any moves [m/s].
FURTHEST, FASTEST = 10.0, 100.0

_NUMBER = r'[0-9.][0-9.eE+-]*'
_LINE = re.compile(rf'(?:(?P<c>{_NUMBER})\s*\+\s*)?(?P<w>{_NUMBER})\s*t')


def least_lines(lines: Iterable[Line]) -> Lines:
    """Return the lines that are below each other one at some time, by their c."""
    found: list[Line] = []
    for c, w in sorted(set(lines)):
        if not found or w < found[-1][1]:
            found.append((c, w))
    return tuple(found)


def joined(some: Sequence[Line], others: Sequence[Line]) -> Lines:
    """
    Return lines whose least is nowhere below the least of either of two sets of lines.

    At any time, of the lines l and m that are least in each set, max(l, m) is no greater than
    the line with the greater c and the greater w; and that is no less than l and m.
    """
    return least_lines((max(c, d), max(w, v)) for c, w in some for d, v in others)


def lines_shown(lines: Sequence[Line]) -> str:
    """Return lines as a text, as "3.6 t, 0.21 + 1.45 t"."""
    return ', '.join(f'{c:g} + {w:g} t' if c else f'{w:g} t' for c, w in lines)


def lines_of_text(text: str) -> Lines:
    """
    Return the lines of a text, as `lines_shown` writes it.

    Raises ValueError where it is none.
    """
    found = []
    for term in text.split(','):
        line = _LINE.fullmatch(term.strip())
        if line is None:
            raise ValueError(f'{term.strip()!r} is no line')
        found.append((float(line['c'] or 0.0), float(line['w'])))
    return tuple(found)


def check_lines(words: str, lines: Sequence[Line]) -> None:
    """Raise OptionsError where lines are none of a part of a body."""
    given = f'body_reach: "{words}: {lines_shown(lines)}"'
    if not all(0.0 <= c <= FURTHEST and 0.0 <= w <= FASTEST for c, w in lines):
        raise OptionsError(
            f'{given}, expected lines "c + w t" with c from 0 to {FURTHEST:g} [m] and w from 0 to '
            f'{FASTEST:g} [m/s]'
        )
    if not any(c == 0.0 for c, _ in lines):
        raise OptionsError(
            f'{given}, expected one of its lines without c, as "3.6 t": the greatest speed [m/s]'
        )
