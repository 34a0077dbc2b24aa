# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Values reject what describes nothing, in one sentence, and cannot be changed."""

from dataclasses import FrozenInstanceError
import pickle
import warnings

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.collision.certificate import certify, least_clearance
from rrth_planner.collision.world import arm_world, grown
from rrth_planner.io.arm_file import arm_from_mapping
from rrth_planner.kernels.collision import arm_validity
from rrth_planner.model.arm import ArmModel, forward_kinematics
from rrth_planner.model.arrays import FARTHEST, frozen_array
from rrth_planner.model.errors import ModelError, OptionsError, RrthError, SceneError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.path import Path
from rrth_planner.model.rotation import (
    pose_matrix,
    quaternion_xyzw,
    rotation_matrices,
    rotation_matrix,
)
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.planning.options import RRTHOptions
from rrth_planner.planning.pointing_goals import FEW_DRAWS, goal_configurations
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.timing.corner_blends import round_corners
from worlds import (
    examples,
    FOLDED,
    limits,
    random_rotation,
    table_1_arm,
    table_1_mapping,
    wearer,
    wearer_world,
)

EYE = np.eye(3)


def rejects(error, make, *words, unit=None):
    """Check that a value is rejected in one sentence that names what was given and expected."""
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
        (('joints', 1, 'alpha'), float('nan'), ['joint_2', 'alpha', 'nan', '[rad]']),
        (('joints', 1, 'd'), float('inf'), ['joint_2', 'd', 'inf', '[m]']),
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
def test_a_bad_arm_is_rejected(path, value, words):
    rejects(ModelError, lambda: arm_from_mapping(changed(*path, value=value)), *words)


@pytest.mark.parametrize(
    ('path', 'value', 'words'),
    [
        (('joints', 1, 'alpha'), 1.1e4, ['dh', '11000', 'at most 10000', '[rad and m]']),
        (('joints', 1, 'offset'), -1e300, ['dh', 'at most 10000']),
        (('joints', 1, 'a'), -1.1e4, ['dh', '-11000', 'at most 10000']),
        (('joints', 1, 'd'), 1e308, ['dh', 'at most 10000']),
        (('joints', 1, 'lower'), -1.1e4, ['bounds', 'at most 10000', '[rad or m]']),
        (('joints', 1, 'upper'), 1e300, ['bounds', 'at most 10000']),
        (('joints', 1, 'radius'), 1e5, ['radii', 'at most 10000', '[m]']),
        (('mount', 'position'), [0.0, 0.0, 1e5], ['T_base_mount', 'at most 10000']),
        (('mount', 'quaternion_xyzw'), [0.0, 0.0, 0.0, 1e200], ['quaternion', 'at most 10000']),
        (('mount', 'position'), [0.0, 0.0, 9999.7], ['arm: 10000.2', 'at most 10000 [m]']),
        (('joints', 2, 'a'), 9999.5, ['arm: 10000.5', 'at most 10000 [m]']),
        (('joints', 2, 'radius'), 9999.5, ['arm: 10000.5', 'at most 10000 [m]']),
    ],
)
def test_an_arm_of_which_rounding_cannot_be_bounded_is_rejected(path, value, words):
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        rejects(ModelError, lambda: arm_from_mapping(changed(*path, value=value)), *words)


@examples(200)
@given(st.data())
def test_no_point_of_an_arm_is_farther_than_proofs_allow_for(data):
    length = st.floats(-4e3, 4e3)
    dof = data.draw(st.integers(1, 4))
    angles = data.draw(st.lists(st.floats(-9.0, 9.0), min_size=2 * dof, max_size=2 * dof))
    lengths = data.draw(st.lists(length, min_size=2 * dof + 3, max_size=2 * dof + 3))
    slides = data.draw(st.lists(st.booleans(), min_size=dof, max_size=dof))
    ends = data.draw(st.lists(st.floats(0.1, 4e3), min_size=dof, max_size=dof))
    mount = np.eye(4)
    mount[:3, 3] = lengths[:3]
    dh = np.zeros((dof + 1, 4))
    dh[:-1, [0, 2]], dh[:-1, [1, 3]] = (
        np.reshape(angles, (-1, 2)),
        np.reshape(lengths[3:], (-1, 2)),
    )
    try:
        arm = ArmModel(
            joint_names=tuple('abcd'[:dof]),
            is_prismatic=tuple(slides),
            dh=dh,
            bounds=np.array([np.negative(ends), ends]),
            radii=np.zeros(dof + 1),
            T_base_mount=mount,
        )
    except ModelError as problem:
        assert 'expected at most 10000 [m]' in str(problem)
        return
    share = data.draw(st.lists(st.floats(-1.0, 1.0), min_size=dof, max_size=dof))
    poses = forward_kinematics(arm, np.multiply(share, ends))
    assert np.abs(poses[:, :3, 3]).max() <= FARTHEST * (1.0 + 1e-9)


def test_what_is_rejected_is_what_the_proofs_do_not_cover():
    assert arm_validity.LARGEST == FARTHEST


@pytest.mark.parametrize('value', [1.1e4, 1e103, 1e300, -0.1, float('nan')])
def test_a_margin_or_ray_that_no_box_has_room_for_is_rejected(value):
    # Round many boxes a margin beyond 1e102 would overflow, and its boxes be passed over.
    for margin, ray in ((value, 1.0), (0.02, value)):
        rejects(
            OptionsError,
            lambda m=margin, r=ray: arm_world(table_1_arm(), wearer(), m, r),
            unit='m',
        )


@pytest.mark.parametrize(
    'name', ['', 'a\nb', '\x1b[2J', '\x9b1m', '\u202e', 'x' * 257, None, 7, True]
)
def test_names_are_texts_that_may_be_printed(name):
    rejects(SceneError, lambda: Box(name, [0, 0, 0], [1, 1, 1], EYE), 'name of a box')
    path = ('joints', 1, 'name')
    rejects(ModelError, lambda: arm_from_mapping(changed(*path, value=name)), 'joint 1: name')
    assert Box('Ω 🦾', [0, 0, 0], [1, 1, 1], EYE).name == 'Ω 🦾'


@pytest.mark.parametrize(
    'value',
    [[True, 1, 1], [1, 1, '1'], ['1', '1', '1'], True, [None] * 3, [10**400] * 3, [[1]] * 3],
)
def test_what_only_looks_like_numbers_is_none(value):
    rejects(RrthError, lambda: frozen_array(value, (3,), 'x', 'm', RrthError), 'x: ', unit='m')
    rejects(SceneError, lambda: Box('a', value, [1, 1, 1], EYE), 'center', unit='m')


@pytest.mark.parametrize(
    'value', [np.ones(3, bool), np.array(['1', '1', '1']), [np.True_, 1.0, 1.0]]
)
def test_arrays_of_other_types_are_no_numbers(value):
    rejects(RrthError, lambda: frozen_array(value, (3,), 'x', 'm', RrthError), 'x: ', unit='m')
    for same in (np.ones(3, np.float32), np.ones(3, np.uint8), [np.float32(1), np.int64(1), 1]):
        assert frozen_array(same, (3,), 'x', 'm', RrthError).tolist() == [1.0, 1.0, 1.0]


def test_an_option_that_is_true_is_no_number_and_one_that_is_1_not_true():
    for name in ('step_size', 'goal_bias', 'max_samples', 'club_count', 'time_limit'):
        rejects(OptionsError, lambda name=name: RRTHOptions(**{name: True}), name)
    for value in (0, 1, 0.5, 'true', None):
        rejects(OptionsError, lambda value=value: RRTHOptions(is_bidirectional=value), 'true or')


def test_a_trajectory_beyond_what_is_proven_is_rejected():
    still = {'times': [0.0], 'velocities': np.zeros((1, 2)), 'accelerations': np.zeros((1, 2))}
    Trajectory(positions=[[FARTHEST, -FARTHEST]], **still)
    for q in ([[0.0, 1.1e4]], np.array([[0.0, 1.1e4]]), np.array([[-1e300, 0.0]])):
        rejects(RrthError, lambda q=q: Trajectory(positions=q, **still), 'positions', unit='rad')
    for q in ([[True, 0.0]], [['1', 0.0]], np.array([['1', '0']])):
        rejects(RrthError, lambda q=q: Trajectory(positions=q, **still), 'positions', unit='rad')


@pytest.mark.parametrize('key', ['joints', 'tool', 'mount'])
def test_an_arm_without_a_part_is_rejected(key):
    data = table_1_mapping()
    del data[key]
    rejects(ModelError, lambda: arm_from_mapping(data), key)


@pytest.mark.parametrize('key', ['name', 'type', 'alpha', 'a', 'offset', 'd', 'lower', 'upper'])
def test_a_joint_without_a_number_is_rejected(key):
    data = table_1_mapping()
    del data['joints'][2][key]
    rejects(ModelError, lambda: arm_from_mapping(data), key)


@pytest.mark.parametrize('data', [None, [], 'arm', 5])
def test_what_is_no_mapping_is_no_arm(data):
    rejects(ModelError, lambda: arm_from_mapping(data))


def test_an_arm_whose_mount_is_no_pose_is_rejected():
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
    rejects(ModelError, lambda: with_mount(mirrored), 'mount')
    rejects(ModelError, lambda: with_mount(2.0 * np.eye(4)), 'mount')
    sheared = np.eye(4)
    sheared[3, 0] = 0.5
    rejects(ModelError, lambda: with_mount(sheared), 'mount')


def test_a_bad_box_is_rejected():
    def box(center=(0, 0, 0), size=(1, 1, 1), rotation=EYE):
        return lambda: Box('torso', center, size, rotation)

    for size in ((1, 1, 0), (1, -1, 1), (np.nan, 1, 1), (np.inf, 1, 1), (1, 1), 1.0, None, 'big'):
        rejects(SceneError, box(size=size), 'box "torso"', 'size', unit='m')
    for center in ((0, 0), (np.nan, 0, 0), (np.inf, 0, 0), (0, 0, 1e5)):
        rejects(SceneError, box(center=center), 'box "torso"', 'center', unit='m')
    skew = np.eye(3)
    skew[0, 1] = 1e-3
    for rotation in (
        np.diag([1, 1, -1]),
        2 * EYE,
        skew,
        np.zeros((3, 3)),
        np.full((3, 3), np.nan),
    ):
        rejects(SceneError, box(rotation=rotation), 'box "torso"', 'rotation', unit='-')


def test_a_bad_target_is_rejected():
    for target in ((0, 0), (np.nan, 0, 0), (np.inf, 0, 0), (0, 0, 1e5), None, 'there'):
        rejects(SceneError, lambda target=target: PointingGoal(target), 'target', unit='m')


def test_bad_limits_are_rejected():
    good = {'velocity': [1.0, 1.0], 'acceleration': [1.0, 1.0], 'jerk': [1.0, 1.0]}
    units = {'velocity': 'rad/s', 'acceleration': 'rad/s^2', 'jerk': 'rad/s^3'}
    for name, unit in units.items():
        for bad in ([0.0, 1.0], [-1.0, 1.0], [np.nan, 1.0], [np.inf, 1.0]):
            data = {**good, name: bad}
            rejects(OptionsError, lambda data=data: MotionLimits(**data), name, unit=unit)
    for name in ('acceleration', 'jerk'):
        data = {**good, name: [1.0]}
        rejects(OptionsError, lambda data=data: MotionLimits(**data), name, unit=units[name])


@pytest.mark.parametrize('name', list(RRTHOptions.__dataclass_fields__))
def test_bad_options_are_rejected(name):
    meta = RRTHOptions.__dataclass_fields__[name].metadata
    kind = bool if name == 'is_bidirectional' else lambda value: value
    RRTHOptions(**{name: kind(meta['low'])})
    RRTHOptions(**{name: kind(meta['high'])})
    for bad in (meta['low'] - 1, meta['high'] * 1.01 + 1, float('nan'), float('inf'), -1e9):
        rejects(OptionsError, lambda bad=bad: RRTHOptions(**{name: bad}), name, unit=meta['unit'])


@pytest.mark.parametrize('name', ['max_samples', 'club_attempts', 'club_count', 'club_budget'])
def test_counts_that_are_no_whole_numbers_are_rejected(name):
    rejects(OptionsError, lambda: RRTHOptions(**{name: 2.5}), name)


@pytest.mark.parametrize('bad', ['1.5', None, [1.0]])
def test_options_that_are_no_numbers_are_rejected(bad):
    rejects(OptionsError, lambda: RRTHOptions(step_size=bad), 'step_size')


def test_a_bad_trajectory_is_rejected():
    def motion(times=(0.0, 1.0), **parts):
        still = {name: np.zeros((2, 3)) for name in ('positions', 'velocities', 'accelerations')}
        return lambda: Trajectory(times=times, **{**still, **parts})

    motion()()
    for times in ([], [0.1, 1.0], [0.0, 0.0], [0.0, -1.0], [0.0, np.nan], [0.0, np.inf], 0.0):
        rejects(RrthError, motion(times), 'times', unit='s')
    rejects(RrthError, motion([0.0, 1.0, 2.0]), 'positions', '(2, 3)', '(3, ', unit='rad')
    for name, unit in (
        ('positions', 'rad'),
        ('velocities', 'rad/s'),
        ('accelerations', 'rad/s^2'),
    ):
        rejects(RrthError, motion(**{name: np.full((2, 3), np.nan)}), name, unit=unit)
        rejects(RrthError, motion(**{name: np.zeros((1, 3))}), name, unit=unit)
    rejects(RrthError, motion(positions=1.0), 'positions', unit='rad')


def test_a_bad_path_is_rejected():
    for bad in (np.empty((0, 4)), [1.0, 2.0], np.full((2, 2), np.inf), 5.0, [[1.0], [1.0, 2.0]]):
        rejects(RrthError, lambda bad=bad: Path(bad), 'waypoints', unit='rad')


def test_a_bad_problem_is_rejected():
    world = wearer_world()
    q = np.zeros(4)
    rejects(RrthError, lambda: PlanningProblem(world=world, q_start=q[:3], q_goals=[q]), 'q_start')
    rejects(RrthError, lambda: PlanningProblem(world=world, q_start=q, q_goals=[q[:3]]), 'q_goals')
    rejects(
        RrthError,
        lambda: PlanningProblem(world=world, q_start=q, q_goals=[np.full(4, np.nan)]),
        'q_goals',
    )
    for bad in (np.zeros(2), np.full(3, np.inf)):
        rejects(
            RrthError,
            lambda bad=bad: PlanningProblem(world=world, q_start=q, q_goals=[q], target=bad),
            'target',
            unit='m',
        )


def test_bad_margins_are_rejected():
    arm = table_1_arm()
    for bad in (-0.01, np.nan, np.inf):
        rejects(OptionsError, lambda bad=bad: arm_world(arm, wearer(), bad, 1.0), 'margin')
        rejects(OptionsError, lambda bad=bad: arm_world(arm, wearer(), 0.0, bad), 'ray_guard')
    rejects(SceneError, lambda: grown(wearer_world(), -1.0), 'growth')


@pytest.mark.parametrize('n', [1, 3, 5])
def test_values_of_another_number_of_joints_do_not_reach_a_kernel(n):
    world, q, zeros = wearer_world(), np.zeros(n), np.zeros((2, n))
    still = Trajectory(times=[0.0, 1.0], positions=zeros, velocities=zeros, accelerations=zeros)
    joints = [{**table_1_mapping()['joints'][1], 'name': f'joint_{i}'} for i in range(n)]
    other = arm_from_mapping(changed('joints', value=joints))
    goal = PointingGoal([1.0, 1.0, 1.0])
    for ask in (
        lambda: world.is_valid(q),
        lambda: world.is_edge_valid(FOLDED, q),
        lambda: world.is_edge_valid(q, FOLDED),
        lambda: world.clearances(q),
        lambda: certify(still, world),
        lambda: least_clearance(still, world),
        lambda: round_corners(Path([q, q, q]), world, limits()),
        lambda: goal_configurations(table_1_arm(), goal, world, q, FEW_DRAWS),
        lambda: goal_configurations(other, goal, world, q, FEW_DRAWS),
        lambda: goal_configurations(other, goal, world, FOLDED, FEW_DRAWS),
    ):
        rejects(RrthError, ask, 'shape')


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
        rejects(
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


@pytest.mark.parametrize('scene', [wearer(), Scene(())])
def test_a_scene_is_sent_to_another_process_as_it_is(scene):
    sent = pickle.loads(pickle.dumps(scene))
    assert [box.name for box in sent.boxes] == [box.name for box in scene.boxes]
    assert sent.numbers.tobytes() == scene.numbers.tobytes()
    for one, other in zip(sent.boxes, scene.boxes, strict=True):
        for name in ('center', 'size', 'rotation', 'numbers'):
            values = getattr(one, name)
            np.testing.assert_array_equal(values, getattr(other, name))
            assert not values.flags.writeable
            assert values.flags.aligned
            with pytest.raises(ValueError, match='read-only|WRITEABLE'):
                values.setflags(write=True)
                values[...] = 0.0


def test_the_paper_arm_is_the_one_in_the_package():
    arm_file = pytest.importorskip('rrth_planner.io.arm_file', exc_type=ImportError)
    packaged, own = arm_file.load_arm(), table_1_arm()
    assert packaged.joint_names == own.joint_names
    for name in ('dh', 'bounds', 'radii', 'T_base_mount'):
        assert np.array_equal(getattr(packaged, name), getattr(own, name)), name


@pytest.mark.parametrize('before', ['', '\ufeff', '\n <!-- an arm: -->\n'])
def test_a_urdf_is_no_arm_file_and_is_sent_to_read_urdf(tmp_path, before):
    arm_file = pytest.importorskip('rrth_planner.io.arm_file', exc_type=ImportError)
    file = tmp_path / 'arm.yaml'
    file.write_text(f'{before}<robot name="a"><link name="b"/></robot>', encoding='utf-8')
    words = (f'file {file}: XML, as a URDF is', 'read_urdf writes one')
    rejects(ModelError, lambda: arm_file.load_arm(file), *words)


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
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(0, 5))
def test_many_rotations_and_quaternions_are_those_of_each(seed, n):
    quaternions = np.random.default_rng(seed).standard_normal((n, 4))
    many = rotation_matrices(quaternions)
    each = [rotation_matrix(q) for q in quaternions]
    np.testing.assert_allclose(many, np.reshape(each, (n, 3, 3)), rtol=0, atol=1e-14)
    back = [quaternion_xyzw(R) for R in many]
    np.testing.assert_allclose(quaternion_xyzw(many), np.reshape(back, (n, 4)), atol=1e-14)


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
