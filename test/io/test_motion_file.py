# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Motions are in files to the bit, as other programs read them."""

import csv

import numpy as np
import pytest
from rrth_planner.io.motion_file import sampled, write_motion
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import RecordError
from rrth_planner.model.trajectory import positions_at, Trajectory
import worlds

SERIES = ('positions', 'velocities', 'accelerations')
# One of the names is in need of quotes.
ARM = ArmModel(
    joint_names=('no', 'slide, "left"', 'joint: 3'),
    is_prismatic=(False, True, False),
    dh=np.zeros((4, 4)),
    bounds=np.array([[-1.0] * 3, [1.0] * 3]),
    radii=np.zeros(4),
    T_base_mount=np.eye(4),
)


def random_motion(rng, n):
    """Return a motion of n points of odd numbers."""
    times = np.concatenate([np.zeros(1), np.cumsum(rng.uniform(1e-3, 1.0, n - 1))])
    values = rng.standard_normal((3, n, ARM.dof)) * 10.0 ** rng.integers(-18, 4)
    return Trajectory(
        times=times, positions=values[0], velocities=values[1], accelerations=values[2]
    )


@pytest.mark.parametrize('n', [1, 2, 3, 50])
def test_a_motion_is_in_a_file_to_the_bit(tmp_path, n):
    motion = random_motion(np.random.default_rng(n), n)
    for suffix in ('.yaml', '.yml'):
        file = tmp_path / f'motion{suffix}'
        write_motion(ARM, motion, file, ['two\nlines: said'])
        assert file.read_text().startswith('# two lines: said\n')
        data = load_yaml(file)
        assert data['joint_names'] == list(ARM.joint_names)
        assert data['units'] == ['rad', 'm', 'rad']
        assert [point['time'] for point in data['points']] == motion.times.tolist()
        for name in SERIES:
            assert [point[name] for point in data['points']] == getattr(motion, name).tolist()
    for suffix in ('.csv', '.CSV'):
        file = tmp_path / f'motion{suffix}'
        write_motion(ARM, motion, file, ['not said'])
        with file.open(newline='') as lines:
            header, *rows = csv.reader(lines)
        assert header[:4] == [
            *('time [s]', 'no position [rad]', 'no velocity [rad/s]'),
            'no acceleration [rad/s^2]',
        ]
        numbers = np.array(rows, dtype=np.float64)
        assert numbers[:, 0].tobytes() == motion.times.tobytes()
        for k, name in enumerate(SERIES):
            assert np.array_equal(numbers[:, 1 + k :: 3], getattr(motion, name))


def test_the_name_of_a_file_says_its_kind(tmp_path):
    motion = random_motion(np.random.default_rng(1), 2)
    with pytest.raises(RecordError, match=r'a\.txt: expected a name that ends in .yaml or .csv'):
        write_motion(ARM, motion, tmp_path / 'a.txt')
    assert not (tmp_path / 'a.txt').exists()


def test_other_programs_can_read_the_files(tmp_path):
    motion = random_motion(np.random.default_rng(2), 4)
    write_motion(ARM, motion, tmp_path / 'a.yaml')
    data = load_yaml(tmp_path / 'a.yaml')
    assert data['units'] == ['rad', 'm', 'rad']
    assert data['points'][2]['velocities'] == motion.velocities[2].tolist()
    write_motion(ARM, motion, tmp_path / 'a.csv')
    with (tmp_path / 'a.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert float(rows[3]['time [s]']) == motion.duration
    assert float(rows[1]['slide, "left" velocity [m/s]']) == motion.velocities[1, 1]
    named = 'joint: 3 acceleration [rad/s^2]'
    assert float(rows[1][named]) == motion.accelerations[1, 2]


def test_samples_are_on_the_curve_and_end_with_it():
    motion = random_motion(np.random.default_rng(3), 5)
    duration = motion.duration
    for period in (0.01, duration / 7, 2 * duration):
        found = sampled(motion, period)
        assert found.times[0] == 0.0
        assert found.times[-1] == duration
        assert np.allclose(np.diff(found.times)[:-1], period, rtol=1e-9)
        assert np.array_equal(found.positions, positions_at(motion, found.times))
    for period in (0.0, -1.0, float('nan'), float('inf')):
        with pytest.raises(RecordError, match='period'):
            sampled(motion, period)
    one = random_motion(np.random.default_rng(3), 1)
    assert sampled(one, 0.1).times.tolist() == [0.0]


def test_an_arm_of_the_package_turns_about_all_joints(tmp_path):
    arm, still = worlds.table_1_arm(), np.zeros((1, 4))
    write_motion(arm, Trajectory([0.0], still, still, still), tmp_path / 'still.yaml')
    assert load_yaml(tmp_path / 'still.yaml')['units'] == ['rad'] * 4
