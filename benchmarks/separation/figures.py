# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of one motion beside a recorded person: distance, and permitted rate, over time."""

from pathlib import Path

import matplotlib

matplotlib.use('Agg')
from matplotlib import pyplot as plt
import numpy as np
from rrth_planner.execution.commitment import path_state, permitted
from rrth_planner.model.arrays import Array
from rrth_planner.rehearsal.contacts import distances_to

from benchmarks.separation.lockstep import instants, Timing
from benchmarks.separation.people import Beside, parts_of, Session, Take
from benchmarks.separation.setting import Case, the_arm

# So long a time is drawn, in such steps of the permitted rate [s].
SECONDS = 12.0
# Further away than that is not drawn [m].
FARTHEST = 0.6


class _Watched(Session):
    """A session that keeps what rate was permitted in each frame."""

    def __init__(self, take: Take, case: Case) -> None:
        super().__init__(Beside(take, case, is_separate=True), Timing(), seed=0)
        self.rates: list[tuple[float, float, float]] = []

    def _go_on(self, time: float) -> None:
        super()._go_on(time)
        planner = self.planner
        at = time + self.timing.thinking
        if planner.plan is None or not planner.is_under_way or planner.is_at_rest(at):
            self.rates.append((at, np.nan, np.nan))
            return
        tau, rate, _ = path_state(planner.commitments[-1], at)
        limit = permitted(planner.motion, tau, planner.body(at), self.settings)
        self.rates.append((at, rate, limit))


def draw(file: Path, take: Take, case: Case) -> Path:
    """Draw motions beside a recorded person into a file, and return it."""
    session = _Watched(take, case)
    session.run(SECONDS)
    times = instants(0.0, SECONDS)[::5]
    whole, fast = _distances(session, times)
    figure, (upper, lower) = plt.subplots(2, sharex=True, figsize=(8.0, 5.0), layout='constrained')
    upper.plot(times, whole, color='0.6', label='of the arm')
    upper.plot(times, fast, color='C0', label=f'of its parts above {case.contact_speed:g} m/s')
    upper.set(ylabel='distance from the wearer [m]', ylim=(0.0, FARTHEST))
    upper.legend(loc='upper right')
    at, rates, limits = np.array(session.rates).T
    lower.plot(at, limits, color='C1', label='permitted')
    lower.plot(at, rates, color='C0', label='commanded')
    lower.set(xlabel='time [s]', ylabel='rate of the motion', ylim=(0.0, 1.1))
    lower.legend(loc='lower left')
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=150)
    plt.close(figure)
    return file


def _distances(session: Session, times: Array) -> tuple[Array, Array]:
    """Return the least distances of the arm, and of its fast parts, from the wearer [m]."""
    take, speed = session.record.take, session.settings.rules.contact_speed
    q, v = session.controller.states(times - session.timing.lag)
    rows = np.nan_to_num(np.array([take.rows(time) for time in times]), nan=1e3)
    found = distances_to(the_arm(), q, v, parts_of(take), rows, speed, FARTHEST)
    fast = found.fast.min(axis=(1, 2))
    return found.whole.min(axis=(1, 2)), np.where(np.isfinite(fast), fast, np.nan)
