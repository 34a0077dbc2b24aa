# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The monitor with arms that lag, misreport or ignore commands, and with stops in violation."""

from dataclasses import replace
import re

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import ARM, FAR, Monitored, PHASE, without_separation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.collision import reference_checker  # noqa: E402
from rrth_planner.execution.decide import SOON_IN_THE_WAY  # noqa: E402
from rrth_planner.execution.executing_motion import ExecutingMotion  # noqa: E402
from rrth_planner.execution.watch import MonitorState  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.trajectory import MotionLimits, sample, Trajectory  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import BodyPart  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')


@pytest.fixture
def monitored():
    """Give a monitor with its motion."""
    node = Node('choice')
    yield Monitored(node)
    node.destroy_node()


def test_a_free_motion_continues(monitored):
    monitored.see(FAR)
    assert monitored.published == []
    assert monitored.said == ['free']


@pytest.mark.parametrize('ahead', [0.1, 0.2, 0.7])
def test_an_arm_stops_for_a_part_that_is_about_to_move_into_its_way(monitored, ahead):
    expected = Scene((monitored.hand(ahead, 0.0),))
    monitored.inputs.expected_scene = lambda: expected
    monitored.see(FAR)
    # Further on there is time enough.
    assert monitored.said == (['free'] if ahead > 0.5 else ['stopped'])
    if ahead < 0.5:
        assert monitored.monitor.watch.stop_reason == SOON_IN_THE_WAY
        # It is proven free of the wearer as he is.
        (stop,) = monitored.monitor.take_stops()
        assert stop.scene is not None


@pytest.mark.parametrize('ahead', [0.02, 0.1, 0.6])
def test_an_arm_stops_whether_or_not_its_stop_is_free(monitored, ahead, capfd):
    monitored.see(monitored.hand(ahead, 0.0))
    ((stop, _),) = monitored.published
    assert monitored.said == ['stopped']
    assert not stop.velocities[-1].any()
    sentence = monitored.reporter.monitor_state[1]
    assert 'fail-safe stop' in sentence
    assert ('not proven free either' in sentence) == (ahead < 0.3)
    # What is proven free, and only that, is checked by the second checker too.
    (kept,) = monitored.monitor.take_stops()
    assert kept.trajectory is stop
    assert (kept.scene is None) == (ahead < 0.3)
    level = 'ERROR' if ahead < 0.3 else 'WARN'
    (line,) = [line for line in capfd.readouterr().err.splitlines() if sentence in line]
    took = float(re.search('; published after (.*) ms$', line)[1])
    assert took == pytest.approx(1e3 * monitored.took[0], abs=0.01)
    assert level in line


def test_drives_that_can_do_more_stop_sooner_and_before_the_hand():
    node, stops = Node('choice'), []
    usual = without_separation(node)
    strong = MotionLimits(usual.limits.velocity, np.full(4, 10.0), np.full(4, 400.0))
    for limits in (usual.stop_limits, strong):
        monitored = Monitored(node, replace(usual, stop_limits=limits))
        # So near that only the stronger stop ends before it.
        monitored.see(monitored.hand(0.36, 0.0))
        ((stop, _),) = monitored.published
        stops.append(stop)
        assert ('not proven free either' in monitored.reporter.monitor_state[1]) == (
            limits is not strong
        )
        _, v, a = sample(stop, np.linspace(0.0, stop.duration, 2000))
        assert (np.abs(v) <= 1.01 * limits.velocity).all()
        assert (np.abs(a) <= 1.01 * limits.acceleration).all()
    node.destroy_node()
    assert stops[1].duration < 0.6 * stops[0].duration


def test_the_clearance_of_a_stop_that_is_not_free_is_reported(monitored):
    # Beside the way of the ray, within the margin.
    hand, next_hand = monitored.hand(0.1, 0.0), monitored.hand(0.11, 0.0)
    ray = reference_checker.frames(ARM, monitored.on_time(PHASE + 0.1)[0][None])[0, -1, :3, 2]
    aside = np.cross(ray, next_hand.center - hand.center)
    center = hand.center + 0.053 * aside / np.linalg.norm(aside)
    monitored.see(Box('hand', center, hand.size, hand.rotation))
    ((stop, _),) = monitored.published
    q = sample(stop, np.linspace(0.0, stop.duration, 2000))[0]
    scene = scene_of(monitored.inputs.body.value.at(monitored.now))
    parameters = monitored.reporter.parameters
    least = reference_checker.least_clearance(ARM, scene, q, parameters.ray_guard_length)
    assert 0.003 < least < parameters.margin
    said = monitored.reporter.monitor_state[1].partition(
        'not proven free either, least clearance '
    )[2]
    assert float(said.removesuffix(' m')) == pytest.approx(least, abs=2e-4)


# Within the margin, and with the ray in the hand.
@pytest.mark.parametrize('away', [0.045, 0.01])
def test_an_arm_that_violates_the_margin_continues_where_that_escapes(monitored, away):
    monitored.see(monitored.hand(0.0, away))
    assert monitored.published == []
    state, sentence = monitored.reporter.monitor_state
    assert state == MonitorState.MONITORING.value
    assert 'the arm escapes, which a stop would prevent' in sentence
    # But not into something else.
    monitored.see(monitored.hand(0.0, away), monitored.hand(0.6, 0.0))
    assert len(monitored.published) == 1


# What a driver may report when q and the velocity v were commanded.
ARMS = {
    'ideal': lambda q, v: (q, v),
    'beside its path': lambda q, v: (q + [0.0, 0.0025, 0.0, 0.0], v),
    'far beside its path': lambda q, v: (q + [0.0, 0.05, 0.0, 0.0], v),
    'no velocities': lambda q, v: (q, 0.0 * v),
    'one velocity that is none': lambda q, v: (q, v + [0.0, 0.0, 0.0, np.nan]),
}


def stopped_now(monitored):
    """Return what the one stop that was published commands now, (dof,) [rad]."""
    ((stop, begin),) = monitored.published
    # It begins shortly before it is published.
    assert begin <= monitored.now
    return sample(stop, [monitored.now - begin])[0][0]


@pytest.mark.parametrize('late', [0.0, 0.06])
@pytest.mark.parametrize('arm', ARMS)
def test_every_arm_is_stopped(monitored, arm, late):
    monitored.read(*ARMS[arm](*monitored.on_time(PHASE - late)))
    monitored.see(monitored.hand(0.6, 0.0))
    # From what it is commanded, however it lags; from where it is, where it does not follow that.
    commanded = PHASE - late if arm == 'far beside its path' else PHASE
    assert np.abs(stopped_now(monitored) - monitored.on_time(commanded)[0]).max() < 5e-3


def test_the_monitor_checks_while_simulated_time_stands_still(spinning, wait_until):
    node = Node('paused', parameter_overrides=[Parameter('use_sim_time', value=True)])
    monitored = Monitored(node)
    with spinning(node):
        # It says so with each check.
        wait_until(lambda: len(monitored.alive) > 5)
    assert node.get_clock().now().nanoseconds == 0
    node.destroy_node()


def test_an_arm_that_has_not_begun_is_held(monitored):
    monitored.read(monitored.motion.positions[0], np.zeros(4))
    monitored.see(monitored.hand(0.6, 0.0))
    ((stop, _),) = monitored.published
    assert np.abs(stop.positions - monitored.motion.positions[0]).max() < 5e-3


def test_a_motion_is_monitored_before_its_handover(monitored):
    monitored.now = 100.0 - 0.2
    monitored.read(monitored.motion.positions[0] + 0.5, np.full(4, 1.0))
    # What it is commanded until then is not known.
    monitored.command(ExecutingMotion(trajectory=monitored.motion, start_time=100.0), joins=None)
    monitored.published.clear()
    monitored.see(monitored.hand(0.6, 0.0))
    ((stop, begin),) = monitored.published
    assert begin == 100.0
    assert np.allclose(stop.positions[0], monitored.motion.positions[0])


def _turned(monitored, after):
    """Return a motion with a handover so much after the phase [s], to another goal."""
    q, v, a = (row[0] for row in sample(monitored.motion, [PHASE + after]))
    return Trajectory(
        times=[0.0, 1.0],
        positions=[q, q + [0.0, 0.0, 0.1, 0.3]],
        velocities=[v, np.zeros(4)],
        accelerations=[a, np.zeros(4)],
    )


def fail(*_):
    raise OSError('nothing works')


def test_a_motion_that_could_not_be_published_is_not_monitored(monitored):
    before = monitored.monitor.watch.running
    running = ExecutingMotion(trajectory=_turned(monitored, 0.2), start_time=monitored.now + 0.2)
    with pytest.raises(OSError, match='nothing works'):
        monitored.command(running, fail, PHASE + 0.2)
    assert monitored.monitor.watch.running is before
    monitored.see(monitored.hand(0.15, 0.0))
    assert len(monitored.published) == 1


def test_the_motion_before_a_handover_is_monitored_too(monitored):
    running = ExecutingMotion(trajectory=_turned(monitored, 0.2), start_time=monitored.now + 0.2)
    monitored.command(running, joins=PHASE + 0.2)
    monitored.published.clear()
    monitored.now += 0.02
    monitored.read(*monitored.on_time(PHASE + 0.02))
    monitored.see(FAR)
    assert monitored.published == []
    # In the way of the old motion, before the new one begins.
    monitored.see(monitored.hand(0.15, 0.0))
    assert np.allclose(stopped_now(monitored), monitored.on_time(PHASE + 0.02)[0], atol=1e-3)


def _commanded(monitored, ahead):
    """Command a motion with a handover; return it, and arms by whether they accept it."""
    turned = _turned(monitored, ahead)
    running = ExecutingMotion(trajectory=turned, start_time=monitored.now + ahead)
    monitored.command(running, joins=PHASE + ahead)
    monitored.published.clear()

    def taken(after):
        if after < ahead:
            return monitored.on_time(PHASE + after)
        return tuple(row[0] for row in sample(turned, [after - ahead])[:2])

    return turned, {True: taken, False: lambda after: monitored.on_time(PHASE + after)}


@pytest.mark.parametrize('ahead', [0.0, 0.02])
@pytest.mark.parametrize('is_taken', [True, False])
def test_the_executed_motion_is_monitored_even_where_another_was_commanded(
    monitored, ahead, is_taken
):
    _, arms = _commanded(monitored, ahead)
    monitored.run(0.35, arms[is_taken])
    assert monitored.published == []
    assert ('ignored the last commanded motion' in monitored.reporter.monitor_state[1]) != is_taken
    # In the way of the old motion.
    monitored.see(monitored.hand(0.6, 0.0))
    assert len(monitored.published) == (not is_taken)
    if not is_taken:
        assert np.allclose(stopped_now(monitored), monitored.on_time(PHASE + 0.35)[0], atol=1e-3)


@pytest.mark.parametrize('aside', [0.0, 0.002, 0.004, 0.015])
def test_an_arm_beside_its_new_motion_is_monitored_on_that(monitored, aside):
    turned, arms = _commanded(monitored, 0.02)

    def arm(after):
        (q, v), (old, _) = arms[True](after), arms[False](after)
        gap = np.abs(old - q).max()
        return q + (old - q) * min(1.0, aside / max(gap, 1e-9)), v

    monitored.run(0.35, arm)
    monitored.see(monitored.hand(0.9, 0.0, turned))
    assert np.abs(stopped_now(monitored) - arm(0.35)[0]).max() <= aside + 1e-3


def test_an_arm_that_begins_its_motion_late_is_monitored_on_that_again(monitored):
    turned, arms = _commanded(monitored, 0.0)
    monitored.run(0.3, arms[False])
    assert 'ignored the last commanded motion' in monitored.reporter.monitor_state[1]
    monitored.now += 0.02
    monitored.read(*(row[0] for row in sample(turned, [0.8])[:2]))
    monitored.monitor.check()
    assert 'follows the last commanded motion again' in monitored.reporter.monitor_state[1]
    monitored.see(monitored.hand(0.95, 0.0, turned))
    assert len(monitored.published) == 1


def test_an_arm_that_took_neither_its_motion_nor_the_stop_of_it_is_stopped_on_its_way(monitored):
    turned, arms = _commanded(monitored, 0.02)
    monitored.run(0.04, arms[False])
    monitored.see(monitored.hand(0.5, 0.0, turned), monitored.hand(0.8, 0.0))
    assert len(monitored.published) == 1
    begin = monitored.now
    for k in range(1, 31):
        monitored.now = begin + 0.01 * k
        monitored.read(*arms[False](monitored.now - 100.0 - PHASE))
        monitored.monitor.check()
    stop, at = monitored.published[1]
    assert np.allclose(stop.positions[0], arms[False](at - 100.0 - PHASE)[0], atol=1e-3)


@pytest.mark.parametrize('back', [0.1, 0.6, 3600.0])
def test_a_clock_that_is_set_back_does_not_move_the_stop(monitored, back):
    q, v = monitored.on_time(PHASE)
    monitored.now -= back
    monitored.read(q, v)
    monitored.see(monitored.hand(0.6, 0.0))
    assert np.allclose(stopped_now(monitored), q, atol=1e-3)


@pytest.mark.parametrize(
    ('setting', 'why'),
    [
        ({'body_timeout': 0.2}, 'body_timeout'),
        ({'joint_timeout': 0.05}, 'joint_timeout'),
        ({'keep_lost': 0.0}, 'lost'),
    ],
)
@pytest.mark.parametrize('arm', ARMS)
def test_a_stale_input_stops_the_arm(monitored, setting, why, arm):
    monitored.reporter.parameters = replace(monitored.reporter.parameters, **setting)
    monitored.see(FAR, expires=monitored.now + (0.1 if why == 'lost' else 10.0))
    monitored.read(*ARMS[arm](*monitored.on_time(PHASE)))
    monitored.monitor.check()
    assert monitored.published == []
    monitored.now += 0.3
    if why != 'joint_timeout':
        monitored.read(*ARMS[arm](*monitored.on_time(PHASE + 0.3)))
    monitored.monitor.check()
    assert len(monitored.published) == 1
    assert why in monitored.reporter.monitor_state[1]


def test_a_lost_part_stays_where_it_was_until_the_arm_stops(monitored):
    monitored.reporter.parameters = replace(monitored.reporter.parameters, keep_lost=0.4)
    pack = Box('pack', np.array([-2.0, 0.0, 0.0]), np.full(3, 0.1), np.eye(3))
    monitored.see(FAR, pack, expires=monitored.now + 0.1)
    for waited in (0.2, 0.4):
        monitored.now = 100.0 + PHASE + waited
        monitored.read(*monitored.on_time(PHASE + waited))
        # The rest of the body is seen on.
        present = tuple(((FAR.name, k), BodyPart((FAR,))) for k in range(2))
        body = WearerBody(present, monitored.inputs.body.value.at(monitored.now).lost[-1:])
        monitored.inputs.body.value, monitored.inputs.body.measured = body, monitored.now
        monitored.monitor.on_body(body, 0)
        assert monitored.published == []
    monitored.now += 0.2
    monitored.read(*monitored.on_time(PHASE + 0.6))
    monitored.monitor.check()
    assert len(monitored.published) == 1
    assert 'has lost parts: "pack"' in monitored.reporter.monitor_state[1]


def test_an_arm_is_not_driven_into_a_part_that_is_lost(monitored):
    # It is lost in the way of the motion: gone from the messages, but not from the scene.
    hand = monitored.hand(0.6, 0.0)
    lost = WearerBody(
        (((FAR.name, 0), BodyPart((FAR,))),), ((('hand', 0), BodyPart((hand,), 100.0)),)
    )
    monitored.inputs.body.value, monitored.inputs.body.measured = lost, monitored.now
    monitored.monitor.on_body(lost, 0)
    assert len(monitored.published) == 1
    assert 'not proven free' in monitored.reporter.monitor_state[1]


def test_the_age_of_the_body_is_counted_at_each_decision(monitored):
    monitored.ages.clear()
    monitored.see(FAR)
    monitored.inputs.body.measured = monitored.now - 0.05
    monitored.monitor.on_body(monitored.inputs.body.value, 0)
    assert monitored.ages == pytest.approx([0.0, 0.05])


@pytest.mark.parametrize('late', [0.0, 0.004, 0.03, 0.09])
@pytest.mark.parametrize('beside', [0.0, 0.005])
def test_a_stop_that_is_executed_is_published_once(monitored, late, beside):
    monitored.see(monitored.hand(0.6, 0.0))
    ((stop, _),) = monitored.published

    def executes(after):
        if after < late:
            q, v = monitored.on_time(PHASE + after - late)
        else:
            q, v, _ = (row[0] for row in sample(stop, [after - late]))
        return q + beside, v

    monitored.run(1.5, executes)
    assert len(monitored.published) == 1
    assert monitored.monitor.watch.state is MonitorState.HOLDING


def test_a_missed_stop_is_published_again(monitored):
    monitored.see(monitored.hand(0.8, 0.0))
    monitored.run(0.6, lambda after: monitored.on_time(PHASE + after))
    assert 2 <= len(monitored.published) <= 4
    for stop, begin in monitored.published[1:]:
        # From where it is then.
        assert np.allclose(stop.positions[0], monitored.on_time(begin - 100.0)[0], atol=1e-4)


def test_an_arm_off_its_trajectory_is_reported(monitored):
    monitored.run(0.8, lambda after: (monitored.motion.positions[0] + 0.5, np.full(4, 0.2)))
    assert monitored.published == []
    assert 'monitoring suspended' in monitored.reporter.monitor_state[1]


def test_an_arm_off_its_trajectory_is_not_said_to_be_monitored_where_no_body_comes(monitored):
    monitored.reporter.parameters = replace(monitored.reporter.parameters, body_timeout=0.2)
    begin = monitored.now
    monitored.run(0.8, lambda after: (monitored.motion.positions[0] + 0.5, np.full(4, 0.2)))
    # A stop is due, and where it would begin is not known.
    assert monitored.published == []
    assert 'body_timeout' in monitored.monitor.watch.pending.why
    assert 0.1 < max(monitored.alive) - begin < 0.25


@pytest.mark.parametrize('replan', [False, True])
def test_it_plans_again_for_the_same_goal_only_where_it_may(monitored, replan):
    monitored.reporter.parameters = replace(monitored.reporter.parameters, replan=replan)
    monitored.see(monitored.hand(0.6, 0.0))
    ((stop, _),) = monitored.published
    (kept,) = monitored.monitor.take_stops()
    assert (kept.trajectory, kept.is_replanned) == (stop, replan)
    assert kept.goal.target.tolist() == [1.0, 1.0, 1.0]
    assert monitored.monitor.take_stops() == []


def test_the_outcome_of_an_older_motion_does_not_end_monitoring_of_a_newer_one(monitored, capfd):
    monitored.monitor.report_hold('no way to the goal before')
    assert monitored.monitor.watch.state is MonitorState.MONITORING
    monitored.see(monitored.hand(0.6, 0.0))
    assert len(monitored.published) == 1
    monitored.monitor.report_hold('no way to the goal')
    assert monitored.monitor.watch.state is MonitorState.HOLDING
    said = 'arm holds its position: no way to the goal'
    assert monitored.reporter.monitor_state == ('holding', said)
    assert said in capfd.readouterr().err
