# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a soak, docs/reliability.md: what was seen in, Markdown out."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure
import numpy as np
from rrth_planner.campaign.statistics import markdown_table
from rrth_planner.campaign.store import replace_file

from benchmarks import soak_contacts as contacts
from benchmarks.real_time import scheduling
from benchmarks.soak_guard import GuardRecord
from benchmarks.soak_judge import FREE, growth_of, name_of
from benchmarks.soak_plans import PlansRecord
from benchmarks.standstill import Standstills
from benchmarks.task import origin

# A brake came while the machine ran where nothing stood still from so long before its body, whose
# time is known from the log a little late, until so long after [ns].
EARLIER, MOMENT = 5_000_000, 5_000_000
# For so long after a hand came that was missed it is said whether the machine ran [ns].
AFTERWARDS = 1_000_000_000
HEADER = ('what', 'target', 'measured', 'met')
PICTURE = 'memory.png'
MOST_GROWTH, MOST_AGE, RECERTIFIED, BRAKED = 5.0, 0.05, 0.3, 5.0
METHOD = """\
- **Plans**: the planner node is a process of its own, with `replan:=false`. The client
  publishes the body at 100 Hz from a thread, boxes that sway at no more than 5 cm/s, limbs
  behind the trunk, a new wearer every 1,000 plans. It asks back to back, each time for another
  free start, at rest, and another target; one in ten is so near that it may be out of reach. A
  call without an answer for 10 s counts as unanswered.
- **Judged** is every trajectory that was published, braking ones too, by plain numpy that
  shares nothing with the planner: the curve that a controller runs by the message, every 5 ms
  and, each hundredth, every 0.5 ms, against the boxes grown by the margin of 2 cm, 1 m of the
  ray included. It counts as free where it keeps the margin from the newest body that was sent
  before the planner's own time of publication, or from the one before it, which may have been
  on its way.
- **Memory** is the resident set of the node every 20 plans; growth is the most after the first
  tenth of the samples less what it was then.
- **Hands**: planner and playback run as processes. While a motion runs a cube appears where a
  bar of the arm or its ray is about to come, 0.05 s to 1.5 s ahead. The arm's joint states are
  judged against the boxes without any margin until the arm rests. The time from the body to the
  brake as the client sees it counts from the first body with the hand, even where going on was
  less bad for a while; the node's own counts from when the middleware received the body that it
  braked for, to when the trajectory was published."""


def report(
    plans: PlansRecord | None,
    guard: GuardRecord | None,
    command: str,
    remark: str = '',
    still: Standstills | None = None,
) -> str:
    """Return the report in Markdown; a part that was not run is left out."""
    made = origin()
    commit = f', commit {made["commit"]}' if made['commit'] else ''
    brakes = [brake for part in (plans, guard) if part for brake in part.brakes]
    lines = [
        *(plan_targets(plans) if plans else []),
        *(guard_targets(guard) if guard else []),
        *([_running_line(brakes, still)] if brakes and still else []),
    ]
    parts = [
        '# Reliability',
        f'Written by `{command}`; do not edit.\n{made["machine"]} ({made["n_cores"]} cores); '
        f'Python {made["python_version"]}, numpy {made["numpy_version"]}, numba '
        f'{made["numba_version"]}{commit}. Client and nodes run {scheduling()}.',
        *(
            ['**Interrupted**: what stands here is what had been seen until then.']
            if any(part and part.is_interrupted for part in (plans, guard))
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
    if guard:
        parts += ['## Hands in the way of running motions', _guard_text(guard, still)]
    return '\n\n'.join([*parts, '## How this is measured', METHOD]) + '\n'


def plan_targets(plans: PlansRecord) -> list[list[str]]:
    """Return the lines of targets of the plans."""
    unsafe = sum(n for (word, _), n in plans.verdicts.items() if word != FREE)
    n_judged = sum(plans.verdicts.values())
    heard = int(plans.figures.get('good messages, body', 0))
    refused = sum(int(v) for k, v in plans.figures.items() if k.startswith('refused messages'))
    growth = growth_of([m for _, m in plans.memory]).growth if plans.memory else np.nan
    age = max(plans.ages, default=np.nan)
    return [
        _line('calls without an answer', '0', plans.n_unanswered, plans.n_unanswered == 0),
        _line(
            'published motions that are not free of the body',
            '0',
            f'{unsafe} of {n_judged} judged',
            unsafe == 0 and n_judged == plans.n_motions,
        ),
        _line(
            'bodies that were sent and not heard, or refused',
            '0',
            f'{plans.n_sent - heard} of {plans.n_sent}, {refused} messages refused',
            plans.n_sent == heard and refused == 0,
        ),
        _line('age of the body, at most', '50 ms', f'{1e3 * age:.0f} ms', age < MOST_AGE),
        _line('memory after the first tenth', '< 5 MB', f'{growth:+.2f} MB', growth < MOST_GROWTH),
        _brake_line('body to braking trajectory in the busy node, p99', plans.figures),
    ]


def guard_targets(guard: GuardRecord) -> list[list[str]]:
    """Return the lines of targets of the guard."""
    held = _milliseconds(guard.figures.get('motions held against a new body', ''), 'p50')
    bad = guard.outcomes[contacts.TOUCHED] + guard.outcomes[contacts.MISSED]
    return [
        _line(
            'holding a running motion against a body, median',
            f'{RECERTIFIED} ms',
            f'{held:.3f} ms',
            held <= RECERTIFIED,
        ),
        _brake_line('body to braking trajectory in the node, p99', guard.figures),
        _line('contacts that braking could have avoided', '0', bad, bad == 0),
        _line('arm that cannot go on', 'never', guard.stuck or 'never', not guard.stuck),
    ]


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
            markdown_table(
                ('time [ms]', 'p50', 'p90', 'p99', 'most'),
                [['call, as its client sees it', *_percentiles(np.array(plans.calls) * 1e3)]],
            ),
            *(f'- {k}: {v}' for k, v in plans.figures.items() if k in ('brakes',)),
        ]
    )


def _guard_text(guard: GuardRecord, still: Standstills | None) -> str:
    shown = [e for e in guard.episodes if e.published]
    sent, came = (
        np.array([(e.published[0][k] - e.body.sent) * 1e-6 for e in shown]) for k in (0, 1)
    )
    counts = [[word, str(n)] for word, n in (*guard.outcomes.items(), *guard.said.items())]
    figures = [
        [name, guard.figures.get(name, '')]
        for name in ('motions held against a new body', 'brakes')
    ]
    return '\n\n'.join(
        [
            f'{len(guard.episodes)} hands in {guard.n_motions} motions.',
            markdown_table(('what', 'times'), counts),
            *(
                f'- {word}: the hand came {phase:.3f} s after the begin of a motion of '
                f'{duration:.3f} s{_stillness(still, body.sent, body.sent + AFTERWARDS)}'
                for word, body, phase, duration in guard.suspects
            ),
            markdown_table(("the node's own figures", ''), figures),
            markdown_table(
                ('time [ms]', 'p50', 'p90', 'p99', 'most'),
                [
                    ['body sent to braking trajectory published', *_percentiles(sent)],
                    ['body sent to braking trajectory received', *_percentiles(came)],
                ],
            ),
        ]
    )


def _running_line(brakes: Sequence[tuple[int, float]], still: Standstills) -> list[str]:
    """Return the line of the target of the brakes while the machine ran."""
    # Whether it did is asked of the same time of each, however long it took.
    runs = [took for came, took in brakes if not still.within(came - EARLIER, came + MOMENT)]
    p99 = float(np.percentile(runs, 99, method='higher')) if runs else np.nan
    return _line(
        'body to braking trajectory in either part, p99, of those that came while the machine ran',
        f'{BRAKED:g} ms',
        f'{p99:.2f} ms, {len(runs)} of {len(brakes)} times',
        p99 <= BRAKED,
    )


def _stillness(still: Standstills | None, begin: int, end: int) -> str:
    """Return for how long the machine stood still between two times [ns]; empty: unknown."""
    if still is None:
        return ''
    span = 1e-6 * (end - begin)
    return f' (the machine stood still for {1e-6 * still.within(begin, end):.1f} of {span:.1f} ms)'


def _percentiles(values: np.ndarray) -> list[str]:
    if not len(values):
        return ['-'] * 4
    return [f'{value:.2f}' for value in np.percentile(values, (50, 90, 99, 100))]


def _milliseconds(figures: str, name: str) -> float:
    found = [part.split()[-2] for part in figures.split(', ') if part.startswith(name)]
    return float(found[0]) if found else float('nan')


def _brake_line(what: str, figures: Mapping[str, str]) -> list[str]:
    """Return the line of the target of the brakes."""
    braked = figures.get('brakes', '')
    p99 = _milliseconds(braked, 'p99')
    n_brakes = braked.split(',')[0]
    # Where nothing was measured nothing is met.
    is_met = n_brakes != '0' and p99 <= BRAKED
    return _line(what, f'{BRAKED:g} ms', f'{p99:.2f} ms, {n_brakes} times', is_met)


def _line(what: str, target: str, measured: object, is_met: bool) -> list[str]:
    return [what, target, str(measured), 'yes' if is_met else '**no**']


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
