# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
How often rest is taken for motion, and motion for rest, behind encoders of some kinds.

`python -m benchmarks.rest` prints the table of docs/ros_control.md.
"""

from collections.abc import Callable, Iterator
import sys

import numpy as np
from rrth_planner.execution.standstill import mean_motion, WINDOW
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import REST_SPEED

COUNT = 2.0 * np.pi / 4096
ENCODERS: dict[str, Callable[[Array, Array], Array]] = {
    'exact': lambda q, noise: q,
    'noise of 0.1 mrad (sd)': lambda q, noise: q + 1e-4 * noise,
    'noise of 1 mrad (sd)': lambda q, noise: q + 1e-3 * noise,
    '4,096 counts a turn': lambda q, noise: COUNT * np.round(q / COUNT),
    '4,096 counts, noise of 0.5 mrad (sd)': lambda q, noise: (
        COUNT * np.round((q + 5e-4 * noise) / COUNT)
    ),
}
RATES = (50, 100, 500)
DOF, N_ARMS = 4, 200
# A joint moves at this speed, after a rest [rad/s]; both are looked at for so long [s].
SLOW, SPAN = 2.0 * REST_SPEED, 0.6


def looks(times: Array, q: Array) -> Iterator[tuple[float, bool]]:
    """Yield the time of each reading with a full window before it [s], and whether q moves."""
    for k in np.flatnonzero(times >= times[0] + WINDOW - 1e-9):
        first = int(np.searchsorted(times, times[k] - WINDOW - 1e-9))
        mean = mean_motion(times[first : k + 1], q[first : k + 1], REST_SPEED)[1]
        yield float(times[k]), bool((np.abs(mean) > REST_SPEED).any())


def row(name: str, rate: int, n_arms: int) -> str:
    """Return the line of an encoder at so many readings a second."""
    rng, encode = np.random.default_rng(0), ENCODERS[name]
    resting, missed, found = [], [], []
    times = np.arange(-WINDOW, SPAN, 1.0 / rate)
    for _ in range(n_arms):
        noise = rng.standard_normal((len(times), DOF))
        rest = np.tile(rng.uniform(-1.0, 1.0, DOF), (len(times), 1))
        resting += [moves for _, moves in looks(times, encode(rest, noise))]
        way = np.zeros_like(rest)
        way[:, rng.integers(DOF)] = SLOW * np.maximum(times, 0.0)
        seen = list(looks(times, encode(rest + way, noise)))
        missed += [not moves for time, moves in seen if time >= WINDOW]
        found.append(next((time for time, moves in seen if moves and time > 0.0), np.inf))
    figures = f'{np.mean(resting):.1e} | {np.mean(missed):.1e} | {1e3 * np.median(found):.0f}'
    return f'| {name} | {rate} | {figures} | {1e3 * max(found):.0f} |'


def main(arguments: list[str]) -> int:
    """Print the table, by default of 200 arms a line."""
    n_arms = int(arguments[0]) if arguments else N_ARMS
    print(
        '| encoder | readings a second | rest taken for motion [-] | 0.02 rad/s taken for rest ',
        end='',
    )
    print('[-] | found after, median [ms] | at most [ms] |\n| --- | --- | --- | --- | --- | --- |')
    for name in ENCODERS:
        for rate in RATES:
            print(row(name, rate, n_arms), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
