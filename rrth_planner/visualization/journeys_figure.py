# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of what happens to a body, a request and a commitment, and in which thread."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import sys
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from rrth_planner.model.errors import RrthError, SceneError

DESCRIPTION = """\
Draw the picture of docs/journeys.md: three journeys through the planner's node.
"""
DOTS_PER_INCH = 110
# Colours of the journeys, of texts and of lanes.
BODY, REQUEST, COMMITMENT = '#1b6ca8', '#2f9e6e', '#b4541a'
TEXT, LANE = '#30343b', ('#f1f4f8', '#ffffff')
# Lanes from the left to the right, and where they end, as shares of the width.
LANES = (
    ('others', 0.20),
    ("the node's thread: waits for nobody", 0.66),
    ('thread "planner"\nand its process', 0.85),
    ('thread "helper"', 1.0),
)
# Size of a step, as shares of the picture.
WIDTH, HEIGHT = 0.135, 0.09


@dataclass(frozen=True, slots=True)
class Step:
    """
    A step of a journey.

    Parameters
    ----------
    x, y : float
        Of its middle, as shares of the picture.
    colour : str
        Of its journey.

    """

    text: str
    x: float
    y: float
    colour: str


# Each journey in its order.
JOURNEYS = (
    (
        Step('tracker:\na body', 0.10, 0.82, BODY),
        Step('message -> boxes\n(scene monitor)', 0.275, 0.82, BODY),
        Step('event BodyCame,\nwith its time', 0.43, 0.82, BODY),
        Step('decide(watch, event):\nis the rest free?', 0.585, 0.82, BODY),
        Step('publish first:\na stop or a stretch', 0.43, 0.65, BODY),
        Step('arm', 0.10, 0.65, BODY),
        Step('keep the new watch,\nthen report', 0.585, 0.65, BODY),
    ),
    (
        Step('client:\na request', 0.10, 0.46, REQUEST),
        Step('coroutine: newest\nbody, target, joints', 0.275, 0.46, REQUEST),
        Step('plan, certify,\ncheck a second time', 0.755, 0.46, REQUEST),
        Step('newest body again:\nstill free?', 0.585, 0.32, REQUEST),
        Step('event Begin:\npublish, watch', 0.43, 0.32, REQUEST),
        Step('answer N\nand its figures', 0.10, 0.32, REQUEST),
        Step('views, files,\nflight records', 0.925, 0.24, REQUEST),
    ),
    (
        Step('with each body:\nwhat is proven by now', 0.585, 0.10, COMMITMENT),
        Step('before it: what is\ncommanded already', 0.43, 0.10, COMMITMENT),
        Step('behind it: a stop\nto rest', 0.275, 0.10, COMMITMENT),
        Step('controller follows\nthe newest one', 0.10, 0.10, COMMITMENT),
    ),
)
# From which step to which, and how much the arrow is bent, by journey.
ARROWS = (
    ((0, 1, 0.0), (1, 2, 0.0), (2, 3, 0.0), (3, 4, 0.0), (4, 5, 0.0), (4, 6, 0.0)),
    ((0, 1, 0.0), (1, 2, 0.0), (2, 3, 0.0), (3, 4, 0.0), (4, 5, 0.0), (4, 6, 0.2)),
    ((0, 1, 0.0), (1, 2, 0.0), (2, 3, 0.0)),
)


def journeys_figure() -> Figure:
    """Return the figure."""
    figure = Figure(figsize=(13.0, 7.4), facecolor='white')
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    begin = 0.0
    for k, (name, end) in enumerate(LANES):
        axes.axvspan(begin, end, color=LANE[k % 2], zorder=0)
        middle = 0.5 * (begin + end)
        axes.text(middle, 0.95, name, ha='center', va='center', color=TEXT, weight='bold')
        begin = end
    for steps, arrows in zip(JOURNEYS, ARROWS, strict=True):
        boxes = [_drawn(axes, step) for step in steps]
        for here, there, bend in arrows:
            arrow = FancyArrowPatch(
                (steps[here].x, steps[here].y),
                (steps[there].x, steps[there].y),
                arrowstyle='-|>',
                connectionstyle=f'arc3,rad={bend}',
                mutation_scale=14.0,
                patchA=boxes[here],
                patchB=boxes[there],
                color=steps[here].colour,
                linewidth=1.4,
                zorder=1,
            )
            axes.add_patch(arrow)
    key = (
        ('a body', BODY, 0.86),
        ('a request', REQUEST, 0.82),
        ('a commitment', COMMITMENT, 0.78),
    )
    for name, colour, y in key:
        axes.text(0.70, y, name, color=colour, weight='bold', va='center')
    return figure


def _drawn(axes: Axes, step: Step) -> FancyBboxPatch:
    """Draw a step, and return its box."""
    box = FancyBboxPatch(
        (step.x - 0.5 * WIDTH, step.y - 0.5 * HEIGHT),
        WIDTH,
        HEIGHT,
        boxstyle='round,pad=0.0,rounding_size=0.01',
        facecolor='white',
        edgecolor=step.colour,
        linewidth=1.6,
        zorder=2,
    )
    axes.add_patch(box)
    where: dict[str, Any] = {'ha': 'center', 'va': 'center', 'zorder': 3}
    axes.text(step.x, step.y, step.text, color=TEXT, fontsize=9.0, **where)
    return box


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the picture and return the exit code."""
    parser = argparse.ArgumentParser(prog='journeys_figure', description=DESCRIPTION)
    parser.add_argument(
        '--output', type=Path, default=Path('journeys.png'), help='picture file (%(default)s)'
    )
    options = parser.parse_args(arguments)
    try:
        # Without the version of the library the same picture has the same bytes.
        metadata = {'Software': None}
        journeys_figure().savefig(options.output, dpi=DOTS_PER_INCH, metadata=metadata)
    except (OSError, ValueError) as problem:
        error: RrthError = SceneError(
            f'file {options.output}: {problem}, expected a picture file, e.g. .png'
        )
        print(f'journeys_figure: {error}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
