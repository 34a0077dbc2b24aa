# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motions are read from files as they were written, to the bit."""

import csv

import numpy as np
import pytest
from rrth_planner.io.motion_file import JointMotion, motion_of, read_motion, sampled, write_motion
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.errors import RecordError, RrthError
from rrth_planner.model.trajectory import positions_at, Trajectory
import worlds

NUMBERS = ('times', 'positions', 'velocities', 'accelerations')


def random_motion(rng, n, units=('rad', 'm', 'rad')):
    """Return a motion of n points of odd numbers, one of its names in need of quotes."""
    times = np.concatenate([np.zeros(1), np.cumsum(rng.uniform(1e-3, 1.0, n - 1))])
    values = rng.standard_normal((3, n, len(units))) * 10.0 ** rng.integers(-18, 4)
    trajectory = Trajectory(
        times=times, positions=values[0], velocities=values[1], accelerations=values[2]
    )
    names = ('no', 'slide, "left"', 'joint: 3')[: len(units)]
    return JointMotion(joint_names=names, units=units, trajectory=trajectory)


@pytest.mark.parametrize('suffix', ['.yaml', '.csv', '.CSV'])
def test_a_motion_comes_back_to_the_bit(tmp_path, suffix):
    rng = np.random.default_rng(1)
    for n in (1, 2, 3, 50):
        motion, file = random_motion(rng, n), tmp_path / f'motion{suffix}'
        write_motion(motion, file, ['two\nlines: said'])
        found = read_motion(file)
        assert found.joint_names == motion.joint_names
        assert found.units == motion.units
        for name in NUMBERS:
            there, here = (getattr(one.trajectory, name) for one in (found, motion))
            assert there.tobytes() == here.tobytes()


def test_other_programs_can_read_the_files(tmp_path):
    motion = random_motion(np.random.default_rng(2), 4)
    write_motion(motion, tmp_path / 'a.yaml')
    data = load_yaml(tmp_path / 'a.yaml')
    assert data['units'] == ['rad', 'm', 'rad']
    assert data['points'][2]['velocities'] == motion.trajectory.velocities[2].tolist()
    write_motion(motion, tmp_path / 'a.csv')
    with (tmp_path / 'a.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert float(rows[3]['time [s]']) == motion.trajectory.duration
    assert float(rows[1]['slide, "left" velocity [m/s]']) == motion.trajectory.velocities[1, 1]
    named = 'joint: 3 acceleration [rad/s^2]'
    assert float(rows[1][named]) == motion.trajectory.accelerations[1, 2]


def test_samples_are_on_the_curve_and_end_with_it():
    motion = random_motion(np.random.default_rng(3), 5)
    duration = motion.trajectory.duration
    for period in (0.01, duration / 7, 2 * duration):
        found = sampled(motion, period).trajectory
        assert found.times[0] == 0.0
        assert found.times[-1] == duration
        assert np.allclose(np.diff(found.times)[:-1], period, rtol=1e-9)
        assert np.array_equal(found.positions, positions_at(motion.trajectory, found.times))
    for period in (0.0, -1.0, float('nan'), float('inf')):
        with pytest.raises(RecordError, match='period'):
            sampled(motion, period)
    one = random_motion(np.random.default_rng(3), 1)
    assert sampled(one, 0.1).trajectory.times.tolist() == [0.0]


def test_an_arm_names_its_joints_and_units():
    arm = worlds.table_1_arm()
    still = np.zeros((1, 4))
    trajectory = Trajectory(times=[0.0], positions=still, velocities=still, accelerations=still)
    assert motion_of(arm, trajectory).units == ('rad',) * 4
    with pytest.raises(RecordError, match='expected 4 different names'):
        JointMotion(joint_names=('a', 'b'), units=('rad', 'rad'), trajectory=trajectory)
    with pytest.raises(RecordError, match='rad or m'):
        JointMotion(joint_names=arm.joint_names, units=('mm',) * 4, trajectory=trajectory)


BAD = {
    'a.txt': ('', 'ends in .yaml or .csv'),
    'a.yaml': ('joint_names: [a]\n', 'motion: no units, points, expected joint_names'),
    'b.yaml': ('5', 'motion: 5, expected a mapping'),
    'c.yaml': ('{joint_names: [a], units: [rad], points: []}', 'expected'),
    'd.yaml': (
        '{joint_names: [a], units: [rad], points: '
        '[{time: 1, positions: [0], velocities: [0], accelerations: [0]}]}',
        'from 0',
    ),
    'e.yaml': ('a: [', 'readable YAML'),
    'a.csv': ('', 'columns'),
    'b.csv': ('time [s],a position [rad],a acceleration [x],a speed\n0,1,2,3\n', 'columns'),
    'c.csv': (
        'time [s],a position [rad],a velocity [rad/s],a acceleration [rad/s^2]\n0,1,x,3\n',
        'expected numbers',
    ),
    'd.csv': (
        'time [s],a position [rad],a velocity [rad/s],a acceleration [rad/s^2]\n0,1,2\n',
        'expected 4 numbers in each',
    ),
}


@pytest.mark.parametrize('name', BAD)
def test_a_file_that_holds_no_motion_is_rejected(tmp_path, name):
    text, words = BAD[name]
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(RrthError, match=words) as problem:
        read_motion(file)
    assert name in str(problem.value)
    with pytest.raises(RrthError, match='none'):
        read_motion(tmp_path / f'none{file.suffix}')
