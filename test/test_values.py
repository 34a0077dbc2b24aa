# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Values refuse what describes nothing, in one sentence, and cannot be changed."""

from dataclasses import FrozenInstanceError

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.arm import arm_from_mapping
from rrth_planner.arrays import frozen_array
from rrth_planner.errors import ModelError, OptionsError, RrthError, SceneError
from rrth_planner.goal import PointingGoal
from rrth_planner.options import RRTHOptions
from rrth_planner.path import Path
from rrth_planner.problem import PlanningProblem
from rrth_planner.rotation import pose_matrix, quaternion_xyzw, rotation_matrix
from rrth_planner.scene import Box, Scene
from rrth_planner.trajectory import MotionLimits, Trajectory
from rrth_planner.world import arm_world, grown
from worlds import examples, random_rotation, table_1_arm, table_1_mapping, wearer, wearer_world

EYE = np.eye(3)


def refuses(error, make, *words, unit=None):
    """Check that a value is refused in one sentence that names what was given and expected."""
    with pytest.raises(error) as caught:
        make()
    sentence = str(caught.value)
    assert '\n' not in sentence
    assert 'expected' in sentence
    for word in words:
        assert word in sentence, sentence
    if unit is not None:
        assert f'[{unit}]' in sentence, sentence


def changed(*path, value):
    """Return the paper's arm as a mapping with one entry changed."""
    data = table_1_mapping()
    at = data
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return data


@pytest.mark.parametrize(
    ('path', 'value', 'words'),
    [
        (('joints',), [], ['joint_names']),
        (('joints',), 5, []),
        (('joints', 0), 'joint_1', []),
        (('joints', 1, 'name'), 'joint_1', ['joint_1']),
        (('joints', 1, 'type'), 'spherical', ['joint_2', 'spherical', 'revolute or prismatic']),
        (('joints', 1, 'alpha'), float('nan'), ['dh', 'nan']),
        (('joints', 1, 'd'), float('inf'), ['dh', 'inf']),
        (('joints', 1, 'a'), 'long', []),
        (('joints', 1, 'lower'), 0.5, ['bounds', '0.5', 'lower < upper']),
        (('joints', 1, 'upper'), -np.pi, ['bounds']),
        (('joints', 1, 'radius'), -0.01, ['radii', '-0.01', '[m]']),
        (('tool', 'radius'), -0.01, ['radii']),
        (('tool',), None, []),
        (('mount', 'position'), [1.0, 2.0], ['mount position', '(2,)', '[m]']),
        (('mount', 'position'), [1.0, 2.0, float('nan')], ['mount position', 'nan']),
        (('mount', 'quaternion_xyzw'), [0.0] * 4, ['quaternion', 'zero']),
        (('mount', 'quaternion_xyzw'), [1.0] * 3, ['quaternion', '(3,)']),
        (('mount', 'quaternion_xyzw'), [float('inf')] * 4, ['quaternion']),
        (('mount',), 'shoulder', []),
        (('tool', 'd'), 0.2, ['0.2', 'tool']),
    ],
)
def test_a_bad_arm_is_refused(path, value, words):
    refuses(ModelError, lambda: arm_from_mapping(changed(*path, value=value)), *words)


@pytest.mark.parametrize('key', ['joints', 'tool', 'mount'])
def test_an_arm_without_a_part_is_refused(key):
    data = table_1_mapping()
    del data[key]
    refuses(ModelError, lambda: arm_from_mapping(data), key)


@pytest.mark.parametrize('key', ['name', 'type', 'alpha', 'a', 'offset', 'd', 'lower', 'upper'])
def test_a_joint_without_a_number_is_refused(key):
    data = table_1_mapping()
    del data['joints'][2][key]
    refuses(ModelError, lambda: arm_from_mapping(data), key)


@pytest.mark.parametrize('data', [None, [], 'arm', 5])
def test_what_is_no_mapping_is_no_arm(data):
    refuses(ModelError, lambda: arm_from_mapping(data))


def test_an_arm_whose_mount_is_no_pose_is_refused():
    arm = table_1_arm()

    def with_mount(T):
        return type(arm)(
            joint_names=arm.joint_names,
            is_prismatic=arm.is_prismatic,
            dh=arm.dh,
            bounds=arm.bounds,
            radii=arm.radii,
            T_base_mount=T,
        )

    mirrored = np.diag([1.0, 1.0, -1.0, 1.0])
    refuses(ModelError, lambda: with_mount(mirrored), 'mount')
    refuses(ModelError, lambda: with_mount(2.0 * np.eye(4)), 'mount')
    sheared = np.eye(4)
    sheared[3, 0] = 0.5
    refuses(ModelError, lambda: with_mount(sheared), 'mount')


def test_a_bad_box_is_refused():
    def box(center=(0, 0, 0), size=(1, 1, 1), rotation=EYE):
        return lambda: Box('torso', center, size, rotation)

    for size in ((1, 1, 0), (1, -1, 1), (np.nan, 1, 1), (np.inf, 1, 1), (1, 1), 1.0, None, 'big'):
        refuses(SceneError, box(size=size), 'box "torso"', 'size', unit='m')
    for center in ((0, 0), (np.nan, 0, 0), (np.inf, 0, 0), (0, 0, 1e5)):
        refuses(SceneError, box(center=center), 'box "torso"', 'center', unit='m')
    skew = np.eye(3)
    skew[0, 1] = 1e-3
    for rotation in (
        np.diag([1, 1, -1]),
        2 * EYE,
        skew,
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
    ):
        refuses(SceneError, box(rotation=rotation), 'box "torso"', 'rotation', unit='-')


def test_a_bad_target_is_refused():
    for target in ((0, 0), (np.nan, 0, 0), (np.inf, 0, 0), (0, 0, 1e5), None, 'there'):
        refuses(SceneError, lambda target=target: PointingGoal(target), 'target', unit='m')


def test_bad_limits_are_refused():
    good = {'velocity': [1.0, 1.0], 'acceleration': [1.0, 1.0], 'jerk': [1.0, 1.0]}
    units = {'velocity': 'rad/s', 'acceleration': 'rad/s^2', 'jerk': 'rad/s^3'}
    for name, unit in units.items():
        for bad in ([0.0, 1.0], [-1.0, 1.0], [np.nan, 1.0], [np.inf, 1.0]):
            data = {**good, name: bad}
            refuses(OptionsError, lambda data=data: MotionLimits(**data), name, unit=unit)
    for name in ('acceleration', 'jerk'):
        data = {**good, name: [1.0]}
        refuses(OptionsError, lambda data=data: MotionLimits(**data), name, unit=units[name])


@pytest.mark.parametrize('name', list(RRTHOptions.__dataclass_fields__))
def test_bad_options_are_refused(name):
    meta = RRTHOptions.__dataclass_fields__[name].metadata
    RRTHOptions(**{name: meta['low']})
    RRTHOptions(**{name: meta['high']})
    for bad in (meta['low'] - 1, meta['high'] * 1.01 + 1, float('nan'), float('inf'), -1e9):
        refuses(OptionsError, lambda bad=bad: RRTHOptions(**{name: bad}), name, unit=meta['unit'])


@pytest.mark.parametrize('name', ['max_samples', 'club_attempts', 'club_count', 'club_budget'])
def test_counts_that_are_no_whole_numbers_are_refused(name):
    refuses(OptionsError, lambda: RRTHOptions(**{name: 2.5}), name)


@pytest.mark.parametrize('bad', ['1.5', None, [1.0]])
def test_options_that_are_no_numbers_are_refused(bad):
    refuses(OptionsError, lambda: RRTHOptions(step_size=bad), 'step_size')


def test_a_bad_trajectory_is_refused():
    def motion(times=(0.0, 1.0), **parts):
        still = {name: np.zeros((2, 3)) for name in ('positions', 'velocities', 'accelerations')}
        return lambda: Trajectory(times=times, **{**still, **parts})

    motion()()
    for times in ([], [0.1, 1.0], [0.0, 0.0], [0.0, -1.0], [0.0, np.nan], [0.0, np.inf], 0.0):
        refuses(RrthError, motion(times), 'times', unit='s')
    refuses(RrthError, motion([0.0, 1.0, 2.0]), 'positions', '(2, 3)', '(3, ', unit='rad')
    for name, unit in (
        ('positions', 'rad'),
        ('velocities', 'rad/s'),
        ('accelerations', 'rad/s^2'),
    ):
        refuses(RrthError, motion(**{name: np.full((2, 3), np.nan)}), name, unit=unit)
        refuses(RrthError, motion(**{name: np.zeros((1, 3))}), name, unit=unit)
    refuses(RrthError, motion(positions=1.0), 'positions', unit='rad')


def test_a_bad_path_is_refused():
    for bad in (np.empty((0, 4)), [1.0, 2.0], np.full((2, 2), np.inf), 5.0, [[1.0], [1.0, 2.0]]):
        refuses(RrthError, lambda bad=bad: Path(bad), 'waypoints', unit='rad')


def test_a_bad_problem_is_refused():
    world = wearer_world()
    q = np.zeros(4)
    refuses(RrthError, lambda: PlanningProblem(world=world, q_start=q[:3], q_goals=[q]), 'q_start')
    refuses(RrthError, lambda: PlanningProblem(world=world, q_start=q, q_goals=[q[:3]]), 'q_goals')
    refuses(
        RrthError,
        lambda: PlanningProblem(world=world, q_start=q, q_goals=[np.full(4, np.nan)]),
        'q_goals',
    )
    for bad in (np.zeros(2), np.full(3, np.inf)):
        refuses(
            RrthError,
            lambda bad=bad: PlanningProblem(world=world, q_start=q, q_goals=[q], target=bad),
            'target',
            unit='m',
        )


def test_bad_margins_are_refused():
    arm = table_1_arm()
    for bad in (-0.01, np.nan, np.inf):
        refuses(OptionsError, lambda bad=bad: arm_world(arm, wearer(), bad, 1.0), 'margin')
        refuses(OptionsError, lambda bad=bad: arm_world(arm, wearer(), 0.0, bad), 'ray_guard')
    refuses(SceneError, lambda: grown(wearer_world(), -1.0), 'growth')


def test_a_frozen_array_is_a_finite_read_only_copy():
    given_array = np.arange(6.0).reshape(2, 3)
    frozen = frozen_array(given_array.T, (3, None), 'x', 'm', RrthError)
    assert frozen.flags.c_contiguous
    given_array[0, 0] = 9.0
    assert frozen[0, 0] == 0.0
    with pytest.raises(ValueError, match='read-only'):
        frozen[0, 0] = 1.0
    assert frozen_array([1, 2], (2,), 'x', 'm', RrthError).dtype == np.float64
    for bad, shape in (([1.0], (2,)), ([[1.0]], (1,)), ([np.nan], (1,)), (['a'], (1,))):
        refuses(
            RrthError,
            lambda bad=bad, shape=shape: frozen_array(bad, shape, 'x', 'm', RrthError),
            'x:',
            unit='m',
        )


def test_numbers_whose_sum_overflows_are_finite_without_a_warning(recwarn):
    assert frozen_array([1e308, 1e308], (2,), 'x', 'm', RrthError).tolist() == [1e308, 1e308]
    assert not recwarn.list


def test_every_array_of_every_value_is_read_only():
    still = np.zeros((2, 3))
    values = [
        table_1_arm(),
        wearer().boxes[0],
        PointingGoal([1, 2, 3]),
        MotionLimits(velocity=[1.0], acceleration=[1.0], jerk=[1.0]),
        Path(still),
        Trajectory(times=[0, 1], positions=still, velocities=still, accelerations=still),
        PlanningProblem(world=wearer_world(), q_start=np.zeros(4), q_goals=np.zeros((1, 4))),
    ]
    for value in values:
        n_arrays = 0
        for name in type(value).__dataclass_fields__:
            part = getattr(value, name)
            if isinstance(part, np.ndarray):
                n_arrays += 1
                assert not part.flags.writeable, name
            with pytest.raises(FrozenInstanceError):
                setattr(value, name, part)
        assert n_arrays > 0
    assert isinstance(Scene(list(wearer().boxes)).boxes, tuple)


def test_the_paper_arm_is_the_one_in_the_package():
    resources = pytest.importorskip('rrth_planner.resources', exc_type=ImportError)
    packaged, own = resources.load_arm(), table_1_arm()
    assert packaged.joint_names == own.joint_names
    for name in ('dh', 'bounds', 'radii', 'T_base_mount'):
        assert np.array_equal(getattr(packaged, name), getattr(own, name)), name


@pytest.mark.parametrize('before', ['', '\ufeff', '\n <!-- an arm: -->\n'])
def test_a_urdf_is_no_arm_file_and_is_sent_to_read_urdf(tmp_path, before):
    resources = pytest.importorskip('rrth_planner.resources', exc_type=ImportError)
    file = tmp_path / 'arm.yaml'
    file.write_text(f'{before}<robot name="a"><link name="b"/></robot>', encoding='utf-8')
    words = (f'file {file}: XML, as a URDF is', 'read_urdf writes one')
    refuses(ModelError, lambda: resources.load_arm(file), *words)


@examples(300)
@given(parts=st.tuples(*[st.floats(-1.0, 1.0)] * 4))
def test_a_quaternion_comes_back_from_its_rotation(parts):
    q = np.array(parts)
    if np.linalg.norm(q) < 1e-3:
        return
    R = rotation_matrix(q)
    assert np.abs(R @ R.T - EYE).max() < 1e-12
    assert np.linalg.det(R) == pytest.approx(1.0)
    back = quaternion_xyzw(R)
    unit = q / np.linalg.norm(q)
    assert back[3] >= 0.0
    assert min(np.abs(back - unit).max(), np.abs(back + unit).max()) < 1e-9
    assert np.abs(rotation_matrix(back) - R).max() < 1e-12


@examples(100)
@given(seed=st.integers(0, 2**32 - 1), angle=st.floats(-3.1, 3.1))
def test_a_rotation_turns_about_its_axis_and_a_pose_moves(seed, angle):
    rng = np.random.default_rng(seed)
    axis = random_rotation(rng)[:, 0]
    q = np.append(np.sin(0.5 * angle) * axis, np.cos(0.5 * angle))
    R, v = rotation_matrix(3.0 * q), rng.standard_normal(3)
    # Rodrigues' formula.
    expected = (
        np.cos(angle) * v
        + np.sin(angle) * np.cross(axis, v)
        + (1 - np.cos(angle)) * (axis @ v) * axis
    )
    assert np.abs(R @ v - expected).max() < 1e-12
    T = pose_matrix([1.0, 2.0, 3.0], q)
    assert np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0])
    assert np.abs(T @ np.append(v, 1.0) - np.append(expected + [1, 2, 3], 1.0)).max() < 1e-12


def test_every_error_is_one_of_ours():
    for error in (ModelError, OptionsError, SceneError):
        assert issubclass(error, RrthError)
