# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A chart of the rate at which a motion may be executed beside a wearer who moves."""

from collections import deque
from typing import Any

import numpy as np
import viser

# What the chart shows [s], and how long after each other it is drawn [s].
SPAN, PERIOD = 20.0, 0.1
STROKE = '#3b6fb6'


class RateChart:
    """The rate of the last SPAN seconds, from 0 to 1; there is no chart until there is a rate."""

    def __init__(self, folder: viser.GuiFolderHandle, gui: viser.GuiApi) -> None:
        """Create nothing yet; the chart appears in the folder."""
        self._folder, self._gui = folder, gui
        # Times [s] and rates [-]: the least one since the time before.
        self._rates: deque[tuple[float, float]] = deque()
        self._least = np.inf
        self.plot: Any = None

    def draw(self, rate: float, now: float) -> None:
        """Draw the rate that is permitted now [s]."""
        self._least = min(self._least, rate)
        if self._rates and now < self._rates[-1][0] + PERIOD:
            return
        self._rates.append((now, self._least))
        self._least = np.inf
        while self._rates[0][0] < now - SPAN:
            self._rates.popleft()
        times, rates = np.array(self._rates).T
        data = (times - now, rates)
        if self.plot is not None:
            self.plot.data = data
            return
        with self._folder:
            self.plot = self._gui.add_uplot(
                data,
                ({'label': 'time [s]'}, {'label': 'rate [-]', 'stroke': STROKE, 'width': 2.0}),
                title='rate of the motion [-], last 20 s',
                scales={
                    'x': {'time': False, 'range': (-SPAN, 0.0)},
                    'y': {'range': (0.0, 1.05)},
                },
                legend={'show': False},
                aspect=2.5,
            )
