# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Public functions take what numpy takes, with the same answer; or say in one sentence why not."""

from dataclasses import replace
from functools import partial
import inspect
import warnings

import numpy as np
import pytest
import rrth_planner as rrth
from rrth_planner.model.arm import Capsule, pointing_error
from same_values import differences
from worlds import FOLDED, limits, table_1_arm, table_1_mapping, wearer, wearer_world

# Their numbers are the same in all of the types below.
Q, WHOLE = np.array([0.0, -0.25, 1.5, 1.5]), np.array([0.0, 0.0, 1.0, 1.0])
Q0, FOLDED_16 = np.array([1.0, 2.0, 1.5, 1.0]), FOLDED.astype(np.float16).astype(float)
# What is as good as an array of its length, and what is made by the planner only.
ALSO_TAKEN = {
    'World.first_free shares': ('another length', 'nothing'),
    'sample times': ('another length', 'nothing', 'a number'),
    'Path waypoints': ('another length',),
    'BoxMap bounds': ('another length',),
    'BoxMap obstacles': ('nothing',),
    'arm_from_mapping T_base_link': ('None',),
    'load_arm T_base_link': ('None',),
}
ANSWERS = ('PlanResult', 'MotionPlan')
ARM, LIMITS, GOAL = table_1_arm(0.02), limits(), rrth.PointingGoal([1.5, 0.1, 0.3])
MAP = rrth.BoxMap(
    name='gate',
    bounds=[[0] * 4, [9] * 4],
    obstacles=[[[4] * 4, [5] * 4]],
    start=[1] * 4,
    goal=[8] * 4,
)
OPTIONS = rrth.RRTHOptions()
SHARES = np.array([0.25, 0.5, 1.0])


class Table:
    """What is no array, but becomes one, as the columns of tables of other libraries do."""

    def __init__(self, numbers):
        self.numbers = numbers

    def __array__(self, dtype=None, copy=None):
        """Return the numbers."""
        return np.array(self.numbers, dtype=dtype)


def unaligned(q):
    """Return the same numbers at an address that is no multiple of their size."""
    room = np.zeros(8 * q.size + 1, np.uint8)
    array = room[1:].view(np.float64).reshape(q.shape)
    array[...] = q
    return array


def read_only(q):
    """Return the same numbers, not to be written to."""
    array = q.copy()
    array.setflags(write=False)
    return array


def mapped(q):
    """Return the same numbers as a subclass of arrays."""
    return q.copy().view(np.memmap)


FORMS = {
    'list': lambda q: q.tolist(),
    'tuple': lambda q: tuple(q.tolist()),
    'list of numbers of numpy': lambda q: [np.float32(x) for x in q],
    'float16': lambda q: q.astype(np.float16),
    'float32': lambda q: q.astype(np.float32),
    'longdouble': lambda q: q.astype(np.longdouble),
    'big-endian': lambda q: q.astype('>f8'),
    'every second value': lambda q: np.repeat(q, 2, axis=-1)[..., ::2],
    'backwards': lambda q: q[..., ::-1].copy()[..., ::-1],
    'row of a table in Fortran order': lambda q: np.asfortranarray(np.stack([q] * 3))[0],
    'unaligned': unaligned,
    'read-only': read_only,
    'subclass': mapped,
    'masked nowhere': np.ma.masked_array,
    'another library': Table,
}
WHOLE_FORMS = {
    'whole numbers': lambda q: q.astype(int),
    'list of whole numbers': lambda q: q.astype(int).tolist(),
    'int8': lambda q: q.astype(np.int8),
}
NO_ARRAYS = {
    'another length': lambda q: np.append(q, q, axis=-1)[..., :-1],
    'a number': lambda q: 1.0,
    'nothing': lambda q: [],
    'NaN': lambda q: np.full_like(q, np.nan),
    'infinity': lambda q: np.full_like(q, -np.inf).tolist(),
    'complex': lambda q: q + 1j,
    'list of complex numbers': lambda q: (q + 0j).tolist(),
    'texts': lambda q: q.astype(str),
    'a text': lambda q: 'home',
    'bytes': lambda q: b'12345678',
    'true and false': lambda q: q > 0,
    'None': lambda q: None,
    'objects': lambda q: q.astype(object),
    'times': lambda q: q.astype('m8[s]'),
    'hidden by a mask': lambda q: np.ma.masked_equal(q, q.flat[-1]),
    'rows of different lengths': lambda q: [[0.0], [0.0, 1.0]],
    'a set': lambda q: {0.0, 1.0},
    'too large a number': lambda q: [10**400, *q.ravel()[1:].tolist()],
}

world = wearer_world(radius=0.02)
motion = rrth.Trajectory([0.0, 0.5, 1.0], [Q, Q, WHOLE], np.zeros((3, 4)), np.zeros((3, 4)))
box = {'name': 'chest', 'center': [0, 0, 1], 'size': [1, 1, 2], 'rotation': np.eye(3)}
EYES, ZEROS = np.eye(4), np.zeros((3, 4))


def limited(**changes):
    """Return limits of which one is given."""
    return rrth.MotionLimits(
        **{**dict.fromkeys(('velocity', 'acceleration', 'jerk'), Q0), **changes}
    )


def moved(**changes):
    """Return a state of motion of which one array is given."""
    names = ('positions', 'velocities', 'accelerations')
    return rrth.MotionState(**{**dict.fromkeys(names, Q), **changes})


def timed(**changes):
    """Return a motion of which one array is given."""
    states = dict.fromkeys(('positions', 'velocities', 'accelerations'), ZEROS)
    return rrth.Trajectory(**{'times': [0, 1, 2], **states, **changes})


# Each public argument that is an array: numbers that it takes, and the call.
CALLS = {
    'World.is_valid q': (Q, world.is_valid),
    'World.is_in_bounds q': (Q, world.is_in_bounds),
    'World.is_free q': (Q, world.is_free),
    'World.is_edge_valid q_from': (Q, lambda q: world.is_edge_valid(q, FOLDED)),
    'World.is_edge_valid q_to': (Q, lambda q: world.is_edge_valid(FOLDED, q)),
    'World.first_free q': (Q, lambda q: world.first_free(q, FOLDED, SHARES, 3)),
    'World.first_free way': (Q, lambda q: world.first_free(FOLDED, q, SHARES, 3)),
    'World.first_free shares': (SHARES, lambda s: world.first_free(Q, FOLDED, s, 3)),
    'World.colliding_bars q': (Q, world.colliding_bars),
    'World.clearances q': (Q, world.clearances),
    'World.clearances q of many': (np.stack([Q, WHOLE]), world.clearances),
    'forward_kinematics q': (Q, lambda q: rrth.forward_kinematics(ARM, q)),
    'forward_kinematics q of many': (
        np.stack([Q, WHOLE]),
        lambda q: rrth.forward_kinematics(ARM, q),
    ),
    'tool_pose q': (Q, lambda q: rrth.tool_pose(ARM, q)),
    'pointing_error q': (Q, lambda q: pointing_error(ARM, q, [1, 0, 0])),
    'pointing_error target': (Q[:3], lambda p: pointing_error(ARM, Q, p)),
    'goal_configurations q_near': (
        Q,
        lambda q: rrth.goal_configurations(ARM, GOAL, world, q, 64),
    ),
    'pointing_problem q_start': (
        Q,
        lambda q: replace(rrth.pointing_problem(ARM, GOAL, world, q), world=world),
    ),
    'PlanningProblem q_start': (
        Q,
        lambda q: rrth.PlanningProblem(world=world, q_start=q, q_goals=[Q]),
    ),
    'PlanningProblem q_goals': (
        np.stack([Q, WHOLE]),
        lambda q: rrth.PlanningProblem(world=world, q_start=Q, q_goals=q),
    ),
    'PlanningProblem target': (
        Q[:3],
        lambda p: rrth.PlanningProblem(world=world, q_start=Q, q_goals=[Q], target=p),
    ),
    'plan_motion q_start': (
        FOLDED_16,
        lambda q: (
            rrth.plan_motion(
                ARM, wearer(), q, GOAL, LIMITS, OPTIONS, margin=0.02, ray_guard_length=1.0, seed=1
            ).trajectory
        ),
    ),
    'sample times': (np.array([0.25, 0.5, 2.0]), lambda t: rrth.sample(motion, t)),
    'Path waypoints': (np.stack([Q, WHOLE]), rrth.Path),
    'PointingGoal target': (Q[:3], rrth.PointingGoal),
    'Trajectory times': (np.array([0.0, 1.0, 2.0]), lambda t: timed(times=t)),
    **{
        f'Trajectory {name}': (np.stack([Q, WHOLE, Q]), lambda q, name=name: timed(**{name: q}))
        for name in ('positions', 'velocities', 'accelerations')
    },
    **{
        f'MotionState {name}': (Q, lambda q, name=name: moved(**{name: q}))
        for name in ('positions', 'velocities', 'accelerations')
    },
    **{
        f'MotionLimits {name}': (Q0, lambda q, name=name: limited(**{name: q}))
        for name in ('velocity', 'acceleration', 'jerk')
    },
    'Box center': (Q[:3], lambda p: rrth.Box(**{**box, 'center': p})),
    'Box size': (Q0[:3], lambda p: rrth.Box(**{**box, 'size': p})),
    'Box rotation': (np.eye(3), lambda R: rrth.Box(**{**box, 'rotation': R})),
    'ArmModel dh': (np.ones((5, 4)) * [1, 1, 1, 0], lambda dh: replace(ARM, dh=dh)),
    'ArmModel bounds': (np.array([[-1.0] * 4, [2.0] * 4]), lambda b: replace(ARM, bounds=b)),
    'ArmModel radii': (np.ones(5), lambda r: replace(ARM, radii=r)),
    'ArmModel T_base_mount': (EYES, lambda T: replace(ARM, T_base_mount=T)),
    **{
        f'{name} T_base_link': (EYES, lambda T, load=load: load(T_base_link=T))
        for name, load in {
            'arm_from_mapping': partial(rrth.arm_from_mapping, table_1_mapping()),
            'load_arm': rrth.load_arm,
        }.items()
    },
    'Capsule ends': (
        np.array([[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]),
        lambda ends: Capsule(name='thumb', link=1, ends=ends, radius=0.01),
    ),
    'BoxMap bounds': (np.array([[0.0] * 4, [9.0] * 4]), lambda b: replace(MAP, bounds=b)),
    'BoxMap obstacles': (
        np.array([[[4.0] * 4, [5.0] * 4]]),
        lambda boxes: replace(MAP, obstacles=boxes),
    ),
    'BoxMap start': (Q0, lambda q: replace(MAP, start=q)),
    'BoxMap goal': (Q0, lambda q: replace(MAP, goal=q)),
}
PATH = rrth.Path([Q, WHOLE])
PROBLEM = rrth.PlanningProblem(world=world, q_start=Q, q_goals=[Q])
# Public functions and their arguments, which are values of this package or of numpy.
FUNCTIONS = {
    rrth.forward_kinematics: {'arm': ARM, 'q': Q},
    rrth.tool_pose: {'arm': ARM, 'q': Q},
    rrth.arm_world: {'arm': ARM, 'scene': wearer(), 'margin': 0.02, 'ray_guard_length': 1.0},
    rrth.goal_configurations: {
        'arm': ARM,
        'goal': GOAL,
        'world': world,
        'q_near': Q,
        'n_draws': 64,
    },
    rrth.pointing_problem: {'arm': ARM, 'goal': GOAL, 'world': world, 'q_start': Q, 'goals': None},
    rrth.map_world: {'box_map': MAP},
    rrth.map_problem: {'box_map': MAP, 'world': None},
    rrth.PlanningProblem: {'world': world, 'q_start': Q, 'q_goals': [Q]},
    rrth.plan: {
        'problem': PROBLEM,
        'options': OPTIONS,
        'rng': np.random.default_rng(1),
        'should_stop': lambda: True,
        'previous': None,
    },
    rrth.plan_motion: {
        'arm': ARM,
        'scene': wearer(),
        'q_start': FOLDED,
        'goal': GOAL,
        'limits': LIMITS,
        'options': OPTIONS,
        'margin': 0.02,
        'ray_guard_length': 1.0,
        'seed': 1,
        'should_stop': lambda: True,
        'moving': None,
        'escape_depth': 0.05,
        'reserve': 0.0,
        'second_checker': 'fcl',
        'rules': None,
        'stop_limits': None,
        'body_age': 0.0,
    },
    rrth.warm_up: {'arm': ARM, 'options': OPTIONS, 'second_checker': 'fcl'},
    rrth.parameterize: {'path': PATH, 'blends': (), 'limits': LIMITS, 'v_start': 0.0},
    rrth.sample: {'trajectory': motion, 'times': 0.5},
    rrth.brake: {'trajectory': motion, 'time': 0.5, 'limits': LIMITS},
    rrth.certify: {'trajectory': motion, 'world': world, 'begin': 0.0},
    rrth.certify_braking: {
        'trajectory': motion,
        'time': 0.5,
        'world': world,
        'limits': LIMITS,
    },
}
# What people give in place of a value: its numbers, its name, a seed, or another value.
NO_VALUES = (None, 'home', 3, [1.5, 0.1, 0.3], {'target': [1.5, 0.1, 0.3]}, rrth.PlanStatus.SOLVED)
# What such arguments are called that are made by other functions only, or that say no more.
MADE = {
    'World': {'bounds', 'robot', 'obstacles', 'lanes', 'functions', 'space'},
    'Box': {'numbers'},
    'Scene': {'numbers'},
}
EACH = pytest.mark.parametrize('name', CALLS)


def said(name, call, array):
    """Return what a call says of an array that is none, once that is one sentence of ours."""
    with warnings.catch_warnings(), pytest.raises(rrth.RrthError) as caught:
        warnings.simplefilter('error')
        call(array)
    sentence = str(caught.value)
    assert '\n' not in sentence
    assert ' expected ' in sentence, (name, sentence)
    return sentence


@EACH
@pytest.mark.parametrize('form', FORMS)
def test_whatever_numpy_makes_an_array_of_is_taken(name, form):
    array, call = CALLS[name]
    given = FORMS[form](array)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert not [*differences(call(given), call(array))]


@EACH
@pytest.mark.parametrize('form', WHOLE_FORMS)
def test_whole_numbers_are_taken(name, form):
    array, call = CALLS[name]
    # Of zeros numpy has two.
    whole = np.rint(array) + 0.0
    assert not [*differences(call(WHOLE_FORMS[form](whole)), call(whole))]


@pytest.mark.parametrize(
    ('name', 'form'),
    [(name, form) for name in CALLS for form in NO_ARRAYS if form not in ALSO_TAKEN.get(name, ())],
)
def test_what_is_no_array_of_numbers_is_said_in_one_sentence(name, form):
    array, call = CALLS[name]
    sentence = said(name, call, NO_ARRAYS[form](array))
    argument = {'velocity': 'max_velocity', 'acceleration': 'max_acceleration', 'jerk': 'max_jerk'}
    word = name.split()[1]
    assert '[' in sentence
    # Of several arrays of one length the second one may be called wrong.
    assert argument.get(word, word) in sentence or form in ('another length', 'nothing')


@EACH
def test_what_is_given_is_neither_changed_nor_kept(name):
    array, call = CALLS[name]
    given = array.copy()
    answer = call(given)
    before = [*differences(answer, call(array))]
    np.testing.assert_array_equal(given, array)
    assert given.flags.writeable
    given[...] = 77.0
    assert not before
    assert not [*differences(answer, call(array))]


@pytest.mark.parametrize('function', FUNCTIONS, ids=lambda f: f.__name__)
def test_what_is_no_value_of_its_class_is_said_in_one_sentence(function):
    """Numbers of another type are left to the tests above."""
    arguments = FUNCTIONS[function]
    function(**arguments)
    for name, given in arguments.items():
        if isinstance(given, (np.ndarray, list)) or name == 'times':
            continue
        for value in NO_VALUES:
            is_number = isinstance(given, (int, float)) and value == 3
            is_left_out = given is None and value is None
            if is_number or is_left_out:
                continue
            sentence = said(name, lambda v, name=name: function(**{**arguments, name: v}), value)
            assert sentence.startswith(f'{name}: '), sentence


def test_every_public_function_that_computes_is_among_them():
    computing = {
        value
        for name in rrth.__all__
        if inspect.isfunction(value := getattr(rrth, name))
        and not name.startswith('load_')
        and not name.endswith('_from_mapping')
    }
    assert computing <= set(FUNCTIONS)


def test_numbers_in_place_of_boxes_are_said_in_one_sentence():
    assert said('boxes', rrth.Scene, [[0.0, 0.0, 1.0]]).startswith('boxes: ')


def test_every_public_argument_that_is_an_array_is_among_them():
    known = {tuple(name.split()[:2]) for name in CALLS}
    for name in rrth.__all__:
        value = getattr(rrth, name)
        if name in ANSWERS:
            continue
        calls = {name: value}
        if inspect.isclass(value):
            methods = inspect.getmembers(value, inspect.isfunction)
            calls |= {f'{name}.{k}': f for k, f in methods if not k.startswith('_')}
        for called, function in calls.items():
            for argument, parameter in inspect.signature(function).parameters.items():
                kind = repr(parameter.annotation)
                if 'ndarray' in kind or '_SupportsArray' in kind:
                    assert argument in MADE.get(called, ()) or (called, argument) in known, (
                        f'{called}: {argument}'
                    )


@pytest.mark.parametrize('number', [0.25, np.float32(0.25), np.float16(0.25), np.array(0.25)])
def test_numbers_of_numpy_are_numbers(number):
    body = wearer()
    assert not [
        *differences(
            rrth.arm_world(ARM, body, number, 4 * number).obstacles,
            rrth.arm_world(ARM, body, 0.25, 1.0).obstacles,
        )
    ]
    assert not [*differences(rrth.brake(motion, number, LIMITS), rrth.brake(motion, 0.25, LIMITS))]
    assert world.is_valid(FOLDED, number) == world.is_valid(FOLDED, 0.25)
    assert not [*differences(world.clearances(Q, number), world.clearances(Q, 0.25))]
    assert not [*differences(rrth.sample(motion, number), rrth.sample(motion, [0.25]))]
    assert rrth.certify(motion, world, number) == rrth.certify(motion, world, 0.25)
    assert rrth.load_settings(4, margin=number).margin == 0.25


@pytest.mark.parametrize('number', ['0.1', None, 1j, True, [0.1], np.array([0.1, 0.2]), np.nan])
def test_what_is_no_number_is_said_in_one_sentence(number):
    body = wearer()
    for name, ask in {
        'margin': lambda: rrth.arm_world(ARM, body, number, 1.0),
        'ray_guard_length': lambda: rrth.arm_world(ARM, body, 0.02, number),
        'time': lambda: rrth.brake(motion, number, LIMITS),
        'begin': lambda: rrth.certify(motion, world, number),
        'v_start': lambda: rrth.parameterize(rrth.Path([Q, WHOLE]), (), LIMITS, number),
        'resolution': lambda: replace(world, resolution=number),
        'seed': lambda: rrth.plan_motion(
            ARM, body, Q, GOAL, LIMITS, OPTIONS, margin=0.1, ray_guard_length=1.0, seed=number
        ),
        'escape_depth': lambda: rrth.plan_motion(
            ARM,
            body,
            Q,
            GOAL,
            LIMITS,
            OPTIONS,
            margin=0.1,
            ray_guard_length=1.0,
            seed=1,
            escape_depth=number,
        ),
    }.items():
        assert said(name, lambda _, ask=ask: ask(), None).startswith(f'{name}: ')
    if number is not None:
        assert said('ray_length', lambda n: world.is_valid(FOLDED, n), number)


def test_a_map_has_no_clearances_and_limits_are_those_of_the_motion():
    point = rrth.map_world(MAP)
    assert point.is_valid([1, 1, 1, 1])
    assert not point.is_valid([4.5] * 4)
    assert 'the world of an arm' in said('clearances', point.clearances, [1, 1, 1, 1])
    assert 'joints' in said('brake', lambda n: rrth.brake(motion, 0.2, limits(n)), 3)
