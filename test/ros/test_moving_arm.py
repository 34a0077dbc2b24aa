# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a request makes of an arm that follows its motion, on a clock of its own."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import without_separation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rrth_planner.execution.command import ahead  # noqa: E402
from rrth_planner.execution.executing_motion import ExecutingMotion  # noqa: E402
from rrth_planner.execution.handover import EARLY, LEADS  # noqa: E402
from rrth_planner.execution.joint_reading import JointReading  # noqa: E402
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.model.trajectory import REST_SPEED, sample, Trajectory  # noqa: E402
from rrth_planner.pipeline.host import BlockingHost, completed  # noqa: E402
from rrth_planner.pipeline.in_process_planner import InProcessPlanner  # noqa: E402
from rrth_planner.requests.inputs import InputSnapshot  # noqa: E402
from rrth_planner.requests.plan_request import plan_request  # noqa: E402
from rrth_planner.requests.revalidation import Revalidation  # noqa: E402
from rrth_planner.ros.interface.inputs import Input, Inputs  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import BodyPart  # noqa: E402
from rrth_planner.timing.fast_stop import fast_stop  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
# What a controller needs to have a motion in time [s].
AHEAD = ahead(0.01)
BEGIN, TARGET = 100.0, PointingGoal(np.array([2.0, 0.3, 0.4]))


class Following(Input):
    """Joint states of an arm that executes its motion exactly."""

    def __init__(self, motion, clock, pace):
        """Follow a clock."""
        self._motion, self._clock, self._pace = motion, clock, pace
        super().__init__('joints', None)

    def at(self, now):
        """Return the reading of that time."""
        time = self._pace * (now - BEGIN)
        q, v, _ = (values[0] for values in sample(self._motion, [time]))
        return JointReading(q, self._pace * v, now, now, float('inf'))

    value = property(lambda self: self.at(self._clock()), lambda self, _: None)
    measured = property(lambda self: self._clock(), lambda self, _: None)


class Clock:
    """A clock on which a little time passes at each reading."""

    def __init__(self, now, tick):
        """Begin at a time [s]."""
        self.now, self._tick = now, tick

    def __call__(self):
        """Return the time [s]."""
        self.now += self._tick
        return self.now


@pytest.fixture(name='ask')
def _ask(monkeypatch):
    """Give what asks for a plan at a time since a motion began [s]."""
    node = Node('moving_arm')
    parameters, planner = without_separation(node), InProcessPlanner()

    def ask(motion, since, is_known=True, tick=2e-4, reading=0.0, checking=None, pace=1.0):
        clock, disagreement = Clock(BEGIN + since, tick), Revalidation.disagreement
        slept = []

        def sleep(seconds):
            # No time but that of the clock, however busy the machine; it may stand still.
            slept.append(seconds)
            clock.now += seconds * (tick > 0.0)

        async def publish(outcome, revalidation):
            clock.now += reading
            if checking is not None:
                publish_body(0.01 * next(n_bodies))
            revalidation.require_fit()
            return None if revalidation.is_late() else outcome

        async def check_slowly(*args):
            clock.now += checking
            return await disagreement(*args)

        def publish_body(shift):
            """Let a body come whose parts are so much further back [m]."""
            boxes = [replace(b, center=b.center - [shift, 0, 0]) for b in worlds.wearer().boxes]
            parts = tuple(((box.name, 0), BodyPart((box,), float('inf'))) for box in boxes)
            inputs.body.accept(lambda: WearerBody(parts), clock())

        if checking is not None:
            monkeypatch.setattr(Revalidation, 'disagreement', check_slowly)
        n_bodies = count()
        inputs = Inputs('body', 'target', 'joints')
        publish_body(0.01 * next(n_bodies))
        inputs.joints = Following(motion, clock, pace)
        running = ExecutingMotion(trajectory=motion, start_time=BEGIN) if is_known else None
        host = BlockingHost(planner, clock, sleep, lambda: sum(slept))
        request = plan_request(
            host, inputs, parameters, lambda: False, publish, TARGET, lambda until: running
        )
        return completed(request), clock.now

    yield ask
    node.destroy_node()


def _swings():
    """Return a motion that rests for an instant in its middle, at 1 s."""
    q = worlds.FOLDED
    still = np.zeros((3, 4))
    return Trajectory(
        times=[0.0, 1.0, 2.0],
        positions=[q, q + [0.3, 0.0, 0.2, 0.0], q + [0.1, 0.0, 0.5, 0.1]],
        velocities=still,
        accelerations=still,
    )


def _slow():
    """Return a motion that moves for 6 s."""
    still = np.zeros((2, 4))
    q = worlds.FOLDED
    return Trajectory(
        times=[0.0, 6.0],
        positions=[q, q + [0.5, 0.0, 0.3, 0.0]],
        velocities=still,
        accelerations=still,
    )


@pytest.mark.parametrize('since', [0.4, 0.995, 1.0, 1.003, 1.5])
def test_the_motion_begins_where_the_arm_will_be(ask, since):
    motion = _swings()
    outcome, now = ask(motion, since)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    start = outcome.handover
    assert LEADS[0] + AHEAD <= start.time - BEGIN - since <= LEADS[0] + AHEAD + 0.01
    # Published in time for any controller, and not long before.
    assert start.time - AHEAD - EARLY * LEADS[0] <= now <= start.time - AHEAD
    expected = [values[0] for values in sample(motion, [start.time - BEGIN])]
    found = outcome.trajectory
    np.testing.assert_allclose(found.positions[0], expected[0], atol=1e-6)
    np.testing.assert_allclose(found.velocities[0], expected[1], atol=1e-5)
    np.testing.assert_allclose(found.accelerations[0], expected[2], atol=1e-3)


@pytest.mark.parametrize('since', [1.985, 2.0, 2.5])
def test_where_the_motion_ends_the_next_one_begins_at_rest(ask, since):
    outcome, _ = ask(_swings(), since)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    assert outcome.handover is None


def test_an_arm_whose_motion_is_unknown_is_checked_as_late_as_possible(ask):
    outcome, now = ask(_slow(), 3.0, is_known=False)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    assert outcome.handover.start_state.running is None
    assert abs(now - outcome.handover.time) < 5e-3


def test_a_clock_that_stands_still_is_not_waited_for(ask):
    # As a simulation that is paused: the time to publish the motion never comes.
    outcome, _ = ask(_swings(), 0.4, tick=0.0)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    assert outcome.handover.time == pytest.approx(BEGIN + 0.4 + LEADS[0] + AHEAD)


def test_a_motion_whose_time_has_passed_is_planned_anew(ask):
    # So long the node needs to read what came.
    outcome, now = ask(_slow(), 3.0, reading=0.1)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    assert outcome.handover.time == pytest.approx(BEGIN + 3.0 + LEADS[1] + 0.1, abs=0.05)
    assert now <= outcome.handover.deadline
    outcome, _ = ask(_slow(), 3.0, reading=0.5)
    assert outcome.code is ErrorCode.TIMED_OUT
    assert outcome.trajectory is None


def test_an_arm_whose_motion_is_unknown_gets_no_late_motion(ask):
    outcome, _ = ask(_slow(), 3.0, is_known=False, reading=0.2)
    assert outcome.code is ErrorCode.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
    assert 'deviates from its trajectory' in outcome.sentence
    assert outcome.trajectory is None


def test_a_motion_whose_time_has_passed_when_all_is_read_is_planned_anew(ask):
    # It is not late yet at the check.
    outcome, now = ask(_slow(), 3.0, reading=0.03)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    assert outcome.handover.time > BEGIN + 3.0 + LEADS[1]
    assert now <= outcome.handover.deadline


def test_a_wearer_who_never_stands_still_does_not_make_a_motion_late(ask):
    # There is time for one more check, but not for two.
    outcome, now = ask(_slow(), 3.0, checking=0.02)
    assert outcome.code is ErrorCode.SUCCESS, outcome.sentence
    assert outcome.handover.time == pytest.approx(BEGIN + 3.0 + LEADS[0] + AHEAD, abs=0.01)
    assert now <= outcome.handover.deadline


def test_a_pause_of_an_unknown_motion_is_not_detected(ask):
    # The arm's own rest is all there is to go by.
    outcome, _ = ask(_swings(), 1.0, is_known=False)
    assert outcome.handover is None


def test_a_handover_from_a_stop_that_began_after_the_reading():
    motion = _swings()
    stop = fast_stop(motion, 0.4, worlds.limits())
    q, v, _ = (row[0] for row in sample(motion, [0.39]))
    reading = JointReading(q, v, BEGIN + 0.39, BEGIN + 0.39, float('inf'))
    inputs = InputSnapshot(worlds.wearer(), TARGET, reading)
    running = ExecutingMotion(trajectory=stop, start_time=BEGIN + 0.4)
    found = inputs.start_state_at(running, BEGIN + 0.46, worlds.table_1_arm())
    assert found.running is stop
    assert np.abs(found.state.positions - sample(stop, [0.06])[0][0]).max() < 1e-9
    # Its state before the stop began is known by its velocity.
    found = inputs.start_state_at(running, BEGIN + 0.395, worlds.table_1_arm())
    assert np.abs(found.state.positions - (q + 0.005 * v)).max() < 1e-12


def test_an_arm_that_begins_to_move_while_a_plan_is_made_is_planned_for_as_it_moves(ask):
    outcome, _ = ask(_swings(), since=-1e-3, reading=0.05)
    assert outcome.code is ErrorCode.SUCCESS
    assert outcome.handover is not None
    # Without the running motion its course is unknown.
    outcome, _ = ask(_swings(), since=-1e-3, reading=0.05, is_known=False)
    assert outcome.code is ErrorCode.START_STATE_INVALID


@pytest.mark.parametrize('pace', [0.5, 1.0])
def test_an_arm_that_has_hardly_begun_its_motion_is_not_one_at_rest(ask, pace):
    # By its velocity alone it still rests, and would move faster by the time of publication.
    motion, reading = _swings(), 0.02
    assert np.abs(pace * sample(motion, [pace * reading])[1]).max() < 0.5 * REST_SPEED
    outcome, _ = ask(motion, since=-1e-3, reading=reading, pace=pace)
    assert outcome.code is ErrorCode.SUCCESS
    assert outcome.handover is not None
