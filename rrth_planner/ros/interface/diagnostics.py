# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The diagnostics of the planner."""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from types import MappingProxyType
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rrth_planner.model.errors import one_line
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.error_codes import answer, ErrorCode

# Durations are counted in bins, so many a decade from the shortest on [s].
BINS, DECADES, SHORTEST = 48, 8, 1e-6


@dataclass(frozen=True, slots=True)
class PlanReport:
    """
    The figures of the requests so far, and of the last one.

    Parameters
    ----------
    n_requests, n_solved : int
    code : ErrorCode or None
        Of the last request; None before the first.
    sentence : str
    seed : int
    planning_time : float
        Of the plan itself [s].
    response_time : float
        From the request, its turn included, to the published trajectory [s].
    duration : float
        Of the motion [s].
    length : float
        Of the path [rad].
    clearance : float
        Least one [m].

    """

    n_requests: int = 0
    n_solved: int = 0
    code: ErrorCode | None = None
    sentence: str = ''
    seed: int = -1
    planning_time: float = float('nan')
    response_time: float = float('nan')
    duration: float = float('nan')
    length: float = float('nan')
    clearance: float = float('nan')


class Figures:
    """A count, and statistics of a duration: the last, quantiles, the greatest [s]."""

    def __init__(self) -> None:
        """Begin with nothing done."""
        self.n, self.last, self.most = 0, 0.0, 0.0
        # Of constant size, however long the node runs.
        self._counts = [0] * (BINS * DECADES)

    def add(self, elapsed: float) -> None:
        """Count once more."""
        self.n, self.last, self.most = self.n + 1, elapsed, max(self.most, elapsed)
        at = math.ceil(BINS * math.log10(max(elapsed, SHORTEST) / SHORTEST))
        self._counts[min(at, len(self._counts) - 1)] += 1

    def quantile(self, share: float) -> float:
        """Return what a share of all took at most, rounded up by no more than 5 % [s]."""
        wanted, seen = share * self.n, 0
        for k, count in enumerate(self._counts):
            seen += count
            if count and seen >= wanted:
                return min(self.most, SHORTEST * 10.0 ** (k / BINS))
        return self.most

    def __str__(self) -> str:
        """Return the figures in a line."""
        shown = {
            'last': self.last,
            'p50': self.quantile(0.5),
            'p99': self.quantile(0.99),
            'at most': self.most,
        }
        return ', '.join([str(self.n), *(f'{k} {1e3 * v:.3f} ms' for k, v in shown.items())])


def diagnostics_msg(
    node_name: str,
    stamp: Any,
    now: float,
    inputs: Inputs,
    parameters: PlannerParameters,
    report: PlanReport,
    monitor_state: tuple[str, str] = ('', ''),
    figures: Mapping[str, Figures | int | str] = MappingProxyType({}),
) -> DiagnosticArray:
    """
    Return the diagnostics of the planner.

    Parameters
    ----------
    node_name : str
        Fully qualified.
    stamp : builtin_interfaces.msg.Time
        Of the message.
    now : float
        The same time, for the ages [s].
    inputs : Inputs
    parameters : PlannerParameters
        For the timeouts.
    report : PlanReport
    monitor_state : tuple of str
        The state of the monitor, and its reason.
    figures : mapping
        Further values by their keys.

    """
    body = inputs.body.value.at(now)
    level, message = _summary(now, inputs, parameters, report)
    values = {
        'last code': '' if report.code is None else f'{report.code.name} ({report.code.value})',
        'last sentence': report.sentence,
        'requests': str(report.n_requests),
        'solved': str(report.n_solved),
        'seed': str(report.seed),
        'planning time [ms]': f'{report.planning_time * 1e3:.3f}',
        'request to trajectory [ms]': f'{report.response_time * 1e3:.3f}',
        'duration [s]': f'{report.duration:.3f}',
        'path length [rad]': f'{report.length:.4f}',
        'least clearance [m]': f'{report.clearance:.4f}',
        'boxes': str(body.n_boxes),
        'expired boxes': ', '.join(box.name for _, part in body.expired for box in part.boxes),
    }
    values['monitor'], values['last stop'] = monitor_state
    values.update({name: str(figure) for name, figure in figures.items()})
    for name, topic in inputs.all.items():
        values[f'age of {name} [s]'] = f'{topic.age(now):.3f}'
        values[f'good messages, {name}'] = str(topic.n_good)
        values[f'rejected messages, {name}'] = str(topic.n_rejected)
        values[f'last rejection, {name}'] = str(topic.rejection or '')
    status = DiagnosticStatus(
        level=level,
        name=f'{node_name.lstrip("/")}: planning',
        hardware_id='rrth_planner',
        message=message,
    )
    status.values = [KeyValue(key=key, value=one_line(value)) for key, value in values.items()]
    msg = DiagnosticArray(status=[status])
    msg.header.stamp = stamp
    return msg


def _summary(
    now: float, inputs: Inputs, parameters: PlannerParameters, report: PlanReport
) -> tuple[bytes, str]:
    if report.code is ErrorCode.FAILURE:
        return DiagnosticStatus.ERROR, answer(report.code, report.sentence)
    timeouts = ((inputs.body, parameters.body_timeout), (inputs.joints, parameters.joint_timeout))
    for topic, timeout in timeouts:
        if timeout > 0.0 and topic.received is not None and topic.age(now) > timeout:
            return DiagnosticStatus.STALE, f'{topic.topic} is {topic.age(now):.3f} s old'
    rejected = [topic for topic in inputs.all.values() if topic.is_last_rejected]
    if rejected:
        return DiagnosticStatus.WARN, f'{rejected[0].topic} rejected: {rejected[0].rejection}'
    missing = [topic.topic for topic in inputs.all.values() if topic.received is None]
    if missing:
        return DiagnosticStatus.WARN, f'waiting for {", ".join(missing)}'
    if report.code not in (None, ErrorCode.SUCCESS):
        return DiagnosticStatus.WARN, answer(report.code, report.sentence)
    return DiagnosticStatus.OK, report.sentence or 'ready'
