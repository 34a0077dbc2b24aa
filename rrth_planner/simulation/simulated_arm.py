# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm with its servos and controller beside a wearer, step by step."""

from collections import deque
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.simulation.arm_dynamics import ArmDynamics
from rrth_planner.simulation.body_shapes import capsules_within
from rrth_planner.simulation.contacts import ContactEvent, contacts_of, followed
from rrth_planner.simulation.mechanics import Mechanics
from rrth_planner.simulation.moving_body import MovingBody, state_at
from rrth_planner.simulation.physics_model import Fill, physics_model, RATE, stretch
from rrth_planner.simulation.servo import Servo, servo_effort
from rrth_planner.simulation.trajectory_controller import (
    Command,
    commanded_state,
    ControllerRules,
    ControllerState,
    DEFAULT_RULES,
    TimedPoints,
    TrajectoryController,
)

with suppress(ImportError):
    import mujoco

# Of the physics and the servos [s].
STEP_PERIOD = 1.0 / RATE
# The wearer is placed at every so many steps; until the next time he goes on at his velocity.
STEPS_PER_PLACE = 5
# Velocities are differences of encoder positions, smoothed over this time [s].
SMOOTHING_TIME = 0.008
# A servo that asks for more than this share of its strength is at its limit [-].
LIMIT_SHARE = 0.999


@dataclass(frozen=True, slots=True, kw_only=True)
class Imperfections:
    """
    What lies between controller, servo and arm.

    Parameters
    ----------
    encoder_noise : float
        Standard deviation of a measured position [rad or m].
    command_delay : float
        From the controller until the servo acts by it [s].
    seed : int
        Of the noise.

    Raises
    ------
    OptionsError
        A value out of its range.

    """

    encoder_noise: float = 0.0
    command_delay: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Validate."""
        if not 0.0 <= self.encoder_noise < np.inf:
            raise OptionsError(f'encoder_noise: {self.encoder_noise}, expected >= 0 [rad]')
        if not 0.0 <= self.command_delay <= 1.0:
            raise OptionsError(f'command_delay: {self.command_delay}, expected 0 to 1 [s]')


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ArmReading:
    """
    What is known of the arm after a step; arrays are (dof,) each.

    Parameters
    ----------
    time : float
        [s].
    positions, velocities : ndarray
        As the encoders have them [rad, rad/s].
    efforts : ndarray
        Of the motors [N m].
    wanted : ControllerState
        What the controller commands for this time.
    true_positions : ndarray
        Without noise [rad].

    """

    time: float
    positions: Array
    velocities: Array
    efforts: Array
    wanted: ControllerState
    true_positions: Array


class SimulatedArm:
    """
    An arm in the hands of time: each step takes it `STEP_PERIOD` further.

    Its time is that of trajectories and stamps; the body is at its first frame at `body_begin`.
    """

    def __init__(
        self,
        arm: ArmModel,
        mechanics: Mechanics,
        servo: Servo,
        rules: ControllerRules = DEFAULT_RULES,
        *,
        q: Array,
        body: MovingBody | None = None,
        body_begin: float = 0.0,
        imperfections: Imperfections | None = None,
        time: float = 0.0,
        compensated: Mechanics | None = None,
        fill: Fill = capsules_within,
    ) -> None:
        """
        Place the arm at rest at a configuration, (dof,) [rad or m], at a time [s].

        compensated: what the servos take the arm to weigh; None: what it does.
        """
        self.arm, self.body = arm, body
        self._servo = servo
        self.physics = physics_model(arm, mechanics, body, fill)
        self.data = mujoco.MjData(self.physics.model)
        self._dynamics = ArmDynamics(arm, compensated or mechanics)
        self._max_effort = mechanics.max_effort
        given = imperfections or Imperfections()
        self._noise, self._rng = given.encoder_noise, np.random.default_rng(given.seed)
        self.time, self._body_begin = time, body_begin
        self.data.qpos[: arm.dof] = q
        self._controller = TrajectoryController(q, STEP_PERIOD, rules)
        self._wanted = commanded_state(self.command, time)
        # The newest command last; the servo acts by the first.
        n_late = round(given.command_delay * RATE)
        self._late = deque([self._wanted] * (n_late + 1), maxlen=n_late + 1)
        self._place_body()
        mujoco.mj_forward(self.physics.model, self.data)
        self._positions = self._encoded()
        self._velocities = np.zeros(arm.dof)
        self.events: list[ContactEvent] = []
        self.ended: list[ContactEvent] = []
        self.n_at_limit, self._n_steps = 0, 0

    @property
    def reading(self) -> ArmReading:
        """What is known of the arm now."""
        return ArmReading(
            time=self.time,
            positions=self._positions.copy(),
            velocities=self._velocities.copy(),
            efforts=np.array(self.data.ctrl).clip(-self._max_effort, self._max_effort),
            wanted=self._wanted,
            true_positions=self.data.qpos[: self.arm.dof].copy(),
        )

    @property
    def command(self) -> Command:
        """What the controller executes."""
        return self._controller.command

    def execute(self, points: TimedPoints, stamp: float) -> None:
        """Give the controller a trajectory that starts at a time [s]; 0: with the next step."""
        self._controller.receive(points, stamp)

    def step(self) -> str | None:
        """Let `STEP_PERIOD` pass; return why a trajectory was given up, if one was."""
        data = self.data
        if self._n_steps % STEPS_PER_PLACE == 0:
            self._place_body()
        self._n_steps += 1
        stretch(self.physics, data.qpos)
        self._wanted = self._controller.update(
            self.time,
            ControllerState(
                positions=self._positions,
                velocities=self._velocities,
                accelerations=np.full(self.arm.dof, np.nan),
            ),
        )
        self._late.append(self._wanted)
        acted = self._late[0]
        gravity = self.physics.model.opt.gravity
        weight = self._dynamics.weight(self._positions, gravity)
        effort = servo_effort(
            self._servo,
            (acted.positions, acted.velocities),
            (self._positions, self._velocities),
            weight,
        )
        self.n_at_limit += bool((np.abs(effort) > LIMIT_SHARE * self._max_effort).any())
        data.ctrl[:] = effort
        velocities = data.qvel.copy()
        mujoco.mj_step(self.physics.model, data)
        self._follow_contacts(velocities)
        self.time += STEP_PERIOD
        self._measure()
        given_up = self._controller.given_up
        return given_up and f'{self.arm.joint_names[given_up[0]]}: {given_up[1]}'

    def _place_body(self) -> None:
        """Have every part of the wearer where he is now, with his velocity."""
        body, data, dof = self.body, self.data, self.arm.dof
        if body is None:
            return
        state = state_at(body, self.time - self._body_begin)
        self.physics.model.opt.gravity[:] = state.gravity
        if self.physics.is_standing:
            return
        n = len(body.names)
        poses = data.qpos[dof:].reshape(n, 7)
        poses[:, :3] = state.positions
        poses[:, 3], poses[:, 4:] = state.quaternions[:, 3], state.quaternions[:, :3]
        rates = data.qvel[dof:].reshape(n, 6)
        rates[:, :3] = state.velocities
        rates[:, 3:] = state.spins

    def _follow_contacts(self, velocities: Array) -> None:
        if not self.events and not self.data.ncon:
            return
        contacts = contacts_of(self.physics, self.data, velocities)
        self.events, ended = followed(self.events, contacts, self.time)
        self.ended += ended

    def _encoded(self) -> Array:
        true: Array = self.data.qpos[: self.arm.dof].copy()
        if self._noise:
            true += self._noise * self._rng.standard_normal(len(true))
        return true

    def _measure(self) -> None:
        before, self._positions = self._positions, self._encoded()
        rate = (self._positions - before) / STEP_PERIOD
        self._velocities = self._velocities + STEP_PERIOD / (STEP_PERIOD + SMOOTHING_TIME) * (
            rate - self._velocities
        )
