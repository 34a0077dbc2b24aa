# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The arm as it moves: its lag, its limits, what it gives up, and what it runs into."""

from dataclasses import replace

import numpy as np
import pytest
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.simulation.mechanics import usual_mechanics
from rrth_planner.simulation.moving_body import body_of_scenes, standing_body
from rrth_planner.simulation.servo import servo_for_lag
from rrth_planner.simulation.simulated_arm import Imperfections, STEP_PERIOD
from rrth_planner.simulation.tool_speed import top_tool_speed
from rrth_planner.simulation.trajectory_controller import (
    ControllerRules,
    ControllerVersion,
    Tolerances,
)
from simulation_samples import motion_between, points_of, simulated, stepped, TOP
from worlds import FOLDED, table_1_arm

pytest.importorskip('mujoco')
ARM = table_1_arm()
STILL = np.zeros(4)


def swing(q_from, joint, velocity, duration):
    """Return a motion of one joint that has a constant velocity in its middle half."""
    ramp, span = 0.25 * duration, 0.5 * duration
    steps = velocity * np.cumsum([0.0, 0.5 * ramp, span, 0.5 * ramp])
    unit = np.eye(4)[joint]
    speeds = np.array([0.0, velocity, velocity, 0.0])
    return Trajectory(
        [0.0, ramp, ramp + span, duration],
        q_from + steps[:, None] * unit,
        speeds[:, None] * unit,
        np.zeros((4, 4)),
    )


@pytest.mark.parametrize('lag', [0.002, 0.01, 0.03])
def test_the_tool_lags_by_the_time_that_was_wished(lag):
    simulation = simulated(ARM, lag=lag, mechanics=replace(usual_mechanics(4), friction=STILL))
    wished = lag / top_tool_speed(ARM, TOP)
    simulation.execute(points_of(swing(FOLDED, 0, 1.2, 2.0)), 0.0)
    readings = stepped(simulation, 1.3)
    errors = np.array([r.wanted.positions - r.true_positions for r in readings[500:]])[:, 0]
    # A step lies between what was commanded and the state after it.
    assert errors.mean() / 1.2 + STEP_PERIOD == pytest.approx(wished, rel=0.05, abs=STEP_PERIOD)
    # And by so much at its place, at the speed of the tool.
    now = readings[-1]
    apart = tool_pose(ARM, now.wanted.positions)[:3, 3] - tool_pose(ARM, now.true_positions)[:3, 3]
    assert np.linalg.norm(apart) < lag


def test_a_delay_of_commands_is_a_part_of_the_lag():
    late = Imperfections(command_delay=0.008)
    frictionless = replace(usual_mechanics(4), friction=STILL)
    one, other = (
        simulated(ARM, lag=0.012, mechanics=frictionless, imperfections=given)
        for given in (Imperfections(), late)
    )
    errors = []
    for simulation in (one, other):
        simulation.execute(points_of(swing(FOLDED, 2, -1.2, 2.0)), 0.0)
        reading = stepped(simulation, 1.0)[-1]
        errors.append((reading.wanted.positions - reading.true_positions)[2])
    assert errors[0] == pytest.approx(errors[1], rel=0.02)
    with pytest.raises(OptionsError, match=r'in the delay of 0\.02 s'):
        servo_for_lag(ARM, frictionless, TOP, lag=0.01, delay=0.02)


def test_it_arrives_and_stays():
    simulation = simulated(ARM)
    goal = FOLDED + [0.5, -0.6, -0.4, 0.3]
    simulation.execute(points_of(motion_between(FOLDED, goal, 1.5)), 0.0)
    last = stepped(simulation, 2.5)[-1]
    np.testing.assert_allclose(last.true_positions, goal, atol=3e-4)
    assert np.abs(last.velocities).max() < 1e-3
    assert simulation.n_at_limit == 0


def test_without_gravity_compensation_it_sags_by_its_weight_over_its_stiffness():
    mechanics = replace(usual_mechanics(4), friction=STILL)
    servo = servo_for_lag(ARM, mechanics, TOP, lag=0.01, gravity_compensation=0.0)
    simulation = simulated(ARM, mechanics=mechanics)
    simulation._servo = servo
    last = stepped(simulation, 2.0)[-1]
    weight = simulation._dynamics.weight(last.true_positions, np.array([0.0, 0.0, -9.81]))
    np.testing.assert_allclose(
        servo.stiffness * (FOLDED - last.true_positions), weight, rtol=1e-3, atol=1e-3
    )
    assert np.abs(weight).max() > 1.0


def test_a_weak_motor_does_not_lift_the_arm_and_a_path_tolerance_ends_that():
    weak = replace(usual_mechanics(4), max_effort=np.full(4, 1.0))
    rules = ControllerRules(tolerances=Tolerances(path=np.full(4, 0.2), goal=STILL))
    simulation = simulated(ARM, mechanics=weak, rules=rules)
    simulation.execute(points_of(motion_between(FOLDED, FOLDED - [0, 1.2, 0, 0], 1.0)), 0.0)
    said = [words for _ in range(500) if (words := simulation.step())]
    assert len(said) == 1
    assert said[0].startswith('joint_2: ')
    assert 'expected path_tolerance 0.2' in said[0]
    assert simulation.command.is_holding
    assert simulation.n_at_limit > 100
    assert np.abs(simulation.reading.efforts).max() <= 1.0


def test_positions_are_read_with_the_noise_that_was_given():
    simulation = simulated(ARM, imperfections=Imperfections(encoder_noise=1e-3, seed=4))
    readings = stepped(simulation, 1.0)
    noise = np.array([r.positions - r.true_positions for r in readings])
    assert noise.std() == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize(
    ('version', 'from_commanded', 'further'),
    # In Jazzy twice a step further on; or back where the arm is, a lag of some 11 ms behind.
    [('4.42', True, 0.004), ('4.20', True, 0.002), ('6.9', True, 0.002), ('4.42', False, -0.01)],
)
def test_a_replaced_motion_goes_on_from_what_is_commanded_or_from_what_is_measured(
    version, from_commanded, further
):
    rules = ControllerRules(version=ControllerVersion(version), is_from_desired=from_commanded)
    simulation = simulated(ARM, rules=rules)
    simulation.execute(points_of(swing(FOLDED, 0, 1.0, 2.0)), 0.0)
    before = stepped(simulation, 1.0)[-1]
    stop = Trajectory(
        [0.0, 1.0], np.array([FOLDED + [1.0, 0, 0, 0]] * 2), np.zeros((2, 4)), np.zeros((2, 4))
    )
    simulation.execute(points_of(stop), simulation.time + 0.2)
    simulation.step()
    way = (simulation.reading.wanted.positions - before.wanted.positions)[0]
    assert way == pytest.approx(further, abs=2e-3 if further < 0.0 else 1e-4)


def scenes_with(box, begin, velocity, n, rate):
    """Return scenes of one box that moves by a velocity, (3,) [m/s]."""
    return [
        Scene((Box(box.name, begin + k / rate * velocity, box.size, box.rotation),))
        for k in range(n)
    ]


def test_an_arm_that_runs_into_a_body_says_how_fast_and_pushes_no_more_than_it_can():
    q = np.array([0.0, -1.2, np.pi / 2, np.pi / 2])
    tool = tool_pose(ARM, q)[:3, 3]
    # Joint 1 turns the arm about the vertical axis through the mount.
    ahead = tool_pose(ARM, q + [0.5, 0.0, 0.0, 0.0])[:3, 3]
    wall = Box('wall', ahead + (ahead - tool) * 0.3, [0.1, 0.1, 0.5], np.eye(3))
    simulation = simulated(ARM, q=q, body=standing_body(Scene((wall,))))
    simulation.execute(points_of(swing(q, 0, 1.0, 2.0)), 0.0)
    stepped(simulation, 3.0)
    (event, *rest) = simulation.events + simulation.ended
    assert not rest
    assert event.first.part == 'wall'
    assert event.first.bar in ('link 3', 'link 4')
    speed = np.linalg.norm(event.first.place[:2] - ARM.T_base_mount[:2, 3])
    assert event.first.speed == pytest.approx(speed, rel=0.1)
    assert 0.5 * event.first.speed < event.first.approach <= event.first.speed + 1e-9
    # It ends at a standstill, pressed on by no more than its motor has at that distance.
    strength = 20.0 / speed
    assert 1.0 < event.now.force <= 1.05 * strength
    assert event.greatest_force >= event.now.force
    assert event.now.speed < 1e-3
    assert event.greatest_depth < 0.02
    assert simulation.reading.true_positions[0] < q[0] + 1.0


def test_a_body_that_moves_into_an_arm_that_stands_still_pushes_it_away_at_its_speed():
    q = np.array([0.0, -1.2, np.pi / 2, np.pi / 2])
    tool = tool_pose(ARM, q)[:3, 3]
    sideways = np.cross([0.0, 0.0, 1.0], tool - ARM.T_base_mount[:3, 3])
    velocity = 0.8 * sideways / np.linalg.norm(sideways)
    hand = Box('hand', tool, [0.1, 0.1, 0.3], np.eye(3))
    rate = 30.0
    scenes = scenes_with(hand, tool - 0.4 * velocity, velocity, 31, rate)
    body = body_of_scenes(scenes, rate, np.tile([0.0, 0.0, -1.0], (31, 1)))
    simulation = simulated(ARM, q=q, body=body)
    places = []
    for _ in range(400):
        simulation.step()
        places.append(simulation.data.qpos[4:7].copy())
    event = (simulation.events + simulation.ended)[0]
    assert event.first.part == 'hand'
    assert event.first.speed == pytest.approx(0.8, rel=0.05)
    assert event.first.approach == pytest.approx(0.8, rel=0.1)
    # The hand went as it was recorded, and the arm had to yield.
    expected = tool + (STEP_PERIOD * np.arange(1, 401)[:, None] - 0.4) * velocity
    np.testing.assert_allclose(places, expected, atol=2e-3)
    assert np.abs(simulation.reading.true_positions - q).max() > 0.2
    assert event.greatest_force > 10.0


def test_parts_that_may_meet_do_not_collide():
    q = np.array([0.0, -1.2, np.pi / 2, np.pi / 2])
    pad = Box('pad[1]', tool_pose(ARM, q)[:3, 3], [0.1, 0.1, 0.1], np.eye(3))
    body = standing_body(Scene((pad,)))
    meeting = simulated(ARM, q=q, body=body)
    meeting.step()
    assert meeting.events
    allowed = replace(ARM, allowed=(('link 3', 'pad'), ('link 4', 'pad')))
    free = simulated(allowed, q=q, body=body)
    stepped(free, 0.1)
    assert not free.events


def test_the_same_run_twice_is_the_same():
    runs = []
    for _ in range(2):
        simulation = simulated(ARM, imperfections=Imperfections(encoder_noise=1e-4, seed=2))
        simulation.execute(points_of(swing(FOLDED, 0, 1.0, 1.0)), 0.0)
        runs.append(np.array([r.positions for r in stepped(simulation, 0.5)]))
    assert (runs[0] == runs[1]).all()
