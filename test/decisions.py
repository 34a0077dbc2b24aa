# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A monitored arm without ROS and without a clock: what tests of decisions begin with."""

from dataclasses import replace

import numpy as np
from rrth_planner.collision import reference_checker
from rrth_planner.execution import event as events
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.decide import decide
from rrth_planner.execution.event import Look, Moment, Sight
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.watch import PlainRules, Watch
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import Separation, SeparationRules
from rrth_planner.model.trajectory import sample, Trajectory
import worlds

ARM = worlds.table_1_arm()
GOAL = PointingGoal(np.ones(3))
# When the first motion begins [s].
BEGIN = 100.0
FAR = Scene((Box('far', [3.0, 3.0, 3.0], [0.1, 0.1, 0.1], np.eye(3)),))
NOWHERE = Scene(())


# Of motions that are monitored as a whole.
RULES = PlainRules(
    required=RequiredClearance(ARM, 0.02, 1.0),
    stop_limits=worlds.limits(),
    execution=ExecutionRules(None, 0.0, False),
)
# What commitments are proven with, and how late the controller may be then [s].
DELAY = 0.01
SEPARATION = Separation(
    arm=ARM,
    rules=SeparationRules(contact_speed=0.1, controller_delay=DELAY),
    margin=0.02,
    limits=worlds.limits(),
    stop_limits=worlds.limits(),
)


def turn():
    """Return a motion in which the pointing ray turns in the free."""
    q = worlds.free_configuration(np.random.default_rng(4), worlds.wearer_world())
    still = np.zeros((2, ARM.dof))
    return Trajectory(
        times=[0.0, 1.5],
        positions=[q, q - [0.0, 0.0, 0.8, 0.0]],
        velocities=still,
        accelerations=still,
    )


def moment(now, positions, velocities=None, rules=RULES, overdue=''):
    """Return a moment with a fresh reading of the arm."""
    velocities = np.zeros(ARM.dof) if velocities is None else velocities
    reading = JointReading(positions, velocities, now, now, float('inf'))
    return Moment(now=now, steady=now, reading=reading, rules=rules, overdue=overdue)


def on(motion, now, rules=RULES, overdue=''):
    """Return a moment at which the arm is where a motion has it."""
    phase = min(max(now - motion.start_time, 0.0), motion.trajectory.duration)
    q, v = (row[0] for row in sample(motion.trajectory, [phase])[:2])
    return moment(now, q, v, rules, overdue)


def body(at, scene=FAR, expected=NOWHERE):
    """Return the event of a body that is new."""
    sight = Sight(scene, np.full(len(scene.boxes), at.now))
    return events.BodyCame(at, sight, Look(scene, expected, 0.0))


def hand(motion, phase, away=0.0):
    """Return a wearer with a hand in the path of the pointing ray at a phase [s]."""
    T = reference_checker.frames(ARM, sample(motion, [phase, phase + 0.01])[0])
    tip, next_tip = T[:, -1, :3, 3] + 0.5 * T[:, -1, :3, 2]
    onward = (next_tip - tip) / np.linalg.norm(next_tip - tip)
    box = Box('hand', tip - away * onward, np.full(3, 0.05), np.eye(3))
    return Scene((*FAR.boxes, box))


def idle(rules=RULES):
    """Return a watch that knows of no motion yet."""
    return Watch(rules=rules, motion_topic='/joint_trajectory')


def begun(watch, motion, at, rules=RULES):
    """Return a watch after a planned motion has begun at rest, and the motion."""
    planned = ExecutingMotion(trajectory=motion, start_time=at.now)
    counts = watch.n_stops, watch.n_faults
    begin = events.Begin(at, planned, GOAL, rules, float('inf'), None, *counts)
    found = decide(watch, begin)
    return found.watch, found.command.motion


def at_later(event, now):
    """Return an event at another time [s]."""
    return replace(event, at=replace(event.at, now=now, steady=now))
