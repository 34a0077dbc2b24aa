# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm at rest lets a hand out of its pointing ray, or through it, before it begins."""

import math

import numpy as np
import pytest
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.remaining_motion import box_in_ray
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import load_settings
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import forward_kinematics, tool_pose
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import Separation, SeparationRules
from rrth_planner.model.status import ErrorCode
from rrth_planner.pipeline.in_process_planner import InProcessPlanner
from rrth_planner.rehearsal.parameters import rehearsed_parameters
from rrth_planner.rehearsal.rehearsal import FOLDED
from rrth_planner.rehearsal.virtual_ends import LastWord, MonitorEnd, NoPublishers, VirtualInputs
from rrth_planner.rehearsal.virtual_host import VirtualHost
from rrth_planner.rehearsal.world import BEGIN, Wire, World
from rrth_planner.requests.request_queue import PERIOD, PlanQueue, RAY_PATIENCE

ARM, TARGET = load_arm(), np.array([1.5, 0.1, 0.3])
HAND = 'left hand of another'
SIZE = 0.08
# Known before anybody asks [s].
ASKED = 0.5


class Wearer:
    """A wearer at rest, and a hand beside the pointing ray of the folded arm."""

    def __init__(self, aside_at, way=0.4):
        """aside_at: returns how far beside the ray it is at a time [s] [m]; way: along that."""
        self.body, self._aside_at = load_body(), aside_at
        T = tool_pose(ARM, np.array(FOLDED))
        self._place, self._aside = T[:3, 3] + way * T[:3, 2], T[:3, 0]
        self.names = (*self.body.names, HAND)

    def scene_at(self, time):
        """Return the boxes at a time [s]."""
        center = self._place + self._aside_at(time - BEGIN) * self._aside
        return Scene((*self.body.boxes, Box(HAND, center, np.full(3, SIZE), np.eye(3))))

    def rows_at(self, time):
        """Return them as rows."""
        return self.scene_at(time).numbers


class Said(LastWord):
    """Keeps also what the arm was said to wait for."""

    def __init__(self, parameters):
        """Begin with nothing."""
        super().__init__(parameters)
        self.waits = []

    def ray_blocked_by(self, box):
        """Keep it."""
        self.waits.append(box)


class Trial:
    """Somebody who asks beside a wearer, in virtual time, and what comes of it."""

    def __init__(self, wearer, separates=True):
        settings = load_settings(ARM.dof, seed=1)
        separation = Separation(
            arm=ARM,
            rules=SeparationRules(),
            margin=settings.margin,
            limits=settings.limits,
            stop_limits=settings.limits,
        )
        rules = ExecutionRules(separation if separates else None, 0.01, False)
        self.parameters = rehearsed_parameters(settings, ARM, settings.limits, rules, 2.0)
        self.world = World(self.parameters, wearer, np.array(FOLDED), 0, Wire())
        self.said, self.outcomes, self.begun = Said(self.parameters), [], []
        self.world.on_command = lambda command: self.begun.append(command.begin - BEGIN)
        host = VirtualHost(
            self.world.timeline, InProcessPlanner(), lambda: 0.02, read=self.world.read
        )
        self.queue = PlanQueue(
            *(host, VirtualInputs(self.world), self.said, NoPublishers(), MonitorEnd(self.world))
        )
        self.world.timeline.every(PERIOD, self.queue.follow_up)
        self._host = host

    def ask(self, time, target=TARGET):
        """Have a target asked for at a time [s]."""

        async def asked():
            outcome = await self.queue.respond(PointingGoal(np.array(target)))
            self.outcomes.append((self.world.timeline.now - BEGIN, outcome))

        self.world.timeline.at(BEGIN + time, lambda: self._host.begin(asked()))

    def run(self, seconds):
        """Let so much time pass since the beginning [s]."""
        self.world.timeline.run(BEGIN + seconds)
        return self


def leaves(time):
    """Return the way of a hand that is in the ray until a time [s]."""
    return lambda now: 0.0 if now < time else 0.6


def test_the_arm_begins_once_the_hand_is_out_and_says_what_it_waits_for():
    trial = Trial(Wearer(leaves(2.0)))
    trial.ask(ASKED)
    trial.run(4.0)
    ((_, outcome),) = trial.outcomes
    assert outcome.code is ErrorCode.SUCCESS
    assert min(trial.begun) > 2.0
    assert set(trial.said.waits[:-1]) == {HAND}
    assert trial.said.waits[-1] == ''


def test_a_hand_that_stays_is_named_after_a_while_and_nothing_moves():
    trial = Trial(Wearer(leaves(math.inf)))
    trial.ask(ASKED)
    trial.run(ASKED + RAY_PATIENCE + 1.0)
    ((time, outcome),) = trial.outcomes
    assert time == pytest.approx(ASKED + RAY_PATIENCE, abs=0.05)
    assert outcome.code is ErrorCode.START_STATE_IN_COLLISION
    assert outcome.sentence.startswith(f'RAY_BLOCKED: {HAND} is in the pointing ray')
    assert not trial.begun
    assert trial.said.waits[-1] == ''


def test_a_newer_request_and_a_cancel_end_the_wait_at_once():
    trial = Trial(Wearer(leaves(math.inf)))
    trial.ask(ASKED)
    trial.ask(1.5, (1.4, -0.2, 0.2))
    trial.world.timeline.at(BEGIN + 2.5, trial.queue.cancel)
    trial.run(4.0)
    assert [outcome.code for _, outcome in trial.outcomes] == [ErrorCode.PREEMPTED] * 2
    first, second = (time for time, _ in trial.outcomes)
    assert first == pytest.approx(1.5, abs=0.05)
    assert second == pytest.approx(2.5, abs=0.05)


def test_a_hand_that_is_about_to_cross_the_ray_goes_first():
    speed, start = 0.5, 0.3
    wearer = Wearer(lambda now: start - speed * max(now - 0.1, 0.0))
    trial = Trial(wearer)
    # The hand is still clear of the ray then.
    asked = 0.4
    required, q = trial.parameters.required, np.array(FOLDED)
    times = np.arange(asked, 2.0, 0.001)
    crossed = [bool(box_in_ray(q, required, wearer.scene_at(BEGIN + t))) for t in times]
    assert not crossed[0]
    assert any(crossed)
    out = times[len(crossed) - crossed[::-1].index(True)]
    trial.ask(asked)
    trial.run(3.0)
    ((_, outcome),) = trial.outcomes
    assert outcome.code is ErrorCode.SUCCESS
    assert min(trial.begun) > out
    assert trial.said.waits[0] == HAND


def test_an_arm_that_is_itself_too_near_does_not_wait():
    # A hand in the ray, and a thing that leans on the forearm.
    wearer = Wearer(leaves(math.inf))
    poses = forward_kinematics(ARM, np.array(FOLDED))
    middle = 0.5 * (poses[2][:3, 3] + poses[3][:3, 3])
    thing = Box('thing', middle - [0.0, 0.05 + 0.0255, 0.0], np.full(3, 0.1), np.eye(3))
    wearer.body = Scene((*wearer.body.boxes, thing))
    wearer.names = (*wearer.body.names, HAND)
    trial = Trial(wearer)
    trial.ask(ASKED)
    trial.run(ASKED + RAY_PATIENCE)
    assert not trial.said.waits
    ((_, outcome),) = trial.outcomes
    assert 'RAY_BLOCKED' not in outcome.sentence


def test_beside_a_body_that_stands_still_nobody_is_waited_for():
    trial = Trial(Wearer(leaves(math.inf)), separates=False)
    trial.ask(ASKED)
    trial.run(ASKED + 0.5)
    ((_, outcome),) = trial.outcomes
    assert outcome.code is ErrorCode.SUCCESS
    assert not trial.said.waits
