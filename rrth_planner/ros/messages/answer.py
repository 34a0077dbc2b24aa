# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Answers of a planner: code and sentence as a text, and the figures as a message."""

from collections.abc import Mapping
from dataclasses import replace
import math
import re

from diagnostic_msgs.msg import DiagnosticStatus
from rrth_planner.model.errors import MessageError, one_line, shown
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.model.status import ErrorCode
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.messages.diagnostics import status_to_msg

TEXT = re.compile(r'([A-Z_]+) \((-?\d{1,9})\): (.*)')
ENDING = re.compile(r'(?:.*; )?answer (\d{1,18})')
# The figures of a motion by name: key in messages, with the unit, and format.
FIGURES = {
    'seed': ('seed', 'd'),
    'waypoints': ('waypoints', 'd'),
    'planning_time_ms': ('planning time [ms]', '.3f'),
    'response_time_ms': ('request to trajectory [ms]', '.3f'),
    'duration': ('duration [s]', '.6f'),
    'path_length': ('path length [rad]', '.4f'),
    'least_clearance': ('least clearance [m]', '.4f'),
}
NUMBER_KEY, CODE_KEY, STAMP_KEY = 'answer', 'code', 'stamp'


def answer_from_text(text: str) -> Answer:
    """Return the answer that a text `NAME (code): sentence` is, or raise MessageError."""
    # An answer may hold anything; what is read of it may be printed.
    text = one_line(text)
    found = TEXT.fullmatch(text)
    if found is None or int(found[2]) not in set(ErrorCode):
        raise MessageError(f'answer {shown(text)}, expected NAME (number): sentence')
    ending = ENDING.fullmatch(found[3])
    number = 0 if ending is None else int(ending[1])
    return Answer(ErrorCode(int(found[2])), found[3], number=number)


def figures_shown(figures: Mapping[str, float]) -> dict[str, str]:
    """Return figures by their keys in messages; those that are not known are left out."""
    return {
        key: format(figures[name], kind)
        for name, (key, kind) in FIGURES.items()
        if not math.isnan(figures.get(name, math.nan))
    }


def answer_to_msg(name: str, given: Answer) -> DiagnosticStatus:
    """Return an answer as the status of a name."""
    level = DiagnosticStatus.WARN
    if given.code in (ErrorCode.SUCCESS, ErrorCode.FAILURE):
        is_solved = given.code is ErrorCode.SUCCESS
        level = DiagnosticStatus.OK if is_solved else DiagnosticStatus.ERROR
    values: dict[str, object] = {NUMBER_KEY: given.number, CODE_KEY: given.code.value}
    if given.stamp is not None:
        seconds, nanoseconds = divmod(given.stamp, NANOSECONDS)
        values[STAMP_KEY] = f'{seconds}.{nanoseconds:09d}'
    return status_to_msg(name, level, given.text, values | figures_shown(given.figures))


def answer_from_msg(msg: DiagnosticStatus) -> Answer:
    """Return the answer that a status is, or raise MessageError."""
    values = {pair.key: pair.value for pair in msg.values}
    found, figures, stamp = answer_from_text(msg.message), {}, None
    try:
        number = int(values[NUMBER_KEY])
        if STAMP_KEY in values:
            seconds, _, nanoseconds = values[STAMP_KEY].partition('.')
            stamp = int(seconds) * NANOSECONDS + int(nanoseconds)
        for name, (key, kind) in FIGURES.items():
            if key in values:
                figures[name] = int(values[key]) if kind == 'd' else float(values[key])
    except (KeyError, ValueError) as problem:
        name = shown(one_line(msg.name))
        raise MessageError(f'status {name}: {problem}, expected an answer') from None
    return replace(found, figures=figures, number=number, stamp=stamp)
