# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The parts of pages that are made from the code: a line of a page says where, and what.

`<!-- generated: parameters rrth_planner -->` becomes a table of the parameters of that node, as
they are declared. What is generated is Markdown, which is then read as the rest of the page. Where
`<!-- end -->` follows, the page itself holds it too, for those who browse the files: run as a
script, this writes it anew.
"""

import argparse
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib import import_module, util
from pathlib import Path
import re
import subprocess
import sys
from typing import Any
from unittest import mock

import numpy as np
import rrth_planner
from rrth_planner.cli import rrth
from rrth_planner.model.body_reach import BODY_REACH, lines_shown
from rrth_planner.model.separation import (
    ANY_OTHER,
    BODY_SPEEDS,
    governing_reach,
    reach_at,
    reach_of,
    SeparationRules,
)
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError

ROOT = Path(__file__).resolve().parents[2]
# How annotations of arrays are written out.
ARRAY = re.compile(
    r'~?(?:numpy\.)?ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], ~?(?:numpy\.)?dtype\[[~\w.]+\]\]'
)
# How far parts get is shown for these times [s].
REACH_TIMES = np.array([0.05, 0.1, 0.2, 0.3, 0.5, 1.0])
LINE = re.compile(
    r'^<!-- generated: (\w+) ?(\w*) -->$(\n(?:(?!<!-- ).*\n)*<!-- end -->$)?', re.MULTILINE
)


def setup(app: Sphinx) -> dict[str, Any]:
    """Have pages read with what is generated in place of the lines that ask for it."""
    if util.find_spec('rclpy') is None:
        raise ExtensionError(
            'rclpy: not installed, expected ROS 2 Jazzy, whose messages the declarations of '
            'parameters, codes and topics need; `./run docs` brings it'
        )
    app.connect('source-read', _replace)
    app.connect('env-get-outdated', _pages)
    app.setup_extension('sphinx.ext.autodoc')
    app.connect('autodoc-process-signature', _short)
    return {'parallel_read_safe': True, 'env_version': 1}


def _replace(_: Sphinx, page: str, source: list[str]) -> None:
    source[0] = LINE.sub(lambda match: generated(match[1], match[2], page), source[0])


def _pages(_: Sphinx, env: BuildEnvironment, *__: set[str]) -> list[str]:
    """Return the pages that are read at each build: the code may have changed."""
    return [
        page
        for page in env.all_docs
        if LINE.search(env.doc2path(page).read_text(encoding='utf-8'))
    ]


def _short(*given: Any) -> tuple[str | None, ...]:
    """Return signature and result with arrays by their name; the text has shapes and units."""
    return tuple(text and ARRAY.sub('ndarray', text) for text in given[-2:])


def generated(what: str, of: str, page: str = '') -> str:
    """Return the Markdown of one of `PARTS`, or raise ExtensionError where there is none."""
    if what not in PARTS:
        raise ExtensionError(f'{page}: "{what}", expected one of {", ".join(PARTS)}')
    return PARTS[what](*([of] if of else []))


def written(text: str) -> str:
    """Return a page with what it holds of the generated parts as it is now."""

    def part(match: re.Match[str]) -> str:
        line = match[0].partition('\n')[0]
        if match[3] is None:
            return line
        return f'{line}\n\n{generated(match[1], match[2])}\n\n<!-- end -->'

    return LINE.sub(part, text)


def settings_of(node: str) -> tuple[Any, ...]:
    """Return the parameters of a node by its name, as it declares them for the arm by default."""
    from rrth_planner.io.arm_file import load_arm
    from rrth_planner.ros.interface import (
        parameters,
        playback_parameters,
        simulation_parameters,
        tracker_parameters,
    )

    return {
        'rrth_planner': (parameters.ARM, *parameters.declared(load_arm().dof)),
        'arm_playback': playback_parameters.SETTINGS,
        'arm_simulation': simulation_parameters.SETTINGS,
        'body_boxes_node': tracker_parameters.SETTINGS,
    }[node]


def parsers() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Yield each command of `rrth`, and each of its own commands, with its parser."""
    yield 'rrth', _parser_of(())
    for name in rrth.COMMANDS:
        parser = _parser_of((name,))
        yield name, parser
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                yield from ((f'{name} {word}', sub) for word, sub in action.choices.items())


class _Asked(Exception):
    """Carries the parser that was asked for its help."""


def _parser_of(words: tuple[str, ...]) -> argparse.ArgumentParser:
    """Return the parser that prints the help of a command, whichever module has it."""

    def capture(parser: argparse.ArgumentParser, *_: Any) -> None:
        raise _Asked(parser)

    with (
        mock.patch.object(argparse.ArgumentParser, 'print_help', capture),
        mock.patch.object(sys, 'argv', ['rrth']),
        suppress(SystemExit),
    ):
        try:
            rrth.main([*words, '--help'])
        except _Asked as asked:
            return asked.args[0]
    raise ExtensionError(f'rrth {" ".join(words)} --help: no help, expected that of a parser')


def _parameters(node: str) -> str:
    return _table(
        ('parameter', 'default', 'unit', 'range', 'meaning'),
        (
            (
                f'`{s.name}`',
                _shown(s.default),
                s.unit,
                _range(s),
                f'{s.description}{"; fixed at the start" if s.is_read_only else ""}',
            )
            for s in settings_of(node)
        ),
    )


def _range(setting: Any) -> str:
    """Return the range of a setting; there is none of a text, nor of true and false."""
    if setting.low is None or isinstance(setting.default, bool):
        return ''
    return f'{setting.low:.10g} to {setting.high:.10g}'


def _shown(default: Any) -> str:
    """Return a default as a file of parameters has it."""
    if isinstance(default, list):
        words = ', '.join(_shown(value).strip('`') for value in default)
        return f'`[{words}]`'
    if isinstance(default, bool):
        return f'`{str(default).lower()}`'
    if isinstance(default, float):
        text = f'{default:.6g}'
        return f'`{text if set(text) & set(".e") else f"{text}.0"}`'
    return f'`{default!r}`' if isinstance(default, str) else f'`{default}`'


def _codes() -> str:
    from rrth_planner.model.status import ErrorCode
    from rrth_planner.ros.messages.error_codes import MEANINGS

    return _table(
        ('code', 'number', 'when'),
        ((f'`{code.name}`', code.value, MEANINGS[code]) for code in ErrorCode),
    )


def _topics(node: str) -> str:
    from rrth_planner.ros.interface.topics import INTERFACES

    return _table(
        ('', 'name', 'type', 'only where', 'meaning'),
        (
            (
                i.direction.value,
                f'`{i.name}`',
                f'`{i.type}`',
                f'`{i.parameter}` is {" or ".join(map(_shown, i.values))}' if i.parameter else '',
                i.meaning,
            )
            for i in INTERFACES[node]
        ),
    )


def _commands() -> str:
    rows = (
        (f'[`{name}`](#{name.replace(" ", "-")})', command.summary)
        for name, command in rrth.COMMANDS.items()
    )
    return _table(('command', 'what it does'), rows)


def _helps() -> str:
    with mock.patch.dict('os.environ', {'COLUMNS': '96'}):
        return '\n\n'.join(
            f'{"#" * (2 + " ".join(name.split()).count(" "))} {name}\n\n{_text(_help(parser))}'
            for name, parser in parsers()
        )


def _help(parser: argparse.ArgumentParser) -> str:
    """Return the help of a parser, without the folder of the project on this machine."""
    return parser.format_help().replace(f'{ROOT}/', '').rstrip()


def _run() -> str:
    script = ['bash', str(ROOT / 'run'), '--help']
    return _text(subprocess.run(script, capture_output=True, text=True, check=True).stdout)


def _text(text: str) -> str:
    return f'```text\n{text.rstrip()}\n```'


def _api() -> str:
    """Return a section for each module that has public names."""
    sections = []
    for module, names in rrth_planner._PUBLIC.items():
        home = import_module(f'rrth_planner.{module}')
        about = (home.__doc__ or '').strip().split('\n\n')[0].replace('\n', ' ')
        listed = '\n\n'.join(map(_documented, sorted(names.split())))
        sections.append(f'## {module}\n\n{about}\n\n```{{eval-rst}}\n{listed}\n```')
    return '\n\n'.join(sections)


def _documented(name: str) -> str:
    is_class = isinstance(getattr(rrth_planner, name), type)
    lines = [f'.. auto{"class" if is_class else "function"}:: rrth_planner.{name}']
    return '\n'.join([*lines, '   :members:'] if is_class else lines)


def _reach() -> str:
    """Return a table of how far the parts of a body get, by default."""
    rules = SeparationRules()
    said = {words: words for words, _ in BODY_REACH if words}
    still = [words for words, speed in BODY_SPEEDS if speed == 0.0]
    said |= {still[0]: ', '.join(still), 'some thing': ANY_OTHER}
    rows = []
    for name, words in said.items():
        found = reach_at(reach_of((name,), rules), REACH_TIMES[:, None])[:, 0]
        rows.append(
            [words, lines_shown(governing_reach(rules, name)[1]), *map('{:.2f}'.format, found)]
        )
    times = [f'{time:g} s [m]' for time in REACH_TIMES]
    return _table(['part', 'lines [m], t [s]', *times], rows)


def _table(titles: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a table in Markdown; a bar within a cell would end it."""
    lines = [titles, ['---'] * len(tuple(titles)), *rows]
    return '\n'.join(
        f'| {" | ".join(str(c).replace("|", "&#124;") for c in line)} |' for line in lines
    )


PARTS: dict[str, Callable[..., str]] = {
    'parameters': _parameters,
    'codes': _codes,
    'topics': _topics,
    'commands': _commands,
    'helps': _helps,
    'run': _run,
    'api': _api,
    'reach': _reach,
}


if __name__ == '__main__':
    for page in sorted((ROOT / 'docs').rglob('*.md')):
        before = page.read_text(encoding='utf-8')
        after = written(before)
        if after != before:
            page.write_text(after, encoding='utf-8')
