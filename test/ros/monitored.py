# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A monitor of a motion on a clock of its own, for tests of what it does."""

from dataclasses import replace
import math
from types import SimpleNamespace

import numpy as np
from rrth_planner.collision import reference_checker
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.flight_recorder import FlightRecorder
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import declare_parameters
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.joint_state import joint_reading
from rrth_planner.ros.messages.marker_edits import BodyPart
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor
import samples
import worlds

ARM = worlds.table_1_arm()
# How far the motion has come [s].
PHASE = 0.5
FAR = Box('far', [3.0, 3.0, 3.0], [0.1, 0.1, 0.1], np.eye(3))


def without_separation(node):
    """Return the parameters of a node whose motions are monitored as a whole."""
    separated = declare_parameters(node)
    execution = replace(separated.execution, separation=None)
    return replace(separated, execution=execution, body_timeout=0.0, joint_timeout=0.0)


def know(monitor, **known):
    """Let a monitor know this, too, by the names of `Watch`."""
    monitor._watch = replace(monitor.watch, **known)
    # What was decided before has nothing to do with that.
    monitor.flight = FlightRecorder()


class Monitored:
    """A monitor of a motion that runs, on a clock of its own, and what it publishes."""

    def __init__(self, node, parameters=None):
        """Let the pointing ray turn in the free."""
        q = worlds.free_configuration(np.random.default_rng(4), worlds.wearer_world())
        still = np.zeros((2, ARM.dof))
        self.motion = Trajectory(
            times=[0.0, 1.5],
            positions=[q, q - [0.0, 0.0, 0.8, 0.0]],
            velocities=still,
            accelerations=still,
        )
        self.now = 100.0 + PHASE
        self.published, self.said, self.took, self.alive = [], [], [], []
        self.ages, self.statuses, self.ray_clear, self.doubts = [], [], [], []
        # How long a body waits until it is checked [s].
        self.late = 0.0
        # Called whenever the monitor reads a clock.
        self.on_reading = lambda: None
        self.reporter = SimpleNamespace(
            parameters=replace(parameters or without_separation(node), replan=False),
            monitor_state=('', ''),
            unfollowed=lambda *found: self.doubts.append(found),
            publish_soon=lambda: None,
            body_used=self.ages.append,
            remaining_motion_checked=lambda took: self.said.append('free'),
            body_observed=lambda body: None,
            commitment_published=lambda took: self.said.append('committed'),
            separation_status=self.statuses.append,
            stop_published=lambda took: self.said.append('stopped') or self.took.append(took),
        )
        self.inputs = Inputs('body', 'target', 'joints')
        self.publishers = SimpleNamespace(
            publish_motion=lambda trajectory, _, begin: self.published.append((trajectory, begin)),
            motion_topic='joint_trajectory',
            has_listener=lambda: True,
            assert_liveliness=lambda: self.alive.append(self.now),
            publish_ray_clear=self.ray_clear.append,
            flush=lambda: None,
        )
        self.monitor = ExecutionMonitor(node, self.inputs, self.reporter, self.publishers)
        self.monitor._now = lambda: self.on_reading() or self.now
        self.monitor._elapsed = lambda arrived: self.on_reading() or self.late
        self.see(FAR)
        self.read(*self.on_time(PHASE))
        self.begin()
        self.said.clear()

    def begin(self):
        """Let a motion begin."""
        running = ExecutingMotion(trajectory=self.motion, start_time=100.0)
        self.command(running)
        # Tests are about what is published after that.
        self.published.clear()

    def command(self, running, publish=lambda: None, joins=math.inf):
        """Command a motion; joins: when it begins within the one before [s], inf: at rest."""
        goal = PointingGoal(np.ones(3))
        counts = self.monitor.watch.n_stops, self.monitor.watch.n_faults
        self.monitor.begin(running, goal, self.reporter.parameters, *counts, publish, joins)

    def on_time(self, phase):
        """Return positions and velocities of an arm that follows."""
        return tuple(row[0] for row in sample(self.motion, [phase])[:2])

    def read(self, q, v):
        """Let joint states come."""
        joints, msg = self.inputs.joints, samples.joints(q, ARM.joint_names, v)
        joints.value = joint_reading(msg, ARM.joint_names, self.now, joints.value)
        joints.measured = self.now

    def see(self, *boxes, expires=float('inf')):
        """Let a body come."""
        parts = tuple(((box.name, 0), BodyPart((box,), expires)) for box in boxes)
        self.inputs.body.value, self.inputs.body.measured = WearerBody(parts), self.now
        self.monitor.on_body(self.inputs.body.value, 0)

    def hand(self, ahead, away, motion=None):
        """Return a hand so far ahead along the path of the ray [s], and aside of that [m]."""
        at = PHASE + ahead if motion is None else ahead
        T = reference_checker.frames(ARM, sample(motion or self.motion, [at, at + 0.01])[0])
        tip, next_tip = T[:, -1, :3, 3] + 0.5 * T[:, -1, :3, 2]
        onward = (next_tip - tip) / np.linalg.norm(next_tip - tip)
        return Box('hand', tip - away * onward, np.full(3, 0.05), np.eye(3))

    def run(self, seconds, arm):
        """Let time pass; arm: which positions and velocities it has at a time after PHASE [s]."""
        for k in range(1, int(round(seconds / 0.01)) + 1):
            self.now = 100.0 + PHASE + 0.01 * k
            self.read(*arm(0.01 * k))
            if k % 2 == 0:
                self.monitor.check()

    def executes(self):
        """Return where an arm is, and how fast, that follows the last stop that was published."""
        stop, begin = self.published[-1]
        return tuple(row[0] for row in sample(stop, [self.now - begin])[:2])
