# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the clock of motions and measurements has stepped, beside one that never does."""

from dataclasses import dataclass
import math

# A greater step counts [s].
STEP = 0.02
# What a clock gains or loses more slowly is no step: time daemons slew by up to 500 ppm [s/s].
SLEW = 1e-3
# A simulated clock that has not advanced for so long is paused [s].
PAUSE = 0.5


@dataclass(frozen=True, slots=True)
class ClockWatch:
    """
    Two clocks when they were last read at once.

    Parameters
    ----------
    node, steady : float
        The clock of motions and measurements, and one that only advances [s].
    advanced : float
        When the first one last advanced, by the steady one; inf: it is known to be paused [s].

    """

    node: float
    steady: float
    advanced: float


@dataclass(frozen=True, slots=True)
class ClockStep:
    """By how much a clock was set forward [s], and a sentence about it; 0: it is paused."""

    step: float
    sentence: str


def watch_clock(
    before: ClockWatch | None, node: float, steady: float, is_simulated: bool
) -> tuple[ClockWatch, ClockStep | None]:
    """
    Return what is known of two clocks that were read at once [s], and how the first has stepped.

    A simulated clock may run at any rate and be set forward: only steps back and pauses count.
    """
    if before is None:
        return ClockWatch(node, steady, steady), None
    if not is_simulated:
        passed = steady - before.steady
        step = node - before.node - passed
        # Slow changes are followed, up to a rate.
        left = math.copysign(max(0.0, abs(step) - SLEW * abs(passed)), step)
        if abs(left) <= STEP:
            # What is left counts together with what comes.
            return ClockWatch(node - left, steady, steady), None
        return ClockWatch(node, steady, steady), _set_by(step)
    if node < before.node - STEP:
        return ClockWatch(node, steady, steady), _set_by(node - before.node)
    if node > before.node:
        return ClockWatch(node, steady, steady), None
    if steady - before.advanced <= PAUSE:
        return ClockWatch(before.node, steady, before.advanced), None
    sentence = f'the simulated clock has stood still for {PAUSE:g} s'
    return ClockWatch(before.node, steady, math.inf), ClockStep(0.0, sentence)


def _set_by(step: float) -> ClockStep:
    direction = 'forward' if step > 0.0 else 'back'
    return ClockStep(step, f'the clock was set {direction} by {abs(step):.3f} s')
