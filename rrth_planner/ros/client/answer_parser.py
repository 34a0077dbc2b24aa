# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Parser of the answers of a planner: code, sentence and figures."""

import re
from typing import NamedTuple

from rrth_planner.model.errors import MessageError, one_line, shown
from rrth_planner.model.status import ErrorCode

ANSWER = re.compile(r'([A-Z_]+) \((-?\d+)\): (.*)')
NUMBER = r'(-?[0-9.]+(?:e[-+]?\d+)?)'
# The figures of a motion by name, with their units where these are not SI.
FIGURES = {
    'waypoints': rf'\b{NUMBER} waypoints\b',
    'duration': rf'\bduration {NUMBER} s\b',
    'path_length': rf'\bpath length {NUMBER} rad\b',
    'least_clearance': rf'\bleast clearance {NUMBER} m\b',
    'planning_time_ms': rf'\bplanning time {NUMBER} ms\b',
    'seed': rf'\bseed {NUMBER}',
    'request': rf'\brequest {NUMBER}',
}
WHOLE = ('waypoints', 'seed', 'request')


class Answer(NamedTuple):
    """
    An answer of the planner.

    The figures are `waypoints`, `duration` [s], `path_length` [rad], `least_clearance` [m],
    `planning_time_ms`, `seed` and the number of the `request`, as far as the sentence has them.
    """

    code: ErrorCode
    sentence: str
    figures: dict[str, float]


def answer_from_text(text: str) -> Answer:
    """Return the answer that a text `NAME (number): sentence` is, or raise MessageError."""
    # An answer may hold anything; what is read of it may be printed.
    text = one_line(text)
    found = ANSWER.fullmatch(text)
    if found is None or int(found[2]) not in set(ErrorCode):
        raise MessageError(f'answer {shown(text)}, expected NAME (number): sentence')
    sentence, figures = found[3], {}
    for name, pattern in FIGURES.items():
        figure = re.search(pattern, sentence)
        if figure is not None:
            figures[name] = int(figure[1]) if name in WHOLE else float(figure[1])
    return Answer(ErrorCode(int(found[2])), sentence, figures)
