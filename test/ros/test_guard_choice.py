# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the guard does with arms that lag, lie or do not hear, and with stops that touch."""

from dataclasses import replace
import re

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from monitored import ARM, FAR, Monitored, PHASE  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.collision import reference_checker  # noqa: E402
from rrth_planner.execution.executing_motion import ExecutingMotion  # noqa: E402
from rrth_planner.model.scene import Box  # noqa: E402
from rrth_planner.model.trajectory import sample, Trajectory  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.marker_edits import BodyPart  # noqa: E402
from rrth_planner.ros.monitor.execution_monitor import ExecutionMonitor, Watch  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')


@pytest.fixture
def watched():
    """Give a guard with its motion."""
    node = Node('choice')
    yield Monitored(node)
    node.destroy_node()


def test_an_arm_that_has_its_way_goes_on(watched):
    watched.see(FAR)
    assert watched.published == []
    assert watched.said == ['free']


@pytest.mark.parametrize('ahead', [0.02, 0.1, 0.6])
def test_an_arm_brakes_whether_or_not_its_stop_is_free(watched, ahead, capfd):
    watched.see(watched.hand(ahead, 0.0))
    ((stop, _),) = watched.published
    assert watched.said == ['braked']
    assert not stop.velocities[-1].any()
    sentence = watched.reporter.guard[1]
    assert 'fail-safe stop' in sentence
    assert ('not proven safe either' in sentence) == (ahead < 0.3)
    # What is proven free, and only that, is for the second judge too.
    (kept,) = watched.guard.take_stops()
    assert kept.trajectory is stop
    assert (kept.scene is None) == (ahead < 0.3)
    level = 'ERROR' if ahead < 0.3 else 'WARN'
    (line,) = [line for line in capfd.readouterr().err.splitlines() if sentence in line]
    took = float(re.search('; published after (.*) ms$', line)[1])
    assert took == pytest.approx(1e3 * watched.took[0], abs=0.01)
    assert level in line


def test_how_near_a_stop_comes_that_is_not_free_is_said(watched):
    # Beside the way of the ray, within the margin.
    hand, next_hand = watched.hand(0.1, 0.0), watched.hand(0.11, 0.0)
    ray = reference_checker.frames(ARM, watched.on_time(PHASE + 0.1)[0][None])[0, -1, :3, 2]
    aside = np.cross(ray, next_hand.center - hand.center)
    center = hand.center + 0.053 * aside / np.linalg.norm(aside)
    watched.see(Box('hand', center, hand.size, hand.rotation))
    ((stop, _),) = watched.published
    q = sample(stop, np.linspace(0.0, stop.duration, 2000))[0]
    scene = scene_of(watched.heard.body.value.at(watched.now))
    parameters = watched.reporter.parameters
    least = reference_checker.least_clearance(ARM, scene, q, parameters.ray_guard_length)
    assert 0.003 < least < parameters.margin
    said = watched.reporter.guard[1].partition('not proven safe either, least clearance ')[2]
    assert float(said.removesuffix(' m')) == pytest.approx(least, abs=2e-4)


def test_an_arm_that_is_too_near_goes_on_where_that_leads_away(watched):
    watched.see(watched.hand(0.0, 0.045))
    assert watched.published == []
    state, sentence = watched.reporter.guard
    assert state == Watch.WATCHING.value
    assert 'going on leads away' in sentence
    # But not into something else.
    watched.see(watched.hand(0.0, 0.045), watched.hand(0.6, 0.0))
    assert len(watched.published) == 1


# What an arm may say of itself when it was told to be at q with the velocity v.
ARMS = {
    'ideal': lambda q, v: (q, v),
    'beside its path': lambda q, v: (q + [0.0, 0.0025, 0.0, 0.0], v),
    'far beside its path': lambda q, v: (q + [0.0, 0.05, 0.0, 0.0], v),
    'no velocities': lambda q, v: (q, 0.0 * v),
    'one velocity that is none': lambda q, v: (q, v + [0.0, 0.0, 0.0, np.nan]),
}


@pytest.mark.parametrize('late', [0.0, 0.06])
@pytest.mark.parametrize('arm', ARMS)
def test_every_arm_is_braked(watched, arm, late):
    watched.read(*ARMS[arm](*watched.on_time(PHASE - late)))
    watched.see(watched.hand(0.6, 0.0))
    ((stop, begin),) = watched.published
    assert begin == watched.now
    # From where it is, not from where it should be.
    q = watched.on_time(PHASE - late)[0]
    assert np.abs(stop.positions[0] - q).max() < 5e-3


def test_the_guard_looks_while_simulated_time_stands_still(spinning, wait_until, monkeypatch):
    looks = []
    monkeypatch.setattr(ExecutionMonitor, '_on_timer', lambda _: looks.append(0))
    node = Node('paused', parameter_overrides=[Parameter('use_sim_time', value=True)])
    Monitored(node)
    with spinning(node):
        wait_until(lambda: len(looks) > 5)
    assert node.get_clock().now().nanoseconds == 0
    node.destroy_node()


def test_an_arm_that_has_not_begun_is_held(watched):
    watched.read(watched.motion.positions[0], np.zeros(4))
    watched.see(watched.hand(0.6, 0.0))
    ((stop, _),) = watched.published
    assert np.abs(stop.positions - watched.motion.positions[0]).max() < 5e-3


def test_a_motion_that_begins_is_held_against_the_body_of_then(watched):
    hand = watched.hand(0.6, 0.0)
    # It came after the motion was looked at last, while none was watched.
    for boxes, n_stops in (([FAR], 0), ([FAR, hand], 1)):
        parts = tuple(((box.name, 0), BodyPart((box,))) for box in boxes)
        watched.heard.body.value = WearerBody(parts)
        watched.begin()
        assert len(watched.published) == n_stops


def test_a_motion_that_takes_over_is_watched_before_it_begins(watched):
    watched.now = 100.0 - 0.2
    watched.read(watched.motion.positions[0] + 0.5, np.full(4, 1.0))
    watched.begin()
    watched.see(watched.hand(0.6, 0.0))
    ((stop, begin),) = watched.published
    assert begin == 100.0
    assert np.allclose(stop.positions[0], watched.motion.positions[0])


def _turned(watched, after):
    """Return a motion that takes over so much after the phase [s], and leads elsewhere."""
    q, v, a = (row[0] for row in sample(watched.motion, [PHASE + after]))
    return Trajectory(
        times=[0.0, 1.0],
        positions=[q, q + [0.0, 0.0, 0.1, 0.3]],
        velocities=[v, np.zeros(4)],
        accelerations=[a, np.zeros(4)],
    )


def fail(*_):
    raise OSError('nothing works')


def test_a_motion_that_could_not_be_told_is_not_watched(watched):
    before = watched.guard.running
    running = ExecutingMotion(trajectory=_turned(watched, 0.2), start_time=watched.now + 0.2)
    with pytest.raises(OSError, match='nothing works'):
        watched.tell(running, fail)
    assert watched.guard.running is before
    watched.see(watched.hand(0.15, 0.0))
    assert len(watched.published) == 1


def test_the_way_to_a_motion_that_takes_over_is_watched_too(watched):
    running = ExecutingMotion(trajectory=_turned(watched, 0.2), start_time=watched.now + 0.2)
    watched.tell(running)
    watched.now += 0.02
    watched.read(*watched.on_time(PHASE + 0.02))
    watched.see(FAR)
    assert watched.published == []
    # In the way of the old motion, before the new one begins.
    watched.see(watched.hand(0.15, 0.0))
    ((stop, begin),) = watched.published
    assert begin == watched.now
    assert np.allclose(stop.positions[0], watched.on_time(PHASE + 0.02)[0], atol=1e-3)


def _told(watched, ahead):
    """Tell a motion that takes over; return it, and arms by whether they take it."""
    turned = _turned(watched, ahead)
    running = ExecutingMotion(trajectory=turned, start_time=watched.now + ahead)
    watched.tell(running)

    def taken(after):
        if after < ahead:
            return watched.on_time(PHASE + after)
        return tuple(row[0] for row in sample(turned, [after - ahead])[:2])

    return turned, {True: taken, False: lambda after: watched.on_time(PHASE + after)}


@pytest.mark.parametrize('ahead', [0.0, 0.02])
@pytest.mark.parametrize('is_taken', [True, False])
def test_what_the_arm_follows_is_watched_even_where_it_was_told_otherwise(
    watched, ahead, is_taken
):
    _, arms = _told(watched, ahead)
    watched.run(0.35, arms[is_taken])
    assert watched.published == []
    assert ('did not take its new motion' in watched.reporter.guard[1]) != is_taken
    # In the way of the old motion.
    watched.see(watched.hand(0.6, 0.0))
    assert len(watched.published) == (not is_taken)
    for stop, _ in watched.published:
        assert np.allclose(stop.positions[0], watched.on_time(PHASE + 0.35)[0], atol=1e-3)


@pytest.mark.parametrize('aside', [0.0, 0.002, 0.004, 0.015])
def test_an_arm_beside_its_new_motion_is_watched_on_that(watched, aside):
    turned, arms = _told(watched, 0.02)

    def arm(after):
        (q, v), (old, _) = arms[True](after), arms[False](after)
        gap = np.abs(old - q).max()
        return q + (old - q) * min(1.0, aside / max(gap, 1e-9)), v

    watched.run(0.35, arm)
    watched.see(watched.hand(0.9, 0.0, turned))
    ((stop, _),) = watched.published
    assert np.abs(stop.positions[0] - arm(0.35)[0]).max() <= aside + 1e-3


def test_an_arm_that_takes_its_motion_late_is_watched_on_that_again(watched):
    turned, arms = _told(watched, 0.0)
    watched.run(0.3, arms[False])
    assert 'did not take its new motion' in watched.reporter.guard[1]
    watched.now += 0.02
    watched.read(*(row[0] for row in sample(turned, [0.8])[:2]))
    watched.guard._on_timer()
    assert 'follows the last commanded motion again' in watched.reporter.guard[1]
    watched.see(watched.hand(0.95, 0.0, turned))
    assert len(watched.published) == 1


def test_an_arm_that_took_neither_its_motion_nor_the_stop_of_it_is_stopped_on_its_way(watched):
    turned, arms = _told(watched, 0.02)
    watched.run(0.04, arms[False])
    watched.see(watched.hand(0.5, 0.0, turned), watched.hand(0.8, 0.0))
    assert len(watched.published) == 1
    begin = watched.now
    for k in range(1, 31):
        watched.now = begin + 0.01 * k
        watched.read(*arms[False](watched.now - 100.0 - PHASE))
        watched.guard._on_timer()
    stop, at = watched.published[1]
    assert np.allclose(stop.positions[0], arms[False](at - 100.0 - PHASE)[0], atol=1e-3)


@pytest.mark.parametrize('back', [0.1, 0.6, 3600.0])
def test_a_clock_that_is_set_back_does_not_move_the_stop(watched, back):
    q, v = watched.on_time(PHASE)
    watched.now -= back
    watched.read(q, v)
    watched.see(watched.hand(0.6, 0.0))
    ((stop, begin),) = watched.published
    assert begin == watched.now
    assert np.allclose(stop.positions[0], q, atol=1e-3)


@pytest.mark.parametrize(
    ('setting', 'why'),
    [
        ({'body_timeout': 0.2}, 'body_timeout'),
        ({'joint_timeout': 0.05}, 'joint_timeout'),
        ({}, 'lifetime'),
    ],
)
@pytest.mark.parametrize('arm', ARMS)
def test_what_is_not_seen_any_more_stops_the_arm(watched, setting, why, arm):
    watched.reporter.parameters = replace(watched.reporter.parameters, **setting)
    watched.see(FAR, expires=watched.now + (0.1 if why == 'lifetime' else 10.0))
    watched.read(*ARMS[arm](*watched.on_time(PHASE)))
    watched.guard._on_timer()
    assert watched.published == []
    watched.now += 0.3
    if why != 'joint_timeout':
        watched.read(*ARMS[arm](*watched.on_time(PHASE + 0.3)))
    watched.guard._on_timer()
    assert len(watched.published) == 1
    assert why in watched.reporter.guard[1]


@pytest.mark.parametrize('late', [0.0, 0.004, 0.03, 0.09])
@pytest.mark.parametrize('beside', [0.0, 0.005])
def test_an_arm_that_obeys_is_told_once(watched, late, beside):
    watched.see(watched.hand(0.6, 0.0))
    ((stop, _),) = watched.published

    def obeys(after):
        if after < late:
            q, v = watched.on_time(PHASE + after - late)
        else:
            q, v, _ = (row[0] for row in sample(stop, [after - late]))
        return q + beside, v

    watched.run(1.5, obeys)
    assert len(watched.published) == 1
    assert watched.guard._state is Watch.HOLDING


def test_an_arm_that_goes_on_is_told_again(watched):
    watched.see(watched.hand(0.8, 0.0))
    watched.run(0.6, lambda after: watched.on_time(PHASE + after))
    assert 2 <= len(watched.published) <= 4
    for stop, begin in watched.published[1:]:
        # From where it is then.
        assert np.allclose(stop.positions[0], watched.on_time(begin - 100.0)[0], atol=1e-4)


def test_an_arm_that_is_elsewhere_is_said_aloud(watched):
    watched.run(0.8, lambda after: (watched.motion.positions[0] + 0.5, np.full(4, 0.2)))
    assert watched.published == []
    assert 'monitoring suspended' in watched.reporter.guard[1]


@pytest.mark.parametrize('replan', [False, True])
def test_it_plans_again_for_the_same_goal_only_where_it_may(watched, replan):
    watched.reporter.parameters = replace(watched.reporter.parameters, replan=replan)
    watched.see(watched.hand(0.6, 0.0))
    ((stop, _),) = watched.published
    (kept,) = watched.guard.take_stops()
    assert (kept.trajectory, kept.is_again) == (stop, replan)
    assert kept.goal.target.tolist() == [1.0, 1.0, 1.0]
    assert watched.guard.take_stops() == []


def test_what_became_of_an_older_motion_does_not_unguard_a_newer_one(watched, capfd):
    watched.guard.hold('no way to the goal before')
    assert watched.guard._state is Watch.WATCHING
    watched.see(watched.hand(0.6, 0.0))
    assert len(watched.published) == 1
    watched.guard.hold('no way to the goal')
    assert watched.guard._state is Watch.HOLDING
    said = 'arm holds its position: no way to the goal'
    assert watched.reporter.guard == ('holding', said)
    assert said in capfd.readouterr().err
