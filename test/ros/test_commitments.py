# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The monitor with separation: what it gives the controller, and what it leaves as it is."""

from dataclasses import replace
import pickle
import time
from types import FunctionType

import numpy as np
import pytest

pytest.importorskip('rclpy')

from monitored import ARM, FAR, know, Monitored  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.cli import replay as replay_command  # noqa: E402
from rrth_planner.collision import reference_checker, separation  # noqa: E402
from rrth_planner.collision.reference_checker import separation_violations  # noqa: E402
from rrth_planner.execution import commitments  # noqa: E402
from rrth_planner.execution.body_motion import body_at  # noqa: E402
from rrth_planner.execution.command import ahead, begin_of  # noqa: E402
from rrth_planner.execution.commitment import extended  # noqa: E402
from rrth_planner.execution.decide import IN_THE_WAY  # noqa: E402
from rrth_planner.execution.executing_motion import ExecutingMotion, MAX_DEVIATION  # noqa: E402
from rrth_planner.execution.flight_recorder import (  # noqa: E402
    FlightRecorder,
    FORMAT,
    MAGIC,
    read_flight,
    replay,
)
from rrth_planner.execution.kept_sights import KeptSights  # noqa: E402
from rrth_planner.execution.separation_status import SeparationState  # noqa: E402
from rrth_planner.execution.tracked_motion import forget_command  # noqa: E402
from rrth_planner.execution.watch import MonitorState, MOST_IGNORED  # noqa: E402
from rrth_planner.model.errors import (
    RecordError,  # noqa: E402
    RequestError,  # noqa: E402
)
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.model.trajectory import sample, Trajectory  # noqa: E402
from rrth_planner.ros.interface.parameters import declare_parameters  # noqa: E402
from rrth_planner.ros.messages.body import WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import BodyPart  # noqa: E402
from rrth_planner.ros.monitor import execution_monitor  # noqa: E402
import worlds  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
FRAME = 1.0 / 120.0
# So long after its publication a motion begins [s].
AHEAD = ahead(0.01)
# The whole arm turns.
SWING = Trajectory(
    times=[0.0, 1.2],
    positions=[worlds.FOLDED, worlds.FOLDED + [0.9, 0.0, 0.0, 0.0]],
    velocities=np.zeros((2, 4)),
    accelerations=np.zeros((2, 4)),
)


class Separated(Monitored):
    """A monitor with separation, of a motion that begins now, and an arm that follows exactly."""

    def __init__(self, node, parameters):
        """Let the motion begin, with a wearer far away."""
        self.seen, self.period = (FAR,), FRAME
        super().__init__(node, parameters)

    def begin(self):
        """Let the motion begin now, from its first point."""
        self.now += 1.0
        # The arm is put to the first point: what it was commanded is over.
        know(self.monitor, tracked=forget_command(self.monitor.watch.tracked))
        self.motion = SWING
        self.published.clear()
        self.read(*self.on_time(0.0))
        self.see(*self.seen)
        self.command(ExecutingMotion(trajectory=self.motion, start_time=self.now + AHEAD))

    def commanded(self, time):
        """Return state (3, dof) that the controller commands at a time [s]."""
        trajectory, begin = [m for m in self.published if m[1] <= time][-1]
        return np.array(sample(trajectory, [time - begin]))[:, 0]

    def frames(self, n, *boxes, sees=True):
        """Let n frames of the tracker come, 1/120 s apart by default."""
        for _ in range(n):
            self.now += self.period
            self.read(*self.commanded(self.now)[:2])
            if sees:
                self.see(*(boxes or (FAR,)))
            self.monitor.check()

    def see(self, *boxes, expires=float('inf')):
        """Let a body come that was measured 20 ms ago."""
        self.seen = boxes
        measured = self.now - 0.02
        parts = tuple(((b.name, 0), BodyPart((b,), expires, measured)) for b in boxes)
        self.inputs.body.value, self.inputs.body.measured = WearerBody(parts), measured
        self.monitor.on_body(self.inputs.body.value, 0)

    @property
    def is_over(self):
        """Whether the arm is at rest for good."""
        trajectory, begin = self.published[-1]
        return self.now > begin + trajectory.duration


class StillClock:
    """The module `time` of a machine on which computing takes no time."""

    def __init__(self):
        """Begin."""
        self.present = 0.0

    def perf_counter(self):
        """Return the time [s]."""
        return self.present

    def __getattr__(self, name):
        return getattr(time, name)


@pytest.fixture(name='clock', autouse=True)
def _clock(monkeypatch):
    clock = StillClock()
    monkeypatch.setattr(execution_monitor, 'time', clock)
    return clock


@pytest.fixture(name='separated', scope='module')
def _separated(ros_context):
    # Monitors do not change their node, which is never spun.
    node, known = Node('commitments'), {}

    def parameters(values):
        given = [Parameter('separation', value=True)]
        given += [Parameter(name, value=value) for name, value in values.items()]
        declared = Node('rrth_planner', parameter_overrides=given)
        known[repr(values)] = declare_parameters(declared)
        declared.destroy_node()

    def make(**values):
        if repr(values) not in known:
            parameters(values)
        return Separated(node, known[repr(values)])

    yield make
    node.destroy_node()


def near(clearance):
    """Return a hand that far beside the longest bar of the arm and the way that it takes [m]."""
    bars = reference_checker.bars(ARM, SWING.positions, 0.0)
    longest = int(np.linalg.norm(np.diff(bars[0], axis=1)[:, 0], axis=1).argmax())
    begin, end = bars[0, longest], bars[1, longest]
    aside = np.cross(begin[1] - begin[0], end[1] - begin[1])
    aside /= np.linalg.norm(aside)
    return Box('hand', begin.mean(axis=0) + (clearance + 0.05) * aside, [0.1] * 3, np.eye(3))


def beside(separated, clearance, n_frames=20, **values):
    """Return a monitor of a motion beside a hand, after some frames of it, and that hand."""
    arm, hand = separated(**values), near(clearance)
    arm.see(hand)
    arm.begin()
    arm.frames(n_frames, hand)
    return arm, hand


def test_without_a_wearer_near_the_whole_rest_is_given(separated):
    arm = separated()
    assert len(arm.published) == 1
    trajectory, begin = arm.published[0]
    assert begin == pytest.approx(begin_of(arm.now, 0.01), abs=1e-9)
    assert np.abs(trajectory.positions[-1] - arm.motion.positions[-1]).max() < 1e-9
    arm.frames(40)
    assert len(arm.published) == 1


@pytest.mark.parametrize('clearance', [0.15, 0.3, 0.5])
def test_beside_a_wearer_each_commitment_continues_the_last_one_and_is_separate(
    separated, clearance
):
    arm = separated()
    hand = near(clearance)
    arm.see(hand)
    arm.begin()
    judged = 0
    for _ in range(900):
        before = len(arm.published)
        arm.frames(1, hand)
        if len(arm.published) > before:
            trajectory, begin = arm.published[-1]
            old, start = arm.published[-2]
            for now, then, same in zip(
                sample(trajectory, [0.0]),
                sample(old, [begin - start]),
                (2e-4, 0.02, 4.1),
                strict=True,
            ):
                assert np.abs(now - then).max() <= same
            settings = arm.reporter.parameters.execution.separation
            body = body_at(arm.monitor.watch.commitments.body, begin, settings.rules)
            found = separation_violations(
                ARM, body, trajectory, settings.rules, settings.margin, period=5e-3
            )
            assert not found
            judged += 1
        if arm.is_over:
            break
    assert judged > 20
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6
    assert SeparationState.SLOWED in [status.state for status in arm.statuses]


def test_where_no_body_comes_any_more_the_arm_stops_and_goes_on_with_the_next_ones(separated):
    arm, hand = beside(separated, 0.2)
    n = len(arm.published)
    # Shorter than `body_timeout`.
    arm.frames(15, sees=False)
    assert len(arm.published) == n
    arm.frames(900, hand)
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


def test_a_sharp_stop_that_a_late_body_did_not_prevent_ends_at_rest_and_says_why(separated):
    arm, hand = beside(separated, 0.45, stop_acceleration=[10.0], stop_jerk=[400.0])
    n = len(arm.published)
    # The stop has begun.
    arm.frames(6, sees=False)
    arm.frames(1, hand)
    status = arm.statuses[-1]
    assert status.state is SeparationState.PROTECTIVE_STOP
    assert status.cause.startswith('the next body arrived too late')
    trajectory, begin = arm.published[-1]
    arm.frames(30, hand)
    next_one, start = arm.published[n]
    assert np.abs(sample(next_one, [begin + trajectory.duration - start])[1]).max() < 1e-9
    assert arm.statuses[-1].state is SeparationState.SLOWED
    arm.frames(900, hand)
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


NAMES = [
    name
    for name, value in vars(commitments).items()
    if isinstance(value, FunctionType) and value.__module__ == commitments.__name__
]


@pytest.mark.parametrize('name', NAMES)
def test_what_fails_for_ever_stops_the_arm_beside_a_wearer(separated, monkeypatch, name):
    arm, hand = beside(separated, 0.3)
    n_calls = []

    def fail(*_, **__):
        n_calls.append(name)
        raise ZeroDivisionError(name)

    monkeypatch.setattr(commitments, name, fail)
    arm.monitor.brake('of the test')
    arm.frames(5, hand)
    # What was published last ends at rest, and nothing follows it.
    trajectory, begin = arm.published[-1]
    assert not arm.monitor.watch.is_monitoring or arm.monitor.watch.pending
    n = len(arm.published)
    arm.frames(60, hand)
    assert len(arm.published) == n
    assert arm.now > begin + trajectory.duration
    assert not trajectory.velocities[-1].any()


def frames_until_given_up(arm, place, hand):
    """Let the arm rest at a place until its motion is given up; return after how many frames."""
    n = 0
    while arm.monitor.watch.running is not None:
        arm.now += FRAME
        arm.read(place, np.zeros(4))
        arm.see(hand)
        arm.monitor.check()
        n += 1
        assert n * FRAME < 2.0
    return n


@pytest.mark.parametrize('has_moved', [True, False])
@pytest.mark.parametrize('clearance', [0.3, 0.5])
def test_a_motion_that_its_controller_rejects_is_given_up_where_the_arm_rests(
    separated, has_moved, clearance
):
    arm, hand = beside(separated, clearance, 30 if has_moved else 0)
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=True)
    place = arm.commanded(arm.now)[0]
    # It was too late for all that came since, none of which is remembered.
    assert frames_until_given_up(arm, place, hand) > commitments.REMEMBERED
    # With the more distant hand the commitments are soon too far ahead to find the arm on them.
    ahead = np.abs(arm.published[-1][0].positions[-1] - place).max()
    assert ahead > MAX_DEVIATION or not (has_moved and clearance > 0.4)
    for _ in range(MOST_IGNORED - 1):
        assert arm.monitor.take_stops()[-1].is_replanned
        assert 'does not follow it' in arm.monitor.watch.stop_reason
        assert arm.monitor.watch.state is MonitorState.IDLE
        arm.begin()
        if has_moved:
            arm.frames(30, hand)
        frames_until_given_up(arm, arm.commanded(arm.now)[0], hand)
    # One that never moves is not asked for ever.
    assert arm.monitor.take_stops()[-1].is_replanned == has_moved
    assert arm.monitor.watch.state is (MonitorState.IDLE if has_moved else MonitorState.HOLDING)
    arm.begin()
    assert arm.monitor.watch.running is not None


@pytest.mark.parametrize('hand', [FAR, near(0.5)])
def test_a_late_arm_whose_driver_has_no_velocities_is_followed(separated, hand):
    arm = separated()
    arm.see(hand)
    arm.begin()
    begin = arm.now
    while arm.now < begin + 3.0 and not arm.is_over:
        arm.now += FRAME
        arm.read(arm.commanded(max(begin, arm.now - 0.03))[0], np.zeros(4))
        arm.see(hand)
        arm.monitor.check()
        assert arm.monitor.watch.running is not None
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


def test_an_arm_that_sags_or_rests_where_it_is_commanded_is_followed(separated):
    arm = separated()
    hand = near(0.2)
    arm.see(hand)
    arm.begin()
    arm.monitor.take_stops()
    for k in range(1200):
        arm.now += FRAME
        q, v = arm.commanded(arm.now)[:2]
        arm.read(q + 0.03, v)
        if k < 60 or k > 78:
            # In between no body comes, and the arm stops on its way.
            arm.see(hand)
        arm.monitor.check()
        if k > 120 and arm.is_over:
            break
    assert not arm.monitor.take_stops()
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


def test_a_body_that_is_stale_ends_in_a_protective_stop(separated):
    arm, hand = beside(separated, 0.2)
    arm.frames(40, sees=False)
    assert arm.statuses[-1].state is SeparationState.PROTECTIVE_STOP
    assert 'expected at most 0.2 s (body_timeout)' in arm.statuses[-1].cause
    assert arm.is_over


@pytest.mark.parametrize('broken', ['extended', 'body_at'])
def test_an_error_moves_the_arm_no_further_than_its_commitment_until_reset(
    separated, monkeypatch, broken
):
    arm, hand = beside(separated, 0.2)

    def fail(*_):
        raise ZeroDivisionError('of the test')

    monkeypatch.setattr(commitments, broken, fail)
    arm.frames(80, hand)
    monkeypatch.undo()
    assert arm.is_over
    assert arm.statuses[-1].state is SeparationState.FAULT
    assert 'ZeroDivisionError: of the test' in arm.statuses[-1].cause
    with pytest.raises(RequestError, match='does not move the arm until ~/reset') as problem:
        arm.begin()
    assert problem.value.code is ErrorCode.FAILURE
    assert 'ZeroDivisionError' in arm.monitor.reset()
    arm.see(hand)
    arm.begin()
    assert arm.monitor.watch.running is not None


def test_after_an_error_during_a_stop_no_motion_begins_until_reset(separated):
    arm, hand = beside(separated, 0.3)
    arm.monitor.fail('a body is late')
    arm.frames(1, hand)
    arm.monitor.fail('an error', is_replanned=False)
    assert arm.statuses[-1].state is SeparationState.FAULT
    arm.frames(60, hand)
    with pytest.raises(RequestError, match='does not move the arm until ~/reset: an error'):
        arm.begin()
    assert arm.monitor.reset() == 'an error'
    arm.begin()


@pytest.mark.parametrize('is_kept', [True, False])
def test_a_stop_that_is_not_proven_leaves_the_arm_on_its_commitment_while_that_is(
    separated, monkeypatch, is_kept
):
    arm, hand = beside(separated, 0.2)
    # Of the stop, of the commitment, and of what is left of it with the next bodies.
    unproven, proven = separation.Blocked(0.0, 'bar', 'box'), None
    answers = [unproven, proven if is_kept else unproven]
    monkeypatch.setattr(
        commitments, 'first_unproven', lambda *_: answers.pop(0) if answers else proven
    )
    n = len(arm.published)
    arm.monitor.fail('of the test')
    assert len(arm.published) == n + (not is_kept)
    assert arm.monitor.watch.state is MonitorState.STOPPING
    arm.frames(60, hand)
    assert len(arm.published) == n + (not is_kept)
    assert arm.is_over


def test_a_stop_comes_after_all_where_the_commitment_is_not_proven_any_more(
    separated, monkeypatch
):
    arm, hand = beside(separated, 0.2)
    unproven = separation.Blocked(0.0, 'bar', 'box')
    answers = [unproven, None, None, unproven]
    monkeypatch.setattr(commitments, 'first_unproven', lambda *_: answers.pop(0))
    n = len(arm.published)
    arm.monitor.fail('of the test')
    arm.frames(1, hand)
    assert len(arm.published) == n
    arm.frames(1, hand)
    assert len(arm.published) == n + 1
    monkeypatch.undo()
    arm.frames(60, hand)
    assert arm.is_over


def test_a_stop_that_the_arm_missed_comes_again_though_not_proven_where_nothing_is(
    separated, monkeypatch
):
    arm = separated()
    arm.frames(60)
    kept, begin = arm.published[-1]
    unproven = separation.Blocked(0.0, 'bar', 'box')
    monkeypatch.setattr(commitments, 'first_unproven', lambda *_: unproven)
    arm.monitor.fail('of the test')
    assert len(arm.published) == 2
    for _ in range(30):
        # It goes on with the whole rest.
        arm.now += FRAME
        arm.read(*(row[0] for row in sample(kept, [arm.now - begin])[:2]))
        arm.see(FAR)
        arm.monitor.check()
    assert len(arm.published) >= 3


def test_an_arm_that_is_late_by_what_is_stated_is_not_taken_to_ignore_its_motion(separated):
    arm = separated(controller_delay=0.5)
    begin = arm.now
    while arm.now < begin + 1.0:
        arm.now += FRAME
        # It rests for 0.45 s, and then executes all of it.
        arm.read(*arm.commanded(max(arm.now - 0.45, arm.published[0][1]))[:2])
        arm.see(FAR)
        arm.monitor.check()
        assert arm.monitor.watch.state is MonitorState.MONITORING
    assert not arm.monitor.watch.stop_reason


def test_a_motion_from_rest_begins_with_the_last_instants_of_what_is_commanded(separated):
    arm = separated()
    before, begun = arm.published[-1]
    # The arm is at rest by its speed, and has not quite ended.
    arm.now = begun + before.duration - 0.01
    arm.read(*arm.commanded(arm.now)[:2])
    arm.see(FAR)
    end, still = before.positions[-1], np.zeros((2, 4))
    onward = Trajectory([0.0, 1.0], [end, end - [0.3, 0.0, 0.0, 0.0]], still, still)
    arm.command(ExecutingMotion(trajectory=onward, start_time=arm.now + AHEAD))
    after, begin = arm.published[-1]
    times = np.linspace(begin, arm.now + AHEAD, 40)
    gaps = sample(after, times - begin)[0] - sample(before, times - begun)[0]
    assert np.abs(sample(before, times - begun)[0] - end).max() > 1e-7
    assert np.abs(gaps).max() < 1e-9
    # Nor may one begin elsewhere.
    arm.now += AHEAD
    aside = Trajectory([0.0, 1.0], [end + 0.005, end - 0.3], still, still)
    with pytest.raises(RequestError, match='not commanded to rest where its motion begins'):
        arm.command(ExecutingMotion(trajectory=aside, start_time=arm.now + AHEAD))


def test_an_arm_that_begins_the_whole_rest_late_is_stopped_when_it_is_given_up(separated):
    arm = separated()
    assert arm.monitor.watch.commitments.is_whole
    frames_until_given_up(arm, SWING.positions[0], FAR)
    assert len(arm.published) == 2
    stop = arm.published[-1][0]
    assert np.abs(stop.positions[-1] - SWING.positions[-1]).max() > 0.1
    assert np.abs(stop.velocities[-1]).max() == 0.0
    assert arm.monitor.take_stops()[-1].trajectory is stop


def test_the_whole_rest_that_an_arm_still_executes_is_proven_again(separated):
    arm, hand = separated(), near(0.7)
    arm.period = 1 / 30
    arm.frames(5)
    kept, begin = arm.published[-1]
    whole = arm.monitor.watch.commitments.present
    assert whole.is_whole
    arm.frames(1, FAR, hand)
    assert arm.monitor.watch.commitments.present is not whole
    arm.said.clear()
    while arm.monitor.watch.commitments.present is not whole:
        # The controller has rejected what came since, and goes on with the whole rest.
        assert 'stopped' not in arm.said
        arm.now += arm.period
        arm.read(*(row[0] for row in sample(kept, [arm.now - begin])[:2]))
        arm.see(FAR, hand)
        arm.monitor.check()
    assert 'stopped' in arm.said


def test_the_whole_rest_is_remembered_however_often_it_was_replaced(separated):
    arm, hand = separated(), near(0.6)
    arm.frames(15)
    kept = arm.monitor.watch.commitments.present
    assert kept.is_whole
    n = len(arm.published)
    arm.frames(2 * commitments.REMEMBERED, FAR, hand)
    assert len(arm.published) > n + commitments.REMEMBERED
    recent = arm.monitor.watch.commitments.recent
    # Two have not begun yet.
    assert len(recent) <= commitments.REMEMBERED + 3
    assert recent[0].commitment is kept
    assert recent[-1].commitment is arm.monitor.watch.commitments.present


def test_a_report_that_fails_keeps_no_arm_from_being_stopped(separated):
    arm, hand = beside(separated, 0.3)
    n = len(arm.published)

    def fail(_):
        raise ZeroDivisionError('of the test')

    arm.reporter.separation_status = fail
    arm.monitor.fail('an error', is_replanned=False)
    assert len(arm.published) == n + 1
    assert arm.monitor.watch.commitments.fault == 'an error'


def test_an_arm_off_its_motion_is_stopped_where_no_body_comes(separated):
    arm = separated()
    arm.frames(20)
    n = len(arm.published)
    for _ in range(40):
        arm.now += FRAME
        arm.read(arm.commanded(arm.now)[0] + 0.5, np.ones(4))
        arm.monitor.check()
    assert 'body_timeout' in arm.monitor.watch.stop_reason
    assert len(arm.published) == n + 1


def withheld(arm, monkeypatch):
    """Let a stop be withheld, after which no motion is proven; return how many were published."""
    unproven = separation.Blocked(0.0, 'bar', 'box')
    answers = [unproven, None]
    monkeypatch.setattr(
        commitments, 'first_unproven', lambda *_: answers.pop(0) if answers else unproven
    )
    n = len(arm.published)
    arm.monitor.fail('of the test')
    assert len(arm.published) == n
    return n


def test_a_withheld_stop_that_cannot_be_published_is_tried_again(separated, monkeypatch):
    arm, hand = beside(separated, 0.2)
    n = withheld(arm, monkeypatch)
    publish, arm.publishers.publish_motion = arm.publishers.publish_motion, lambda *_: 1 / 0
    arm.frames(1, hand)
    arm.publishers.publish_motion = publish
    arm.frames(1, hand)
    assert len(arm.published) == n + 1


def test_a_motion_that_could_not_be_published_leaves_the_stop_before_it_withheld(
    separated, monkeypatch
):
    arm, hand = beside(separated, 0.2)
    n = withheld(arm, monkeypatch)
    arm.monitor.reset()
    with pytest.raises(ZeroDivisionError):
        arm.command(ExecutingMotion(trajectory=arm.motion, start_time=arm.now), lambda: 1 / 0)
    arm.frames(1, hand)
    assert len(arm.published) == n + 1


def test_a_stop_of_the_whole_rest_comes_as_soon_as_it_is_proven(separated, monkeypatch):
    arm = separated()
    arm.frames(5)
    unproven = separation.Blocked(0.0, 'bar', 'box')
    answers = [unproven, None, unproven, None]
    monkeypatch.setattr(
        commitments, 'first_unproven', lambda *_: answers.pop(0) if answers else None
    )
    arm.monitor.brake('of the test')
    arm.frames(1)
    assert len(arm.published) == 1
    arm.frames(1)
    assert len(arm.published) == 2
    arm.frames(60)
    assert arm.is_over
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() > 0.1


def test_a_stop_that_is_proven_separate_comes_at_once(separated):
    arm, hand = beside(separated, 0.3)
    n = len(arm.published)
    arm.monitor.fail('of the test')
    assert len(arm.published) == n + 1
    assert arm.statuses[-1].cause == 'of the test'


def test_a_stop_begins_where_the_arm_is_commanded_though_joint_states_are_late(separated):
    arm, hand = beside(separated, 0.3, 30)
    # The last reading is older than the present commitment.
    arm.now += 0.001
    arm.read(*arm.commanded(arm.now - 0.015)[:2])
    reading = arm.inputs.joints.value
    arm.inputs.joints.value = replace(reading, taken=arm.now - 0.015)
    arm.monitor.fail('of the test')
    (stop, begin), (before, start) = arm.published[-1], arm.published[-2]
    assert start < begin
    for now, then, same in zip(
        sample(stop, [0.0]), sample(before, [begin - start]), (1e-6, 1e-4, 0.1), strict=True
    ):
        assert np.abs(now - then).max() <= same


def test_a_motion_that_cannot_begin_is_rejected_and_nothing_is_published(separated):
    arm = separated(contact_speed=0.0)
    arm.see(near(0.03))
    with pytest.raises(RequestError, match='if .* moves, link 3 is not proven separate'):
        arm.begin()
    assert not arm.published


def test_a_held_commitment_is_not_extended_until_then(separated):
    arm, hand = beside(separated, 0.2)
    n = len(arm.published)
    assert arm.monitor.hold(arm.now + 3.5 * FRAME) is arm.monitor.watch.running
    arm.frames(3, hand)
    assert len(arm.published) == n
    arm.frames(2, hand)
    assert len(arm.published) > n


def hand_over(arm):
    """Have another motion replace the running one; return when [s], and where it ends [rad]."""
    handover = arm.now + 0.025
    arm.monitor.hold(handover)
    before, begun = arm.published[-1]
    state = [row[0] for row in sample(before, [handover - begun])]
    assert np.abs(state[1]).max() > 0.1
    end = state[0] + 0.3 * state[1]
    arm.command(
        ExecutingMotion(
            trajectory=Trajectory(
                times=[0.0, 1.0],
                positions=[state[0], end],
                velocities=[state[1], np.zeros(4)],
                accelerations=[state[2], np.zeros(4)],
            ),
            start_time=handover,
        ),
        joins=handover - begun,
    )
    return handover, end


def test_until_a_handover_the_controller_is_given_what_was_proven_before(separated):
    arm, hand = beside(separated, 0.3)
    before, begun = arm.published[-1]
    handover, end = hand_over(arm)
    trajectory, start = arm.published[-1]
    assert trajectory is not before
    assert start == pytest.approx(begin_of(arm.now, 0.01), abs=1e-9)
    until = np.linspace(0.0, handover - start, 26)
    for new, old, same in zip(
        sample(trajectory, until),
        sample(before, start - begun + until),
        (1e-6, 1e-4, 1e-2),
        strict=True,
    ):
        assert np.abs(new - old).max() < same
    arm.frames(200, hand)
    assert np.abs(arm.commanded(arm.now)[0] - end).max() < 1e-3


def test_where_the_controller_rejects_a_handover_the_motion_before_it_goes_on(separated):
    arm, hand = beside(separated, 0.3)
    kept, begin = arm.published[-1]
    _, end = hand_over(arm)
    assert np.abs(end - arm.motion.positions[-1]).max() > 0.1
    n_kept = len(arm.published) - 1
    # Nothing that belongs to the new motion reaches the controller.
    while len(arm.reporter.monitor_state[1]) == 0 and arm.now < begin + 2.0:
        arm.now += FRAME
        arm.read(*(row[0] for row in sample(kept, [arm.now - begin])[:2]))
        arm.see(hand)
    assert 'monitoring the previous one' in arm.reporter.monitor_state[1]
    assert arm.now < begin + 0.3
    arm.published[:] = [*arm.published[:n_kept], *arm.published[-1:]]
    arm.frames(900, hand)
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


@pytest.mark.parametrize('resume', ['auto', 'manual'])
def test_a_motion_that_stopped_on_its_way_goes_on_by_itself_or_after_reset(separated, resume):
    arm, hand = beside(separated, 0.2, resume=resume, replan=False)
    arm.monitor.hold(arm.now + 0.6)
    arm.frames(75, hand)
    arm.frames(10, hand)
    end = arm.motion.positions[-1]
    if resume == 'manual':
        assert np.abs(arm.commanded(arm.now)[0] - end).max() > 0.1
        assert arm.is_over
        arm.monitor.reset()
    arm.frames(900, hand)
    assert np.abs(arm.commanded(arm.now)[0] - end).max() < 1e-6


@pytest.mark.parametrize(
    ('resume', 'replan'), [('auto', True), ('manual', True), ('manual', False)]
)
def test_what_was_stopped_in_motion_is_planned_again_by_itself_or_after_reset(
    separated, resume, replan
):
    arm, hand = beside(separated, 0.3, resume=resume)
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=replan)
    arm.monitor.take_stops()
    arm.monitor.fail('a stale input')
    found = arm.monitor.take_stops()
    assert [stop.is_replanned for stop in found] == [resume == 'auto']
    arm.frames(30, hand)
    assert arm.monitor.take_stops() == []
    arm.monitor.reset()
    found = arm.monitor.take_stops()
    assert [stop.is_replanned for stop in found] == [True] * (resume == 'manual' and replan)
    # Once, and never after an error.
    arm.monitor.reset()
    assert arm.monitor.take_stops() == []


def test_no_reset_goes_on_after_an_error(separated):
    arm, hand = beside(separated, 0.3, resume='manual')
    arm.reporter.parameters = replace(arm.reporter.parameters, replan=True)
    arm.monitor.fail('an error', is_replanned=False)
    arm.frames(30, hand)
    arm.monitor.take_stops()
    arm.monitor.reset()
    assert arm.monitor.take_stops() == []


def test_a_reset_of_a_motion_that_runs_does_not_count_for_its_next_stop(separated):
    arm, hand = beside(separated, 0.2, resume='manual', replan=False)
    arm.monitor.reset()
    arm.frames(5, hand)
    arm.monitor.hold(arm.now + 0.6)
    arm.frames(200, hand)
    assert arm.is_over
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() > 0.1
    assert arm.statuses[-1].cause == 'waits for ~/reset'


def test_a_part_that_gets_further_than_assumed_slows_the_arm_down(separated):
    arm, hand = beside(separated, 0.5, 5)
    jumps = [hand, replace(hand, center=hand.center + 0.08)]
    for k in range(20):
        arm.frames(1, jumps[k % 2])
    assert arm.monitor.watch.commitments.body.n_further == 1
    assert arm.statuses[-1].state is not SeparationState.NORMAL


@pytest.mark.parametrize('clearance', [0.15, 0.3, 0.5])
def test_where_a_part_is_new_the_whole_rest_of_the_motion_is_taken_back(separated, clearance):
    arm, hand = separated(), near(clearance)
    arm.frames(20)
    assert arm.monitor.watch.commitments.is_whole
    n = len(arm.published)
    arm.frames(1, FAR, hand)
    # By a slower motion that is proven, or by a stop.
    assert len(arm.published) == n + 1
    assert arm.statuses[-1].state is not SeparationState.NORMAL
    assert 'stopped' in arm.said or not arm.monitor.watch.commitments.is_whole
    arm.frames(900, FAR, hand)
    assert arm.is_over


def test_a_part_that_is_new_and_far_changes_nothing(separated):
    arm = separated()
    arm.frames(20)
    arm.frames(20, FAR, replace(FAR, name='foot', center=-FAR.center))
    assert len(arm.published) == 1


def test_where_a_part_gets_further_than_assumed_the_whole_rest_is_taken_back(separated):
    hand = Box('hand', [2.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    arm = separated()
    arm.see(hand)
    arm.begin()
    arm.frames(20, hand)
    assert arm.monitor.watch.commitments.is_whole
    n = len(arm.published)
    arm.frames(1, replace(hand, center=hand.center - [1.1, 0.0, 0.0]))
    assert arm.monitor.watch.commitments.body.n_further == 1
    assert len(arm.published) == n + 1
    assert arm.statuses[-1].state is not SeparationState.NORMAL


def test_a_part_is_compared_with_the_body_that_the_running_motion_was_proven_with(separated):
    # At this speed it leaves what is assumed of it only after a second.
    hand, speed = Box('hand', [3.0, -1.0, 0.0], [0.1] * 3, np.eye(3)), 1.2
    arm, noticed = separated(), []
    arm.see(hand)
    arm.begin()
    begin = arm.now
    for _ in range(140):
        arm.frames(1, replace(hand, center=hand.center + [0.0, speed * (arm.now - begin), 0.0]))
        noticed.append(arm.monitor.watch.commitments.body.n_further)
    assert len(arm.published) == 1
    assert noticed[-1] > 0
    assert noticed.index(1) * FRAME > 0.9


def test_a_motion_that_was_proven_with_a_body_that_is_kept_no_more_is_proven_anew(separated):
    arm = separated()
    arm.frames(20)
    known = arm.monitor.watch.commitments
    assert known.is_whole
    assert known.sent.seen < known.came
    body = replace(known.body, kept=KeptSights())
    know(arm.monitor, commitments=replace(known, body=body))
    arm.frames(1)
    after = arm.monitor.watch.commitments
    assert after.is_whole
    assert not after.is_news
    assert after.sent.seen == after.came > known.came
    assert len(arm.published) == 1


def test_where_commitments_take_longer_to_find_they_begin_later(separated):
    arm, hand, ahead = separated(), near(0.3), []
    arm.see(hand)
    for took in (0.0, 0.012):
        know(arm.monitor, commitments=replace(arm.monitor.watch.commitments, took=took))
        arm.begin()
        found = []
        for _ in range(10):
            arm.frames(1, hand)
            found.append(arm.monitor.watch.commitments.present.start_time - arm.now)
        ahead.append(max(found))
    assert 0.008 < ahead[1] - ahead[0] < 0.02


def test_a_commitment_that_comes_when_a_sharp_stop_has_begun_is_not_published(
    separated, monkeypatch, clock
):
    arm, hand = beside(separated, 0.3, stop_acceleration=[10.0], stop_jerk=[400.0])
    # Less than what is too long in any case.
    took = arm.monitor.watch.commitments.present.stretch - FRAME - 0.001
    assert 0.0 < took < commitments.LATEST

    def slow(*arguments):
        clock.present += took
        return extended(*arguments)

    monkeypatch.setattr(commitments, 'extended', slow)
    n = len(arm.published)
    arm.frames(1, hand)
    assert len(arm.published) == n
    monkeypatch.setattr(commitments, 'extended', extended)
    arm.frames(900, hand)
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


def test_of_bodies_that_came_together_all_are_seen_and_the_newest_is_checked(separated):
    arm, hand = beside(separated, 0.3, 5)
    n, sights = len(arm.published), arm.monitor.watch.commitments.body.n_seen
    arm.now += FRAME
    arm.read(*arm.commanded(arm.now)[:2])
    part = BodyPart((replace(hand, center=hand.center + 0.08),), float('inf'), arm.now - 0.02)
    body = WearerBody(((('hand', 0), part),))
    arm.monitor.on_body(body, 0, is_newest=False)
    assert len(arm.published) == n
    assert arm.monitor.watch.commitments.body.n_seen == sights + 1
    assert arm.monitor.watch.commitments.body.n_further == 1
    arm.frames(1, hand)
    assert len(arm.published) > n


def test_the_ray_is_clear_only_while_it_is_known_to_meet_nobody(separated):
    arm = separated()
    arm.begin()
    arm.frames(2)
    assert arm.ray_clear[-1]
    T = reference_checker.frames(ARM, arm.commanded(arm.now)[:1])[0, -1]
    arm.frames(1, Box('hand', T[:3, 3] + 0.6 * T[:3, 2], [0.1] * 3, np.eye(3)))
    assert not arm.ray_clear[-1]
    arm.frames(2)
    assert arm.ray_clear[-1]
    # A part that is lost may be anywhere, also where the motion goes on.
    arm.see(FAR, expires=arm.now + 0.01)
    arm.frames(4, sees=False)
    assert not arm.ray_clear[-1]
    assert arm.monitor.watch.is_monitoring
    arm.frames(2)
    assert arm.ray_clear[-1]
    # Older than `body_timeout`.
    arm.frames(30, sees=False)
    assert not arm.ray_clear[-1]


def in_the_ray():
    """Return a hand in the pointing ray at the end of the motion, far from the arm itself."""
    T = reference_checker.frames(ARM, SWING.positions[-1:])[0, -1]
    return Box('other hand', T[:3, 3] + 0.7 * T[:3, 2], [0.1] * 3, np.eye(3))


def check_ray(arm, n_before, hand):
    """Check that no commitment since leads the ray into a hand."""
    length = arm.reporter.parameters.ray_guard_length
    for trajectory, _ in arm.published[n_before:]:
        q, _, _ = sample(trajectory, np.linspace(0.0, trajectory.duration, 200))
        assert reference_checker.first_contact(ARM, Scene((hand,)), q, length, 0.0) is None


def test_a_hand_in_the_ray_further_on_stops_the_arm_only_where_it_stays(separated):
    arm, hand = beside(separated, 0.3)
    n, other = len(arm.published), in_the_ray()
    arm.frames(15, hand, other)
    assert 'stopped' not in arm.said
    assert len(arm.published) > n + 5
    check_ray(arm, n, other)
    # It moves on: so does the arm, to the end.
    arm.frames(600, hand)
    assert 'stopped' not in arm.said
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6

    arm, hand = beside(separated, 0.3)
    n = len(arm.published)
    arm.frames(60, hand, other)
    assert 'stopped' in arm.said
    assert arm.monitor.watch.stop_reason == IN_THE_WAY
    check_ray(arm, n, other)
    arm.frames(100, hand, other)
    assert not arm.commanded(arm.now)[1].any()


@pytest.mark.parametrize('rate', [120, 30])
@pytest.mark.parametrize('clearance', [0.3, 0.7, None])
def test_a_hand_that_comes_into_the_ray_has_the_arm_slow_down_before(separated, clearance, rate):
    arm, hand = separated(), FAR if clearance is None else near(clearance)
    arm.period = 1.0 / rate
    arm.see(hand)
    arm.begin()
    arm.frames(rate // 12, hand)
    # Without a wearer near the controller has the whole rest of the motion.
    assert arm.monitor.watch.commitments.is_whole == (clearance is None)
    expected, way = Scene((in_the_ray(),)), []
    arm.inputs.expected_scene = lambda: expected
    for _ in range(4 * rate):
        arm.frames(1, hand)
        way.append(arm.commanded(arm.now)[0])
    length, margin = (getattr(arm.reporter.parameters, n) for n in ('ray_guard_length', 'margin'))
    assert reference_checker.first_contact(ARM, expected, np.array(way), length, margin) is None
    assert not arm.commanded(arm.now)[1].any()
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() > 1e-2


def test_where_the_controller_rejects_commitments_the_one_that_it_executes_is_continued(separated):
    arm, hand = beside(separated, 0.2, 25)
    # From here on nothing reaches the controller for a while.
    kept, begin = arm.published[-1]
    for _ in range(12):
        arm.now += FRAME
        arm.read(*(row[0] for row in sample(kept, [arm.now - begin])[:2]))
        arm.see(hand)
        arm.monitor.check()
    n = len(arm.published)
    last = arm.published[-1]
    arm.published[:] = [m for m in arm.published if m[1] <= begin] + [last]
    # The last one begins where the arm is, and it arrives.
    q = sample(kept, [last[1] - begin])[0][0]
    assert np.abs(last[0].positions[0] - q).max() < 0.02
    assert n > 30
    arm.frames(900, hand)
    assert np.abs(arm.commanded(arm.now)[0] - arm.motion.positions[-1]).max() < 1e-6


def test_an_arm_that_rests_beside_its_commitment_goes_on_from_where_it_is(separated):
    arm, hand = beside(separated, 0.2, 25)
    kept, begin = arm.published[-1]
    arm.frames(1, hand)
    # That one does not reach the controller.
    lost, _ = arm.published.pop()
    gap = np.abs(lost.positions[-1] - kept.positions[-1]).max()
    assert 5e-4 < gap < 0.01
    arm.monitor.hold(arm.now + 0.6)
    n = len(arm.published)
    while len(arm.published) == n and arm.now < begin + 2.0:
        arm.now += FRAME
        arm.read(*(row[0] for row in sample(kept, [arm.now - begin])[:2]))
        arm.see(hand)
        arm.monitor.check()
    trajectory, start = arm.published[-1]
    assert start > begin + kept.duration
    assert np.abs(trajectory.positions[0] - kept.positions[-1]).max() < 1e-4


def goes_on(arm, hand):
    """Let the arm go on, beside a hand and without bodies."""
    arm.frames(10, sees=False)
    arm.frames(60, hand)


def is_stopped_and_goes_on_after_a_reset(arm, hand):
    """Let a fault stop the arm, and another motion begin after a reset."""
    arm.monitor.fail('an error', is_replanned=False)
    arm.frames(40, hand)
    arm.monitor.take_stops()
    arm.monitor.reset()
    arm.monitor.report_hold('of the test')
    arm.command(ExecutingMotion(trajectory=arm.motion, start_time=arm.now + AHEAD), joins=None)
    arm.frames(20, hand)


def is_handed_over(arm, hand):
    """Let another motion replace the running one."""
    hand_over(arm)
    arm.frames(30, hand)


def cannot_be_published(arm, hand):
    """Let no message go out for a while, and a motion be rejected."""
    publishers = arm.publishers
    publish, publishers.publish_motion = publishers.publish_motion, lambda *_: 1 / 0
    arm.frames(5, hand)
    arm.monitor.reset()
    with pytest.raises(RequestError, match='could not be published'):
        arm.command(ExecutingMotion(trajectory=SWING, start_time=arm.now + AHEAD), joins=None)
    publishers.publish_motion = publish
    arm.frames(20, hand)


def has_a_wearer_in_the_way(arm, _):
    """Let a hand come into the way at once."""
    arm.frames(40, near(0.0))


FLIGHTS = (
    goes_on,
    is_stopped_and_goes_on_after_a_reset,
    is_handed_over,
    cannot_be_published,
    has_a_wearer_in_the_way,
)


@pytest.fixture(name='flown', params=FLIGHTS)
def _flown(request, separated):
    arm, hand = separated(), near(0.3)
    arm.monitor.flight, arm.n_before = FlightRecorder(), len(arm.published)
    arm.see(hand)
    arm.command(ExecutingMotion(trajectory=SWING, start_time=arm.now + AHEAD), joins=None)
    arm.frames(20, hand)
    request.param(arm, hand)
    return arm


def test_what_was_decided_is_decided_again_to_the_bit(flown):
    flight = read_flight(flown.monitor.flight.to_bytes())
    found = list(replay(flight))
    assert len(found) == len(flight.entries) > 60
    assert all(one.is_same for one in found)
    commands = [one.command for one in found if one.command is not None]
    assert len(commands) >= 5
    # Of what was published since then nothing is missing, in its order.
    again = [command.motion.trajectory for command in commands]
    published = [motion for motion, _ in flown.published[flown.n_before :]]
    assert len(published) == len(again)
    for motion, other in zip(published, again, strict=True):
        assert (motion.times == other.times).all()
        assert all((a == b).all() for a, b in zip(motion.states, other.states, strict=True))


def test_a_replay_says_at_which_event_another_command_is_given(separated):
    arm, hand = beside(separated, 0.3)
    arm.monitor.flight = FlightRecorder()
    arm.frames(20, hand)
    flight = read_flight(arm.monitor.flight.to_bytes())
    n = [k for k, entry in enumerate(flight.entries) if entry.command][3]
    wrong = replace(flight.entries[n], command=bytes(16))
    entries = (*flight.entries[:n], wrong, *flight.entries[n + 1 :])
    found = list(replay(replace(flight, entries=entries)))
    assert [one.number for one in found if not one.is_same] == [n]


def test_only_values_of_this_package_are_read():
    for content, sentence in (
        (b'', 'another file'),
        (MAGIC.replace(FORMAT, b'1') + pickle.dumps(len), 'format 1, expected 2'),
        (MAGIC + pickle.dumps(len), 'builtins.len, expected values of this package'),
        (MAGIC + b'\x80', 'damaged'),
        (MAGIC + pickle.dumps(([], pickle.dumps(3), [])), 'no watch'),
    ):
        with pytest.raises(RecordError, match=sentence):
            read_flight(content)


def test_a_flight_is_replayed_by_a_command(flown, tmp_path, capsys):
    file = tmp_path / 'of_the_test.flight'
    file.write_bytes(flown.monitor.flight.to_bytes())
    assert replay_command.main([str(file)]) == 0
    *lines, last = capsys.readouterr().out.splitlines()
    assert last == 'reproduced: every command is the same as recorded, to the bit'
    assert any('monitoring' in line for line in lines)
    file.write_bytes(file.read_bytes()[:-100])
    assert replay_command.main([str(file)]) == 2
    assert 'flight record: damaged' in capsys.readouterr().err


@pytest.mark.parametrize(('took', 'is_late'), [(0.0, False), (0.015, True)])
def test_what_it_takes_to_see_the_wearer_counts_for_a_commitment(separated, clock, took, is_late):
    arm, hand = beside(separated, 0.3)
    n, expected_scene = len(arm.published), arm.inputs.expected_scene

    def slow():
        clock.present += took
        return expected_scene()

    arm.inputs.expected_scene = slow
    arm.frames(1, hand)
    # The arm has gone on meanwhile.
    assert len(arm.published) == n + (not is_late)
    assert (arm.monitor.watch.commitments.took > 0.01) == is_late
