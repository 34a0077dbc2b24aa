# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Section `servos`: motions round a wearer at rest, executed by servos that lag; half are stopped.

Each motion is planned with the margin of the package. The monitor of the node commands it beside
the wearer, and says where the arm is on it, and whether the arm ignores a stop.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decision import Command
from rrth_planner.execution.event import Begin, BodyCame, Look, Moment, Tick
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading, with_earlier
from rrth_planner.execution.monitor import Monitor
from rrth_planner.execution.tracked_motion import tracked_phase
from rrth_planner.execution.watch import PlainRules
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import forward_kinematics
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.pipeline.motion_plan import MotionPlan
from rrth_planner.simulation.body_shapes import whole_box
from rrth_planner.simulation.moving_body import standing_body
from rrth_planner.simulation.simulated_arm import ArmReading, SimulatedArm, STEP_PERIOD

from benchmarks.common.random_draws import random_wearer
from benchmarks.physics.setting import (
    arm_of,
    clearance_of,
    DELAYS,
    LAGS,
    PAYLOADS,
    points_of,
    Setup,
)
from benchmarks.separation.setting import (
    FOLDED,
    MARGIN,
    random_plans,
    required,
    the_arm,
    the_settings,
)

# Motions of a chain, the first of which begins folded.
CHAIN = 10
# The arm comes to rest under its weight before a motion, and after it [s].
SETTLING = 0.5
# Joint states come every so many steps, and bodies with every so many of them; a motion begins so
# long after it is sent [s].
STEPS, BODIES, AHEAD = 5, 4, 0.01
# No decision needs what the arm aims at.
GOAL, NOWHERE = PointingGoal(np.ones(3)), Scene(())
# Below this the arm hardly moves, and nothing is said of its lag [rad/s].
SLOW = 0.3


@dataclass(slots=True, eq=False)
class Judged:
    """
    What was seen of motions.

    Parameters
    ----------
    n_motions, n_stops : int
    clearance : float
        Least one of the arm as it moved [m].
    nearer : float
        By how much it was less than that of the commanded curve, at most [m].
    n_within : int
        Motions on which it was less than the margin.
    n_contacts : int
    error : float
        Of the tool's place, at most [m].
    lags : list of float
        How late the arm was, at each joint state of a fast arm [s].
    n_states, n_suspended : int
        Joint states, and those by which the monitor does not find the arm on its motion.
    n_alarms : int
        Times that the monitor takes a stop to be ignored, and sends it again.
    n_other : int
        Motions that it stops or gives up by itself.

    """

    setup: Setup
    n_motions: int = 0
    n_stops: int = 0
    clearance: float = np.inf
    nearer: float = 0.0
    n_within: int = 0
    n_contacts: int = 0
    error: float = 0.0
    lags: list[float] = field(default_factory=list)
    n_states: int = 0
    n_suspended: int = 0
    n_alarms: int = 0
    n_other: int = 0


def setup_of(seed: int) -> Setup:
    """Return the arm of a chain: all of them in turn."""
    seed, i = divmod(seed, len(LAGS))
    seed, k = divmod(seed, len(DELAYS))
    return Setup(LAGS[i], DELAYS[k], PAYLOADS[seed % len(PAYLOADS)])


def chain_of_motions(n: int, seed: int) -> Judged:
    """Return what was seen of a chain of motions round a wearer at rest."""
    rng, judged = np.random.default_rng(seed), Judged(setup_of(seed))
    scene, q = load_body() if rng.random() < 0.5 else random_wearer(rng), FOLDED
    for k in range(n):
        plan = next(random_plans(rng, scene, q), None)
        if plan is None:
            q = FOLDED
            continue
        assert plan.trajectory is not None
        share = rng.random() if k % 2 else None
        _Execution(judged, scene, plan, int(rng.integers(2**31))).run(share)
        q = plan.trajectory.positions[-1]
    return judged


class _Execution:
    """A motion of a simulated arm, and the node's monitor of it."""

    def __init__(self, judged: Judged, scene: Scene, plan: MotionPlan, seed: int) -> None:
        """Let the arm settle where the motion begins, and begin it."""
        assert plan.trajectory is not None
        self.judged, self.motion, self.scene = judged, plan.trajectory, scene
        self.arm: SimulatedArm = arm_of(
            judged.setup, self.motion.positions[0], standing_body(scene), seed, fill=whole_box
        )
        self.clearance = clearance_of(self.arm.physics)
        # Of the commanded curve.
        self.ghost = mujoco.MjData(self.arm.physics.model)
        self.reading: JointReading | None = None
        self.rules = PlainRules(
            required=required(),
            stop_limits=the_settings().limits,
            execution=ExecutionRules(None, judged.setup.delay, is_manual=False),
        )
        self.monitor = Monitor(self.rules, self._moment, self._look, self._send)
        self.n_states = 0
        self.least = self.least_commanded = np.inf
        self._advance(SETTLING)
        whole = ExecutingMotion(
            trajectory=self.motion,
            start_time=self.arm.time + AHEAD,
            target_distance=plan.target_distance,
        )
        self._read(self.arm.reading)
        self.monitor.begin(Begin(self._moment(), whole, GOAL, self.rules, np.inf, None, 0, 0))

    def run(self, share: float | None) -> None:
        """Execute the motion, to its end or to a share of it, where it is stopped."""
        judged, motion = self.judged, self.motion
        judged.n_motions += 1
        end = AHEAD + (1.0 if share is None else share) * motion.duration
        self._watch(end)
        judged.n_other += self.monitor.watch.n_stops
        if share is None:
            self._watch(SETTLING)
        else:
            self._stop()
        judged.clearance = min(judged.clearance, self.least)
        judged.nearer = max(judged.nearer, self.least_commanded - self.least)
        judged.n_within += self.least < MARGIN
        judged.n_contacts += len(self.arm.events) + len(self.arm.ended)

    def _stop(self) -> None:
        """Stop the arm as the node does, and see whether it is taken to ignore that."""
        before = self.monitor.watch
        if not before.is_monitoring:
            return
        self.monitor.fail('of the benchmark', is_replanned=False, is_fault=False)
        if self.monitor.watch.n_stops == before.n_stops:
            return
        self.judged.n_stops += 1
        n_commands, running = self.monitor.n_commands, self.monitor.watch.running
        assert running is not None
        self._watch(running.trajectory.duration + SETTLING)
        self.judged.n_alarms += self.monitor.n_commands - n_commands

    def _advance(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_PERIOD)):
            self.arm.step()

    def _watch(self, seconds: float) -> None:
        """Let time pass, and judge each joint state."""
        states: list[ArmReading] = []
        for _ in range(round(seconds / STEP_PERIOD / STEPS)):
            for _ in range(STEPS):
                self.arm.step()
            state = self.arm.reading
            states.append(state)
            self._locate(state)
            self.least = min(self.least, self.clearance(self.arm.data))
            self.ghost.qpos[:] = state.wanted.positions
            mujoco.mj_kinematics(self.arm.physics.model, self.ghost)
            self.least_commanded = min(self.least_commanded, self.clearance(self.ghost))
        if not states:
            return
        wanted = np.array([state.wanted.positions for state in states])
        true = np.array([state.true_positions for state in states])
        places = [forward_kinematics(the_arm(), q)[:, -1, :3, 3] for q in (wanted, true)]
        error = float(np.linalg.norm(places[0] - places[1], axis=1).max())
        self.judged.error = max(self.judged.error, error)
        speeds = np.array([state.wanted.velocities for state in states])
        fast = np.abs(speeds).max(axis=1) > SLOW
        gaps, speeds = (wanted - true)[fast], speeds[fast]
        self.judged.lags += ((gaps * speeds).sum(axis=1) / (speeds**2).sum(axis=1)).tolist()

    def _locate(self, state: ArmReading) -> None:
        """Have the monitor find the arm on its motion, or on its stop."""
        self._read(state)
        self.monitor.take(Tick(self._moment()))
        self.n_states += 1
        if self.n_states % BODIES == 0:
            self.monitor.take(BodyCame(self._moment(), None, self._look()))
        watch = self.monitor.watch
        assert watch.n_faults == 0, watch.stop_reason
        if watch.running is not None:
            self.judged.n_states += 1
            phase = tracked_phase(watch.tracked, self.reading, state.time)
            self.judged.n_suspended += phase is None

    def _read(self, state: ArmReading) -> None:
        recent = with_earlier(state.positions, state.time, self.reading)
        self.reading = JointReading(
            state.positions, state.velocities, state.time, state.time, np.inf, recent
        )

    def _moment(self, later: float = 0.0) -> Moment:
        now = self.arm.time + later
        return Moment(now=now, steady=now, reading=self.reading, rules=self.rules)

    def _look(self) -> Look:
        return Look(self.scene, NOWHERE, 0.0)

    def _send(self, command: Command) -> None:
        self.arm.execute(points_of(command.motion.trajectory), command.begin)


HEADER = (
    '| lag of the tool [mm] | delay [ms] | motions | stopped | arm late, median [ms] | at most '
    '(p99) [ms] | tool off at most [mm] | least distance [mm] | nearer than commanded, at most '
    '[mm] | within the margin | contacts | joint states not on the motion | stops taken to be '
    'ignored |'
)


def lines_of(chains: Sequence[Judged]) -> list[str]:
    """Return the lines of the table: one for each servo and delay."""
    lines = []
    for lag in LAGS:
        for delay in DELAYS:
            some = [one for one in chains if (one.setup.lag, one.setup.delay) == (lag, delay)]
            if not some:
                continue
            late = np.array([value for one in some for value in one.lags])
            middle, most = np.quantile(late, [0.5, 0.99])
            cells = (
                f'{1e3 * lag:g}',
                f'{1e3 * delay:g}',
                sum(one.n_motions for one in some),
                sum(one.n_stops for one in some),
                f'{1e3 * middle:.1f}',
                f'{1e3 * most:.1f}',
                f'{1e3 * max(one.error for one in some):.1f}',
                f'{1e3 * min(one.clearance for one in some):.1f}',
                f'{1e3 * max(one.nearer for one in some):.1f}',
                sum(one.n_within for one in some),
                sum(one.n_contacts for one in some),
                f'{sum(one.n_suspended for one in some)} of {sum(one.n_states for one in some)}',
                sum(one.n_alarms for one in some),
            )
            lines.append(f'| {" | ".join(map(str, cells))} |')
    return lines
