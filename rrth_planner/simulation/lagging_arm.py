# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm in virtual time that does what its controller commands, a constant time later."""

from collections import deque

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.trajectory import MotionState
from rrth_planner.simulation.trajectory_controller import (
    ControllerRules,
    DEFAULT_RULES,
    MeasuredState,
    TimedPoints,
    TrajectoryController,
)


class LaggingArm:
    """
    A controller, and servos that follow it `lag_time` late: each step is one cycle.

    Between two setpoints the arm moves along the line.
    """

    def __init__(
        self,
        q: Array,
        period: float,
        lag_time: float = 0.0,
        rules: ControllerRules = DEFAULT_RULES,
        time: float = 0.0,
    ) -> None:
        """Place the arm at rest at q, (dof,) [rad], before the cycle at a time [s]."""
        if not period > 0.0:
            raise OptionsError(f'period: {period}, expected > 0 [s]')
        if not lag_time >= 0.0:
            raise OptionsError(f'lag_time: {lag_time}, expected >= 0 [s]')
        self.controller = TrajectoryController(q, period, rules)
        self.lag_time, self.time = lag_time, time
        self._begin, self._n_steps = time, 0
        # Times [s], and positions and velocities that are due then, (2, dof).
        rest = np.array([q, np.zeros(len(q))])
        n_kept = 4 + int(lag_time / period)
        self._setpoints: deque[tuple[float, Array]] = deque([(time, rest)], maxlen=n_kept)

    def receive(self, points: TimedPoints, stamp: float) -> None:
        """Have the controller take a message before its next cycle; stamp [s], 0: at once."""
        self.controller.receive(points, stamp)

    def step(self) -> MotionState:
        """Run the cycle that is due, and let its period pass; return the setpoint, due then."""
        setpoint = self.controller.update(self.time, self.measured)
        self._n_steps += 1
        self.time = self._begin + self._n_steps * self.controller.period
        self._setpoints.append((self.time, np.array([setpoint.positions, setpoint.velocities])))
        return setpoint

    @property
    def measured(self) -> MeasuredState:
        """What encoders read now."""
        return self.measured_at(self.time)

    def measured_at(self, time: float) -> MeasuredState:
        """
        Return what encoders read at a time between the last two cycles [s].

        The command of `lag_time` before.
        """
        then = time - self.lag_time
        times = [due for due, _ in self._setpoints]
        k = int(np.clip(np.searchsorted(times, then, side='right'), 1, len(times))) - 1
        q, v = self._setpoints[k][1]
        if k + 1 < len(times) and then > times[k]:
            share = (then - times[k]) / (times[k + 1] - times[k])
            q, v = (1.0 - share) * self._setpoints[k][1] + share * self._setpoints[k + 1][1]
        return MeasuredState(q, v)
