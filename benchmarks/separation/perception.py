# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Section `perception`: the adversary, while what is seen is old, lost, noisy or gone."""

from dataclasses import replace

from benchmarks.separation.adversary import Faults, Trial
from benchmarks.separation.lockstep import Timing

# Ages of frames [s]; share of frames that are lost; how long a part is gone [s].
AGES, LOST, GONE = (0.0, 0.01, 0.03, 0.05, 0.1), 0.1, 0.5
# By how much frames are older than they say in the last line [s].
UNDERSTATED = 0.1


def trials() -> dict[str, Trial]:
    """Return the trials of the section by what they are called."""
    error = Trial().case
    noise = 0.01
    found = {f'age {1e3 * age:.0f} ms': Trial(timing=Timing(age=age)) for age in AGES}
    found[f'{100.0 * LOST:.0f} % of the frames lost'] = Trial(faults=Faults(lost=LOST))
    found[f'the part gone for {GONE:g} s'] = Trial(faults=Faults(gone=GONE))
    found[f'noise of {1e3 * noise:.0f} mm'] = Trial(faults=Faults(noise=noise))
    every = Trial(
        case=error, timing=Timing(age=AGES[-1]), faults=Faults(lost=LOST, gone=GONE, noise=noise)
    )
    found[f'all of that, age {1e3 * AGES[-1]:.0f} ms'] = every
    found['all of that, stop 10/400'] = replace(every, case=replace(error, stop='10/400'))
    found[f'power: {1e3 * UNDERSTATED:.0f} ms older than declared'] = Trial(
        faults=Faults(understated=UNDERSTATED)
    )
    return found
