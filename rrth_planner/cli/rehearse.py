# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `rehearse`: a scenario in virtual time."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from rrth_planner.cli.parsers.rehearse import parser
from rrth_planner.cli.program import run, say
from rrth_planner.io.extras import require
from rrth_planner.io.resources import resource_path
from rrth_planner.model.errors import ModelError, OptionsError

if TYPE_CHECKING:
    from rrth_planner.rehearsal.rehearsal import Rehearsal

KINDS = ('.png', '.svg', '.pdf')
DOTS_PER_INCH = 110
# Causes of lost time that are printed.
MOST_CAUSES = 8


def main(arguments: Sequence[str] | None = None) -> int:
    """Rehearse, print what was seen, and return the exit code."""
    options = parser().parse_args(arguments)
    return run('rehearse', lambda: _rehearse(options), 2)


def _rehearse(options: argparse.Namespace) -> int:
    plot: Path | None = options.plot
    if plot is not None:
        if plot.suffix.lower() not in KINDS:
            raise OptionsError(f'--plot {plot}, expected a name that ends in {", ".join(KINDS)}')
        if not plot.absolute().parent.is_dir():
            raise OptionsError(f'--plot {plot}: its folder does not exist, expected one that does')
        require('tools', 'matplotlib')
    file = _file(options.scenario)
    from rrth_planner.kernels.precompile import prepare_kernels

    prepare_kernels(partial(say, 'rehearse'))
    # Not before what it loads is compiled.
    from rrth_planner.rehearsal.rehearsal import rehearsed
    from rrth_planner.rehearsal.scenario import load_scenario

    given = ('seed', 'seconds')
    changes = {name: value for name in given if (value := getattr(options, name)) is not None}
    scenario = replace(load_scenario(file), **changes)
    found = rehearsed(scenario, is_drawn=plot is not None)
    print('\n'.join(lines_of(found)))
    if plot is not None:
        _draw(found, plot)
    return int(bool(found.testimony.sentences))


def _file(given: str) -> Path:
    """Return the file of a scenario, which is given by its path or by the name of one."""
    if Path(given).exists() or Path(given).name != given or Path(given).suffix:
        return Path(given)
    try:
        return resource_path(f'config/scenarios/{given}.yaml')
    except ModelError:
        raise OptionsError(
            f'"{given}", expected a file, or a scenario that comes along (see --help)'
        ) from None


def lines_of(found: 'Rehearsal') -> list[str]:
    """Return what is printed of a rehearsal."""
    from rrth_planner.rehearsal.world import BEGIN

    scenario, seen = found.scenario, found.testimony
    lines = [f'{scenario.about or "scenario"}: {scenario.seconds:g} s, seed {scenario.seed}', '']
    lines.append('  asked [s]  took [s]  least rate  plans  stops  what became of it')
    for one in found.pursuits:
        if one.outcome:
            what = f'{one.took:8.2f}  {one.slowest:10.2f}  {one.n_plans:5}  {one.n_stops:5}'
            why = f': {one.sentence}' if one.sentence else ''
            lines.append(f'  {one.asked - BEGIN:9.2f}  {what}  {one.outcome}{why}')
    lost = sorted(found.lost.items(), key=lambda item: -item[1])
    causes = [
        f'  {seconds:6.2f} s  {doing}{f", {cause}" if cause else ""}'
        for (doing, cause), seconds in lost[:MOST_CAUSES]
    ]
    lines += ['', 'time lost, by what the arm did, and for what:', *causes]
    lines += ['', 'contacts of the arm with the wearer as he really is:']
    for word in ('faster', 'slower', 'at rest'):
        kept, broken = seen.contacts[word, True], seen.contacts[word, False]
        lines.append(
            f'  {word:8} {kept + broken:4}, {broken} with parts that got further than assumed'
        )
    lines += [f'  {sentence}' for sentence in seen.sentences]
    lines += [
        f'pointing ray across a part: {seen.ray_seconds:.2f} s of {seen.moving_seconds:.1f} s in '
        'motion',
        f'{found.n_events} events, {found.n_commands} commands, {found.n_stops} stops',
        f'digest {found.digest}',
    ]
    return lines


def _draw(found: 'Rehearsal', output: Path) -> None:
    from rrth_planner.rehearsal.world import BEGIN
    from rrth_planner.visualization.rehearsal_figure import Course, rehearsal_figure

    scenario = found.scenario
    course = Course(
        title=f'{scenario.about}, seed {scenario.seed}',
        times=[glance.time - BEGIN for glance in found.glances],
        states=[glance.state.value for glance in found.glances],
        rates=[glance.rate for glance in found.glances],
        distances=[(time - BEGIN, gap) for time, gap in found.testimony.nearest],
        targets=[(one.asked - BEGIN, one.ended - BEGIN, one.outcome) for one in found.pursuits],
    )
    try:
        rehearsal_figure(course).savefig(output, dpi=DOTS_PER_INCH)
    except OSError as problem:
        raise OptionsError(f'{output}: {problem.strerror}, expected a writable file') from problem
    print(output)


if __name__ == '__main__':
    sys.exit(main())
