# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a soak is held to: a line of the table of targets for each."""

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.common.standstill import Standstills
from benchmarks.soak import contacts
from benchmarks.soak.flood import FloodRecord
from benchmarks.soak.judge import FREE, growth_of
from benchmarks.soak.looks import heard_by
from benchmarks.soak.monitor import MonitorRecord
from benchmarks.soak.people import PersonRecord
from benchmarks.soak.plans import PlansRecord

# A brake came while the machine ran where nothing stood still from so long before its body, whose
# time is known from the log a little late, until so long after [ns].
EARLIER, MOMENT = 5_000_000, 5_000_000
# Shares of the time that the ray may cross a recorded person, and of the requests that succeed.
CROSSED, AIMED = 0.3 / 240.0, 0.95
MOST_GROWTH, MOST_AGE, RECERTIFIED, BRAKED, ANSWERED = 5.0, 0.05, 0.3, 5.0, 0.1


def plan_targets(plans: PlansRecord) -> list[list[str]]:
    """Return the lines of targets of the plans."""
    unsafe = sum(n for (word, _), n in plans.verdicts.items() if word != FREE)
    n_judged = sum(plans.verdicts.values())
    heard = heard_by(plans.figures)
    rejected = sum(int(v) for k, v in plans.figures.items() if k.startswith('rejected messages'))
    growth = growth_of([m for _, m in plans.memory]).growth if plans.memory else np.nan
    age = max((look.age for look in plans.looks), default=np.nan)
    return [
        _line('calls without an answer', '0', plans.n_unanswered, plans.n_unanswered == 0),
        _line(
            'published motions that are not free of the body',
            '0',
            f'{unsafe} of {n_judged} checked',
            unsafe == 0 and n_judged == plans.n_motions,
        ),
        _line(
            'bodies that were sent and not received, or rejected',
            '0',
            f'{plans.n_sent - heard} of {plans.n_sent}, {rejected} messages rejected',
            plans.n_sent == heard and rejected == 0,
        ),
        _line('age of the body, at most', '50 ms', f'{1e3 * age:.0f} ms', age < MOST_AGE),
        _line('memory after the first tenth', '< 5 MB', f'{growth:+.2f} MB', growth < MOST_GROWTH),
        _brake_line('body to fail-safe stop in the busy node, p99', plans.figures),
    ]


def monitor_targets(monitor: MonitorRecord) -> list[list[str]]:
    """Return the lines of targets of the monitor."""
    held = _milliseconds(monitor.figures.get('remaining motion checks', ''), 'p50')
    bad = monitor.outcomes[contacts.HIT] + monitor.outcomes[contacts.MISSED]
    return [
        _line(
            'checking the remaining motion against a body, median',
            f'{RECERTIFIED} ms',
            f'{held:.3f} ms',
            held <= RECERTIFIED,
        ),
        _brake_line('body to fail-safe stop in the node, p99', monitor.figures),
        _line('contacts that a stop could have avoided', '0', bad, bad == 0),
        _line('arm that cannot continue', 'never', monitor.stuck or 'never', not monitor.stuck),
    ]


def running_target(brakes: Sequence[tuple[int, float]], still: Standstills) -> list[str]:
    """Return the line of the target of the brakes while the machine ran."""
    # Whether it did is asked of the same time of each, however long it took.
    runs = [took for came, took in brakes if not still.within(came - EARLIER, came + MOMENT)]
    p99 = float(np.percentile(runs, 99, method='higher')) if runs else np.nan
    return _line(
        'body to fail-safe stop in either part, p99, of those that came while the machine ran',
        f'{BRAKED:g} ms',
        f'{p99:.2f} ms, {len(runs)} of {len(brakes)} times',
        p99 <= BRAKED,
    )


def flood_target(floods: Sequence[FloodRecord]) -> list[str]:
    """Return the line of the target of the answers under a flood."""
    missing = sum(flood.n_unanswered for flood in floods)
    # Where nothing was measured nothing is met.
    slowest = float(np.max([np.median(flood.calls or [np.nan]) for flood in floods]))
    return _line(
        'answer while any topic is flooded, median',
        f'{1e3 * ANSWERED:g} ms, each',
        f'{1e3 * slowest:.1f} ms, {missing} without',
        slowest <= ANSWERED and missing == 0,
    )


def people_targets(people: Sequence[PersonRecord]) -> list[list[str]]:
    """Return the lines of targets of the recorded people."""
    seconds = sum(person.seconds for person in people)
    ray = sum(person.ray_seconds for person in people)
    n_contacts = sum(person.n_contacts for person in people)
    n_asked = sum(person.n_requests for person in people)
    n_aimed = sum(person.n_aimed for person in people)
    aimed = n_aimed / n_asked if n_asked else np.nan
    return [
        _line(
            'contacts of the moving arm with a recorded person', '0', n_contacts, not n_contacts
        ),
        _line(
            'pointing ray of the moving arm across a recorded person',
            f'{100.0 * CROSSED:.3f} % of the time',
            f'{ray:.2f} of {seconds:.0f} s',
            ray <= CROSSED * seconds,
        ),
        _line(
            'requests beside recorded people after which the arm aims within 6 s',
            f'{100.0 * AIMED:g} %',
            f'{n_aimed} of {n_asked}',
            aimed >= AIMED,
        ),
    ]


def _brake_line(what: str, figures: Mapping[str, str]) -> list[str]:
    """Return the line of the target of the brakes."""
    braked = figures.get('fail-safe stops', '')
    p99 = _milliseconds(braked, 'p99')
    n_brakes = braked.split(',')[0]
    # Where nothing was measured nothing is met.
    is_met = n_brakes != '0' and p99 <= BRAKED
    return _line(what, f'{BRAKED:g} ms', f'{p99:.2f} ms, {n_brakes} times', is_met)


def _milliseconds(figures: str, name: str) -> float:
    found = [part.split()[-2] for part in figures.split(', ') if part.startswith(name)]
    return float(found[0]) if found else float('nan')


def _line(what: str, target: str, measured: object, is_met: bool) -> list[str]:
    return [what, target, str(measured), 'yes' if is_met else '**no**']
