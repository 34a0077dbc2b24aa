# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Views of separation: how far a wearer may get while the arm stops, and what slows it."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from mpl_toolkits.mplot3d.art3d import Poly3DCollection
import numpy as np
from rrth_planner.collision.reference_checker import fast_distances, quintic_states
from rrth_planner.execution.separation_status import SeparationState
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Box
from rrth_planner.model.separation import growth_at, reach_at, SeenBody, SeparationRules
from rrth_planner.model.trajectory import positions_at, Trajectory
from rrth_planner.visualization.arm_view import (
    draw_configurations,
    faces_of,
    N_DRAWN,
    VISIBLE,
)

# So many parts are drawn grown, those that are nearest to the arm, unless they get further than
# that [m], as legs do: their boxes would hide all others.
N_GROWN, FURTHEST = 3, 0.5
# The arm is looked at so often until it is at rest [s].
PERIOD = 0.01
GROWN = '#e07a2f'
COLOURS = {
    SeparationState.NORMAL: '#8cc5a3',
    SeparationState.SLOWED: '#f2c46d',
    SeparationState.PROTECTIVE_STOP: '#e07a2f',
}
OTHER = '#c3b5d9'
RATE, LEGEND_SIZE = '#1b6ca8', 8
# What lasts shorter than this share of the picture has no room for a name [-].
NAMED = 0.04


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Span:
    """From when to when [s] the arm moved at a rate [-]; part: what slows it, empty: unknown."""

    begin: float
    end: float
    rate: float
    state: SeparationState
    part: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Instant:
    """
    The wearer as he was seen until a time [s], and what the arm was given.

    Parameters
    ----------
    left : Trajectory
        What is left of that, up to its end at rest.
    target : ndarray, shape (3,), optional
        [m].

    """

    time: float
    seen: SeenBody
    rules: SeparationRules
    left: Trajectory
    target: Array | None = None


def reserves(arm: ArmModel, instant: Instant) -> Array:
    """
    Return how much further each part might get before it meets a fast arm, (m,) [m].

    Infinite for parts that are far away, and for those that get nowhere, as what wears the arm.
    """
    seen, rules = instant.seen, instant.rules
    times, q, v, _ = quintic_states(instant.left, PERIOD)
    growths = np.array([growth_at(seen, rules, 0.0, time) for time in times])
    gaps = fast_distances(arm, seen.scene, q, v, rules.contact_speed, growths + FURTHEST)
    stays = reach_at(seen.reach, np.ones(len(seen.ages))) == 0.0
    found: Array = np.where(stays, np.inf, (gaps - growths[:, None]).min(axis=(0, 1)))
    return found


def draw_instant(
    axes: Any, arm: ArmModel, instant: Instant, ray_guard_length: float, shape: float
) -> None:
    """Draw the wearer, how far the nearest parts may get, and the arm until it is at rest."""
    scene, stopping = instant.seen.scene, instant.left.duration
    q = positions_at(instant.left, np.linspace(0.0, stopping, N_DRAWN))
    names = 'now', f'at rest\n{stopping:.2f} s later'
    draw_configurations(
        axes, arm, scene, q, q, instant.target, ray_guard_length, names=names, shape=shape
    )
    style = {'facecolors': GROWN, 'edgecolors': GROWN, 'linewidths': 0.6, 'alpha': 0.09}
    for box in grown_parts(arm, instant):
        faces = [corners for _, corners in faces_of(box)]
        axes.add_collection3d(Poly3DCollection(faces, **style, zorder=VISIBLE))


def grown_parts(arm: ArmModel, instant: Instant) -> list[Box]:
    """Return the parts nearest to the arm, as large as they may get before it is at rest."""
    grown = growth_at(instant.seen, instant.rules, 0.0, instant.left.duration)
    left = np.where(grown < FURTHEST, reserves(arm, instant), np.inf)
    nearest = [k for k in np.argsort(left, kind='stable')[:N_GROWN] if left[k] < np.inf]
    boxes = instant.seen.scene.boxes
    return [replace(boxes[k], size=boxes[k].size + 2.0 * grown[k]) for k in nearest]


def draw_spans(axes: Any, spans: list[Span]) -> None:
    """Draw the rate of an arm over time, and what slows it."""
    times = [span.begin for span in spans] + [spans[-1].end]
    rates = [span.rate for span in spans] + [spans[-1].rate]
    named = set()
    for span in spans:
        colour = COLOURS.get(span.state, OTHER)
        label = None if span.state in named else span.state.name.replace('_', ' ').lower()
        named.add(span.state)
        axes.axvspan(span.begin, span.end, color=colour, alpha=0.45, lw=0.0, label=label)
    axes.step(times, rates, where='post', color=RATE, lw=2.0)
    borders = [k for k, (a, b) in enumerate(pairwise(spans), 1) if a.part != b.part]
    whole = spans[-1].end - spans[0].begin
    for first, last in zip([0, *borders], [*borders, len(spans)], strict=True):
        begin, end, part = spans[first].begin, spans[last - 1].end, spans[first].part
        if part and end - begin > NAMED * whole:
            place = {'ha': 'center', 'va': 'bottom', 'rotation': 90, 'fontsize': LEGEND_SIZE}
            axes.text(0.5 * (begin + end), 0.02, part, **place)
    axes.set_xlabel('time [s]', loc='left')
    axes.set_ylabel('rate of the planned motion [-]')
    axes.set_xlim(spans[0].begin, spans[-1].end)
    axes.set_ylim(0.0, 1.02)
    axes.legend(loc='lower right', bbox_to_anchor=(1.01, -0.13), ncols=3, fontsize=LEGEND_SIZE)
