# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The figure of a rehearsal: how near the wearer was, the rate of the arm, and its state."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
import numpy as np
from rrth_planner.visualization.recording_figure import CLEARANCE, MONITOR_COLOURS, OTHER

SIZE = (12.0, 5.6)
REACHED, MISSED = '#2c7a4b', '#b5483a'


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """
    What is drawn.

    Parameters
    ----------
    times, states, rates : sequence of float, str, float
        What the monitor was doing at times [s], and at which rate, of 1.
    distances : sequence of (float, float)
        Time [s] and distance of the nearest part [m].
    targets : sequence of (float, float, str)
        From when to when [s]; NaN: to the end; and what became of it.

    """

    title: str
    times: Sequence[float]
    states: Sequence[str]
    rates: Sequence[float]
    distances: Sequence[tuple[float, float]]
    targets: Sequence[tuple[float, float, str]]


def rehearsal_figure(course: Course) -> Figure:
    """Return the figure."""
    figure = Figure(figsize=SIZE, layout='constrained')
    FigureCanvasAgg(figure)
    near, rate, state = figure.subplots(3, 1, sharex=True, height_ratios=(3.0, 2.0, 0.5))
    near.set_title(course.title, loc='left')
    if course.distances:
        near.plot(*np.array(course.distances).T, color=CLEARANCE, linewidth=1.0)
    near.axhline(0.0, color='black', linewidth=0.6)
    near.set_ylabel('nearest part [m]')
    rate.plot(course.times, course.rates, color=CLEARANCE, linewidth=1.0)
    rate.set_ylim(-0.05, 1.05)
    rate.set_ylabel('rate [-]')
    end = course.times[-1] if course.times else 0.0
    for begin, until, outcome in course.targets:
        colour = REACHED if outcome == 'aimed' else MISSED
        last = end if math.isnan(until) else until
        rate.axvspan(begin, last, color=colour, alpha=0.12, linewidth=0.0)
    named = set()
    borders = [0, *(k for k in range(1, len(course.states)) if _changes(course.states, k))]
    for first, after in zip(borders, [*borders[1:], len(course.states) - 1], strict=True):
        if not course.states:
            break
        word = course.states[first]
        label = None if word in named else word
        named.add(word)
        colour = MONITOR_COLOURS.get(word, OTHER)
        span = course.times[first], course.times[after]
        state.axvspan(*span, color=colour, linewidth=0.0, label=label)
    state.set_yticks([])
    state.set_xlabel('time [s]; above, a target: green where the arm came to aim at it')
    state.legend(loc='center left', ncols=4, fontsize='small', facecolor='white')
    return figure


def _changes(states: Sequence[str], k: int) -> bool:
    return states[k] != states[k - 1]
