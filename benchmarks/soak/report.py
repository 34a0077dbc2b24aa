# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a soak, docs/reliability.md: what was seen in, Markdown out."""

from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

from matplotlib.figure import Figure
import numpy as np
from rrth_planner.io.replaced_file import replace_file
from rrth_planner.reproduction.statistics import markdown_table

from benchmarks.common.real_time import scheduling
from benchmarks.common.standstill import Standstills
from benchmarks.common.task import origin
from benchmarks.soak.flood import FloodRecord
from benchmarks.soak.judge import name_of
from benchmarks.soak.looks import heard_by, Look, losses
from benchmarks.soak.monitor import MonitorRecord
from benchmarks.soak.people import PersonRecord
from benchmarks.soak.plans import PlansRecord
from benchmarks.soak.targets import (
    flood_target,
    monitor_targets,
    MOST_AGE,
    people_targets,
    plan_targets,
    running_target,
)

# For so long after a hand came that was missed it is said whether the machine ran [ns].
AFTERWARDS = 1_000_000_000
# Of what may happen often the worst are listed.
MOST_LISTED = 10
# Standstills of the machine that are listed with their time of day.
MOST_STANDSTILLS = 40
HEADER = ('what', 'target', 'measured', 'met')
PICTURE = 'memory.png'
METHOD = """\
- **Without separation**, all of this: it shows what planning and monitor do by themselves. With
  separation, the default, an arm is mostly too slow beside a person to come near him: what it
  does then is in [separation.md](separation.md#how-it-was-tested).
- **Plans**: the planner node is a process of its own, with `replan:=false`. The client
  publishes the body at 100 Hz from a thread, boxes that sway at no more than 5 cm/s, limbs
  behind the trunk, a new wearer every 1,000 plans. It asks back to back, each time for another
  free start, at rest, and another target; one in ten is so near that it may be out of reach. A
  call without an answer for 10 s counts as unanswered.
- **Checked** is every trajectory that was published, stops too, by plain numpy that
  shares nothing with the planner: the curve that a controller interpolates, every 5 ms
  and, each hundredth, every 0.5 ms, against the boxes grown by the margin of 2 cm, 1 m of the
  ray included. It counts as free where it keeps the margin from the newest body that was sent
  before the planner's own time of publication, or from the one before it, which may have been
  in transit.
- **Memory** is the resident set of the node every 20 plans; growth is the most after the first
  tenth of the samples less what it was then.
- **Hands**: planner and playback run as processes. While a motion runs a cube appears where a
  bar of the arm or its ray is about to come, 0.05 s to 1.5 s ahead. The arm's joint states are
  checked against the boxes without any margin until the arm is at rest. The time from body to
  stop measured by the client counts from the first body with the hand, even where going on was
  less bad for a while; the node's own counts from when the middleware received the body that
  required the stop, to when the trajectory was published.
- `--awake`: a process of idle priority keeps each processor out of idle states, as `idle=poll`
  of the kernel does. `--alone`: the planner node runs on the last processor, all else on the
  others, as with `taskset`; without, all run where the system puts them.
- **Recorded people** (one comes with the package) are played back and forth, as 60 bodies a second
  with the lifetime and the stamps that `wearer` gives them. The arm is asked for targets low in
  front, one after the other: aimed in time is a request after which the arm rests and aims
  within 6 s. Its joint states, at 100 Hz while it moves, are checked against the boxes of that
  time: contacts of the bars, without margin, and how long the first metre of the ray crosses a
  box.
- **Flooded**: another process repeats one message 2,000 times a second while the client asks
  for plans from where the arm is to a target, 20 ms after each answer."""


def report(
    plans: PlansRecord | None,
    monitor: MonitorRecord | None,
    command: str,
    remark: str = '',
    still: Standstills | None = None,
    floods: Sequence[FloodRecord] = (),
    people: Sequence[PersonRecord] = (),
) -> str:
    """Return the report in Markdown; a part that was not run is left out."""
    made = origin()
    commit = f', commit {made["commit"]}' if made['commit'] else ''
    brakes = [brake for part in (plans, monitor) if part for brake in part.brakes]
    lines = [
        *(plan_targets(plans) if plans else []),
        *(monitor_targets(monitor) if monitor else []),
        *([running_target(brakes, still)] if brakes and still else []),
        *([flood_target(floods)] if floods else []),
        *(people_targets(people) if people else []),
    ]
    parts = [
        '# Reliability',
        f'Written by `{command}`; do not edit.\n{made["machine"]} ({made["n_cores"]} cores); '
        f'Python {made["python_version"]}, numpy {made["numpy_version"]}, numba '
        f'{made["numba_version"]}{commit}. Client and nodes run {scheduling()}.',
        *(
            ['**Interrupted**: these are the figures up to then.']
            if any(part and part.is_interrupted for part in (plans, monitor, *floods, *people))
            else []
        ),
        *([still.sentence()] if still else []),
        *([remark] if remark else []),
        '## Targets',
        markdown_table(HEADER, lines),
    ]
    if plans:
        parts += ['## Plans round a body that moves', _plans_text(plans, still)]
        parts += [f'![Memory of the planner node](images/reliability/{PICTURE})']
    if monitor:
        parts += ['## Hands in the path of running motions', _monitor_text(monitor, still)]
    if floods:
        parts += ['## Topics that are flooded', _flood_text(floods)]
    if people:
        parts += ['## Recorded people', _people_text(people)]
    if still and len(still.begins):
        parts += ['## Standstills of the machine', _standstill_text(still)]
    return '\n\n'.join([*parts, '## How this is measured', METHOD]) + '\n'


def _plans_text(plans: PlansRecord, still: Standstills | None) -> str:
    codes = [[code, str(n), plans.examples.get(code, '')] for code, n in plans.codes.most_common()]
    verdicts = [[name_of(verdict), str(n)] for verdict, n in sorted(plans.verdicts.items())]
    gaps = np.array(plans.gaps or [np.nan]) * 1e3
    return '\n\n'.join(
        [
            f'{plans.n_asked} requests in {plans.elapsed / 60:.1f} min, while {plans.n_sent} '
            f'bodies were sent, median {np.median(gaps):.2f} ms and at most {gaps.max():.1f} ms '
            f'apart; {plans.n_motions} trajectories were published.',
            markdown_table(('answer', 'requests', 'the last one'), codes),
            markdown_table(('verdict', 'trajectories'), verdicts),
            *(
                f'- {word}: published {", ".join(f"{1e3 * age:.1f}" for age in ages)} ms after '
                'the bodies before it'
                + _stillness(still, published - round(1e9 * max(ages[:2], default=0.0)), published)
                for word, published, ages in plans.suspects
            ),
            *_lateness(plans, still),
            markdown_table(
                ('time [ms]', 'p50', 'p90', 'p99', 'most'),
                [['call, measured by its client', *_percentiles(np.array(plans.calls) * 1e3)]],
            ),
            *(f'- {k}: {v}' for k, v in plans.figures.items() if k in ('fail-safe stops',)),
        ]
    )


def _lateness(plans: PlansRecord, still: Standstills | None) -> list[str]:
    """Return lines that say when the body was old, and when bodies were lost."""
    old = [look for look in plans.looks if look.age >= MOST_AGE]
    ran = [look for look in old if look.age - _still_before(look, still) >= MOST_AGE]
    lost = losses(plans.looks, plans.n_sent - heard_by(plans.figures))
    lines = [
        f'- the body was {1e3 * look.age:.1f} ms old'
        + _stillness(still, look.time - round(1e9 * look.age), look.time)
        for look in sorted(ran, key=lambda look: -look.age)[:MOST_LISTED]
    ]
    lines += [
        f'- bodies were lost: {loss.n}, between two messages of diagnostics'
        + _stillness(still, loss.begin, loss.end)
        for loss in lost
    ]
    if old:
        lines.insert(
            0,
            f'- {len(old)} messages of diagnostics said that the body was {1e3 * MOST_AGE:.0f} ms '
            f'old or older, {len(old) - len(ran)} of them only because the machine stalled',
        )
    return ['\n'.join(lines)] if lines else []


def _still_before(look: Look, still: Standstills | None) -> float:
    """Return for how long the machine stood still while the body of a look got old [s]."""
    begin = look.time - round(1e9 * look.age)
    return 0.0 if still is None else 1e-9 * still.within(begin, look.time)


def _monitor_text(monitor: MonitorRecord, still: Standstills | None) -> str:
    shown = [e for e in monitor.episodes if e.published]
    sent, came = (
        np.array([(e.published[0][k] - e.body.sent) * 1e-6 for e in shown]) for k in (0, 1)
    )
    counts = [[word, str(n)] for word, n in (*monitor.outcomes.items(), *monitor.said.items())]
    figures = [
        [name, monitor.figures.get(name, '')]
        for name in ('remaining motion checks', 'fail-safe stops')
    ]
    return '\n\n'.join(
        [
            f'{len(monitor.episodes)} hands in {monitor.n_motions} motions.',
            markdown_table(('what', 'times'), counts),
            *(
                f'- {word}: {sentence}{_stillness(still, sent_at, sent_at + AFTERWARDS)}'
                for word, sent_at, sentence in monitor.suspects
            ),
            markdown_table(("the node's own figures", ''), figures),
            markdown_table(
                ('time [ms]', 'p50', 'p90', 'p99', 'most'),
                [
                    ['body sent to fail-safe stop published', *_percentiles(sent)],
                    ['body sent to fail-safe stop received', *_percentiles(came)],
                ],
            ),
        ]
    )


def _flood_text(floods: Sequence[FloodRecord]) -> str:
    rows = [
        [flood.topic, f'{flood.rate:.0f}', *_percentiles(np.array(flood.calls) * 1e3)]
        for flood in floods
    ]
    return markdown_table(('topic', 'messages [1/s]', *('p50', 'p90', 'p99', 'most [ms]')), rows)


def _people_text(people: Sequence[PersonRecord]) -> str:
    rows = [
        [
            person.name,
            f'{person.rate:g}',
            f'{person.seconds:.0f}',
            f'{person.n_aimed} of {person.n_requests}',
            f'{60.0 * person.n_aimed / max(person.seconds, 1e-9):.0f}',
            str(person.n_contacts),
            f'{person.ray_seconds:.2f}',
            str(len(person.brakes)),
            ', '.join(f'{word} {n}' for word, n in person.answers.most_common()),
        ]
        for person in people
    ]
    head = ('person', 'rate', 'time [s]', 'aimed in time', 'targets per minute', 'contacts')
    table = markdown_table((*head, 'ray crossed [s]', 'stops', 'answers'), rows)
    contacts = [f'- {person.name}, {words}' for person in people for words in person.contacts]
    return '\n\n'.join([table, *(['\n'.join(contacts)] if contacts else [])])


def _standstill_text(still: Standstills) -> str:
    rows = [
        [_time_of_day(begin), f'{1e-6 * (end - begin):.1f}']
        for begin, end in still.longest(MOST_STANDSTILLS)
    ]
    what = f'The {len(rows)} longest of {len(still.begins)}, in their order'
    return f'{what}:\n\n{markdown_table(("began (UTC)", "lasted [ms]"), rows)}'


def _time_of_day(time: int) -> str:
    """Return a time of the system's clock [ns] as time of day, to the millisecond."""
    moment = datetime.fromtimestamp(time // 1_000_000_000, timezone.utc)
    return f'{moment:%H:%M:%S}.{time // 1_000_000 % 1000:03d}'


def _stillness(still: Standstills | None, begin: int, end: int) -> str:
    """Return for how long the machine stood still between two times [ns]; empty: unknown."""
    if still is None:
        return ''
    within, span = 1e-6 * still.within(begin, end), 1e-6 * (end - begin)
    since = _time_of_day(begin)
    return f' (from {since} on; the machine stalled for {within:.1f} of {span:.1f} ms)'


def _percentiles(values: np.ndarray) -> list[str]:
    if not len(values):
        return ['-'] * 4
    return [f'{value:.2f}' for value in np.percentile(values, (50, 90, 99, 100))]


def draw_memory(memory: Sequence[tuple[float, float]], folder: Path) -> None:
    """Draw the memory of the node over time."""
    times, values = np.array(memory).T
    figure = Figure(figsize=(7.0, 3.2), layout='constrained')
    panel = figure.subplots()
    panel.plot(times / 60.0, values, linewidth=1.0)
    panel.axvline(times[len(times) // 10] / 60.0, color='grey', linestyle='--', linewidth=0.9)
    panel.set(xlabel='time [min]', ylabel='resident memory [MB]', ylim=(0.0, 1.15 * values.max()))
    panel.spines[['top', 'right']].set_visible(False)
    panel.grid(alpha=0.25, linewidth=0.6)
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / PICTURE, lambda p: figure.savefig(p, dpi=130, format='png'))
