# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the guard does where a stop is not proven free: it brakes, unless going on leads away."""

from collections import deque
from threading import RLock
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from rclpy.node import Node  # noqa: E402
from rrth_planner import oracle  # noqa: E402
from rrth_planner.goal import PointingGoal  # noqa: E402
from rrth_planner.ros.edits import BodyPart  # noqa: E402
from rrth_planner.ros.guard import Guard, Watch  # noqa: E402
from rrth_planner.ros.messages import WearerBody  # noqa: E402
from rrth_planner.ros.parameters import declare_parameters  # noqa: E402
from rrth_planner.scene import Box  # noqa: E402
from rrth_planner.trajectory import sample, Trajectory  # noqa: E402
from rrth_planner.underway import RunningMotion  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
ARM = worlds.table_1_arm()
# How far the motion has come [s].
PHASE = 0.5


class Watched:
    """A guard of a motion that runs, and what it publishes."""

    def __init__(self, node):
        """Let the pointing ray turn in the free."""
        q = worlds.free_configuration(np.random.default_rng(4), worlds.wearer_world())
        still = np.zeros((2, ARM.dof))
        self.motion = Trajectory(
            times=[0.0, 1.5],
            positions=[q, q - [0.0, 0.0, 0.8, 0.0]],
            velocities=still,
            accelerations=still,
        )
        self.published, self.said = [], deque()
        parameters = declare_parameters(node)
        self.reporter = SimpleNamespace(
            parameters=parameters,
            guard=('', ''),
            publish_soon=lambda: None,
            recertified=lambda took: self.said.append('free'),
            braked=lambda took: self.said.append('braked'),
        )
        self.heard = SimpleNamespace(
            body=SimpleNamespace(value=WearerBody(), age=lambda now: 0.0),
            joints=SimpleNamespace(value=None),
        )
        publishers = SimpleNamespace(
            publish_motion=lambda trajectory, *_: self.published.append(trajectory)
        )
        self.guard = Guard(node, self.heard, self.reporter, publishers, RLock())
        now = node.get_clock().now().nanoseconds * 1e-9
        q, v, _ = (row[0] for row in sample(self.motion, [PHASE]))
        self.heard.joints.value = SimpleNamespace(
            positions=q, velocities=v, taken=now, received=now
        )
        self.guard.running = RunningMotion(trajectory=self.motion, start_time=now - PHASE)
        self.guard._goal = PointingGoal(np.ones(3))
        self.guard._state = Watch.WATCHING

    def see(self, *boxes):
        """Let a body come."""
        parts = tuple(((box.name, 0), BodyPart((box,))) for box in boxes)
        self.heard.body.value = WearerBody(parts)
        self.guard.on_body(time.time_ns())

    def hand(self, ahead, away):
        """Return a hand so far ahead on the way of the ray [s], and aside of that [m]."""
        T = oracle.frames(ARM, sample(self.motion, [PHASE + ahead, PHASE + ahead + 0.01])[0])
        tip, next_tip = T[:, -1, :3, 3] + 0.5 * T[:, -1, :3, 2]
        onward = (next_tip - tip) / np.linalg.norm(next_tip - tip)
        return Box('hand', tip - away * onward, np.full(3, 0.05), np.eye(3))


@pytest.fixture
def watched():
    """Give a guard with its motion."""
    node = Node('choice')
    yield Watched(node)
    node.destroy_node()


def test_an_arm_that_has_its_way_goes_on(watched):
    watched.see(Box('far', [3.0, 3.0, 3.0], [0.1, 0.1, 0.1], np.eye(3)))
    assert watched.published == []
    assert list(watched.said) == ['free']


@pytest.mark.parametrize('ahead', [0.02, 0.1, 0.6])
def test_an_arm_brakes_whether_or_not_its_stop_is_free(watched, ahead):
    watched.see(watched.hand(ahead, 0.0))
    (stop,) = watched.published
    assert list(watched.said) == ['braked']
    assert not stop.velocities[-1].any()
    sentence = watched.reporter.guard[1]
    assert 'the arm brakes' in sentence
    assert ('not proven safe either' in sentence) == (ahead < 0.3)


def test_an_arm_that_is_too_near_goes_on_where_that_leads_away(watched):
    watched.see(watched.hand(0.0, 0.045))
    assert watched.published == []
    state, sentence = watched.reporter.guard
    assert state == Watch.WATCHING.value
    assert 'going on leads away' in sentence
    # But not into something else.
    watched.see(watched.hand(0.0, 0.045), watched.hand(0.6, 0.0))
    assert len(watched.published) == 1
