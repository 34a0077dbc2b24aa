# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm in virtual time that does what its controller commands, a constant time later."""

from collections import deque
from collections.abc import Callable

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.trajectory import state_at, Trajectory
from rrth_planner.simulation.trajectory_controller import (
    ControllerRules,
    ControllerState,
    DEFAULT_RULES,
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
        state_of: Callable[[Trajectory, float], Array] = state_at,
    ) -> None:
        """
        Place the arm at rest at q, (dof,) [rad], before the cycle at a time [s].

        state_of: as for `commanded_state`.
        """
        if not period > 0.0:
            raise OptionsError(f'period: {period}, expected > 0 [s]')
        if not lag_time >= 0.0:
            raise OptionsError(f'lag_time: {lag_time}, expected >= 0 [s]')
        self.controller = TrajectoryController(q, period, rules, state_of)
        self.lag_time, self.time = lag_time, time
        self._begin, self._n_steps = time, 0
        # Times [s], and positions and velocities that are due then, (2, dof).
        rest = np.array([q, np.zeros(len(q))])
        self._unknown = np.full(len(q), np.nan)
        self._unknown.setflags(write=False)
        n_kept = 4 + int(lag_time / period)
        self._setpoints: deque[tuple[float, Array]] = deque([(time, rest)], maxlen=n_kept)

    def receive(self, points: TimedPoints, stamp: float) -> None:
        """Have the controller take a message before its next cycle; stamp [s], 0: at once."""
        self.controller.receive(points, stamp)

    def step(self) -> ControllerState:
        """Run the cycle that is due, and let its period pass; return the setpoint, due then."""
        setpoint = self.controller.update(self.time, self.measured)
        self._n_steps += 1
        self.time = self._begin + self._n_steps * self.controller.period
        self._setpoints.append((self.time, np.array([setpoint.positions, setpoint.velocities])))
        return setpoint

    @property
    def measured(self) -> ControllerState:
        """What encoders read now."""
        return self.measured_at(self.time)

    def measured_at(self, time: float) -> ControllerState:
        """
        Return what encoders read at a time between the last two cycles [s].

        The command of `lag_time` before; no accelerations (NaN).
        """
        then = time - self.lag_time
        setpoints, k = self._setpoints, len(self._setpoints) - 1
        while k and setpoints[k][0] > then:
            k -= 1
        due, (q, v) = setpoints[k]
        if k + 1 < len(setpoints) and then > due:
            share = (then - due) / (setpoints[k + 1][0] - due)
            q, v = (1.0 - share) * setpoints[k][1] + share * setpoints[k + 1][1]
        return ControllerState(positions=q, velocities=v, accelerations=self._unknown)
