# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is written about how steadily the playback says where the arm is."""

from collections.abc import Mapping

from rrth_planner.reproduction.statistics import markdown_table

from benchmarks.common.real_time import scheduling
from benchmarks.common.task import origin

HEADER = ('Hz', 'arm', 'by', 'p50 [ms]', 'p99 [ms]', 'max [ms]', 'missed', 'of')
COUNTS = ('missed', 'intervals')
METHOD = """\
- **published**: by the stamps of `joint_states`; **received**: when a subscriber in another
  process got them. Figures are of |interval - period|; missed are periods without a message.
- **bare loop**: a Python loop that does nothing but wait for each period, measured just before: no
  program in Python is steadier on this machine.
- **positions**: how far the instant that a position belongs to is from its stamp, while the first
  joint swings back and forth. A message that comes late has the position at its stamp."""


def page(
    measured: Mapping[float, Mapping[str, Mapping[str, Mapping[str, float]]]],
    command: str,
    seconds: float,
) -> str:
    """
    Return the page in Markdown.

    Parameters
    ----------
    measured : mapping
        By the rate [Hz], what `jitter.measure` returns.
    command : str
        The command that wrote it.
    seconds : float
        How long each figure was watched [s].

    """
    made = origin()
    commit = f', commit {made["commit"]}' if made['commit'] else ''
    lines = [
        (f'{rate:g}', arm, by, *_numbers(row, ('p50', 'p99', 'max'), 3), *_numbers(row, COUNTS, 0))
        for rate, figures in measured.items()
        for arm, kinds in figures.items()
        for by, row in kinds.items()
    ]
    parts = [
        '# How steadily the playback publishes',
        f'Written by `{command}`; do not edit.\n{made["machine"]} ({made["n_cores"]} cores); '
        f'Python {made["python_version"]}{commit}. Subscriber and node run {scheduling()}; '
        f'{seconds:g} s a figure.',
        markdown_table(HEADER, lines),
        METHOD,
    ]
    return '\n\n'.join(parts) + '\n'


def _numbers(row: Mapping[str, float], keys: tuple[str, ...], digits: int) -> list[str]:
    return [f'{row[key]:.{digits}f}' if key in row else '–' for key in keys]
