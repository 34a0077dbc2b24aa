# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Soaks the nodes, body moving at 100 Hz, and writes docs/reliability.md with its picture."""

import argparse
from collections.abc import Callable, Sequence
from contextlib import nullcontext
import gc
from importlib.util import find_spec
from pathlib import Path
import sys
import tempfile

NEEDED = ('rclpy', 'psutil', 'tqdm', 'matplotlib', 'fcl')
MISSING = """{}: not installed, and nothing can be soaked without; install what it needs by
    ./run exec python -m pip install -r requirements/benchmark.txt"""
PLANS, QUICK = 100_000, 500
HANDS, QUICK_HANDS = 300, 15
FLOODED, QUICK_FLOODED = 200, 20
PEOPLE, QUICK_PEOPLE = 40.0, 10.0
FOREVER = 1e9
SWITCH_INTERVAL = 2e-4


def main(arguments: Sequence[str] | None = None, find: Callable[[str], object] = find_spec) -> int:
    """Soak, then write the report; an interruption leaves a report of what was seen."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options = _parser().parse_args(arguments)
    missing = [name for name in NEEDED if find(name) is None]
    if missing:
        print(MISSING.format(', '.join(missing)), file=sys.stderr)
        return 2
    from rrth_planner.model.errors import RrthError

    try:
        return _run(options)
    except (RrthError, OSError) as problem:
        print(f'soak: {problem}', file=sys.stderr)
        return 1


def _run(options: argparse.Namespace) -> int:
    from rrth_planner.io.replaced_file import replace_file

    from benchmarks.common.processors import OnEachProcessor, stay_awake
    from benchmarks.common.real_time import is_real_time
    from benchmarks.common.sections import section_of, VIRTUAL_TIME, with_section
    from benchmarks.common.standstill import StandstillWatch
    from benchmarks.people.beside import STOPS
    from benchmarks.soak.flood import FloodRecord, soak_floods
    from benchmarks.soak.monitor import soak_monitor
    from benchmarks.soak.people import PersonRecord, soak_people
    from benchmarks.soak.plans import soak_plans
    from benchmarks.soak.report import draw_memory, report

    # What lives as long as the client, and threads that hand the interpreter to each other.
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(SWITCH_INTERVAL)
    n_plans = QUICK if options.quick else options.plans
    n_hands = QUICK_HANDS if options.quick else options.hands
    n_flooded = QUICK_FLOODED if options.quick else options.flooded
    seconds = QUICK_PEOPLE if options.quick else options.people
    longest = 60.0 * options.minutes if options.minutes else FOREVER
    plans = monitor = None
    floods: list[FloodRecord] = []
    people: list[PersonRecord] = []
    watch = StandstillWatch()
    with (
        OnEachProcessor(stay_awake) if options.awake else nullcontext(),
        # Only what goes before all others is late for no other reason.
        watch if is_real_time() else nullcontext(),
        tempfile.TemporaryDirectory(prefix='rrth-soak-') as name,
    ):
        if n_plans:
            plans = soak_plans(n_plans, longest, Path(name), is_alone=options.alone)
        if n_hands and not (plans and plans.is_interrupted):
            monitor = soak_monitor(n_hands, longest, Path(name), is_alone=options.alone)
        parts = [part for part in (plans, monitor) if part]
        if n_flooded and not any(part.is_interrupted for part in parts):
            floods = soak_floods(n_flooded, Path(name), is_alone=options.alone)
        if seconds and not any(part.is_interrupted for part in (*parts, *floods)):
            people = soak_people(options.recordings, seconds, Path(name))
    default = Path('build/reliability.md' if options.quick else 'docs/reliability.md')
    target = options.output or default
    target.parent.mkdir(parents=True, exist_ok=True)
    if plans and plans.memory:
        draw_memory(plans.memory, target.parent / 'images' / 'reliability')
    text = report(plans, monitor, _command(options), options.remark, watch.found, floods, people)
    before = target.read_text(encoding='utf-8') if target.exists() else ''
    for title in (f'{VIRTUAL_TIME}, stops {stop}' for stop in STOPS):
        if kept := section_of(before, title):
            text = with_section(text, title, kept)
    replace_file(target, lambda path: path.write_text(text, encoding='utf-8'))
    print(text.partition('## Plans')[0])
    print(f'{target}: written')
    return 130 if any(part.is_interrupted for part in (*parts, *floods, *people)) else 0


def _command(options: argparse.Namespace) -> str:
    """Return the command without files, which belong to one machine."""
    parts = ['python -m benchmarks.soak']
    parts += ['--quick'] if options.quick else []
    parts += [f'--plans {options.plans}'] if options.plans != PLANS else []
    parts += [f'--hands {options.hands}'] if options.hands != HANDS else []
    parts += [f'--flooded {options.flooded}'] if options.flooded != FLOODED else []
    parts += [f'--people {options.people:g}'] if options.people != PEOPLE else []
    parts += ['--recordings ...'] if options.recordings else []
    parts += ['--awake'] if options.awake else []
    parts += ['--alone'] if options.alone else []
    parts += [f'--minutes {options.minutes:g}'] if options.minutes else []
    return ' '.join(parts)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='python -m benchmarks.soak', description=__doc__)
    parser.add_argument(
        '--quick',
        action='store_true',
        help=f'{QUICK} plans, {QUICK_HANDS} hands, {QUICK_FLOODED} requests, {QUICK_PEOPLE:g} s a '
        'person: three minutes',
    )
    parser.add_argument(
        '--plans', type=_count, default=PLANS, metavar='N', help=f'how many ({PLANS}; 0: none)'
    )
    parser.add_argument(
        '--hands',
        type=_count,
        default=HANDS,
        metavar='N',
        help=f'held into the way of running motions ({HANDS}; 0: none)',
    )
    parser.add_argument(
        '--flooded',
        type=_count,
        default=FLOODED,
        metavar='N',
        help=f'requests while a topic is flooded, for each ({FLOODED}; 0: none)',
    )
    parser.add_argument(
        '--people',
        type=float,
        default=PEOPLE,
        metavar='S',
        help=f'how long recorded people wear the arm, each [s] ({PEOPLE:g}; 0: none)',
    )
    parser.add_argument(
        '--recordings',
        type=Path,
        nargs='*',
        default=[],
        metavar='FILE',
        help='further recordings, in the layouts of CMU or TUM',
    )
    parser.add_argument('--minutes', type=float, help='the longest time for plans, and for hands')
    parser.add_argument(
        '--awake',
        action='store_true',
        help='keep the processors from sleeping, as `idle=poll` of the kernel does',
    )
    parser.add_argument(
        '--alone',
        action='store_true',
        help='keep the last processor for the planner node, as `taskset` does',
    )
    parser.add_argument(
        '--remark', default='', metavar='TEXT', help='to stand in the report, of the machine say'
    )
    parser.add_argument(
        '--output', type=Path, help='the report (docs/reliability.md; --quick: in build/)'
    )
    return parser


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text}: expected 0 or more')
    return value


if __name__ == '__main__':
    sys.exit(main())
