# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of values, and what arrives of them in other processes, are like the originals."""

import copy
import dataclasses
from importlib import import_module
import inspect
from multiprocessing import get_context
import pickle
import pkgutil
import subprocess
import sys

from numba.core.event import install_recorder
import numpy as np
import pytest
import rrth_planner as rrth
from rrth_planner.collision.certificate import Certificate
from rrth_planner.collision.violation import Disagreement, Violation
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.frozen import Frozen
from rrth_planner.model.goal import PacedGoal
from rrth_planner.model.separation import seen_body, SeparationRules
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.edge_checks import by_check_points, sampled
from rrth_planner.planning.options import ALGORITHMS
from rrth_planner.timing.corner_blends import Blend
from rrth_planner.timing.lead_in import lead_in
from rrth_planner.timing.rate_profile import steady
from rrth_planner.wearer.posture import Posture
from same_values import differences, values_within, writable
from worlds import FOLDED, limits, seeded_capsule_arm, table_1_arm, wearer

# Where the values of the public functions come from.
ROOMS = ('kernels', 'model', 'collision', 'planning', 'timing', 'pipeline', 'wearer')
ARM, GOAL, LIMITS = table_1_arm(0.02), rrth.PointingGoal([1.5, 0.1, 0.3]), limits()
OPTIONS = rrth.RRTHOptions(improve_time=0.0)
WAYS = {
    'copy': copy.copy,
    'deepcopy': copy.deepcopy,
    'replace': dataclasses.replace,
    **{
        f'pickle {protocol}': lambda value, protocol=protocol: pickle.loads(
            pickle.dumps(value, protocol)
        )
        for protocol in range(pickle.HIGHEST_PROTOCOL + 1)
    },
}
REIMPORT = """
import importlib, sys
import rrth_planner as rrth

def plan():
    import rrth_planner as rrth
    arm = rrth.load_arm()
    world = rrth.arm_world(arm, rrth.load_body(), 0.02, 1.0)
    return rrth.pointing_problem(arm, rrth.PointingGoal([1.5, 0.1, 0.3]), world, [0, 0, 1, 1])

def forget(*kept):
    for name in [*sys.modules]:
        if name.split('.')[0] == 'rrth_planner' and not name.startswith(kept):
            del sys.modules[name]

before = plan()
"""


def made_of_all():
    """Return values that contain one of each kind that public functions take or return."""
    world = rrth.arm_world(ARM, wearer(), margin=0.02, ray_guard_length=1.0)
    problem = rrth.pointing_problem(ARM, GOAL, world, FOLDED)
    result = rrth.plan(problem, OPTIONS, np.random.default_rng(0))
    motion = rrth.parameterize(result.path, (), LIMITS)
    point = rrth.load_map('spiral')
    state = rrth.MotionState(positions=FOLDED, velocities=0.1 * FOLDED, accelerations=0 * FOLDED)
    question = PlanQuestion(
        arm=ARM,
        scene=wearer(),
        q_start=FOLDED,
        goal=PacedGoal([1.5, 0.1, 0.3], 1.0, 2.0),
        limits=LIMITS,
        options=OPTIONS,
        margin=0.02,
        ray_guard_length=1.0,
        seed=1,
        moving=rrth.StartState(state=state, running=motion, time=0.1),
        rules=SeparationRules(),
    )
    violation = Violation(time=0.1, distance=-0.01, bar='ray', box='head')
    return {
        'problem': problem,
        'arm with capsules': seeded_capsule_arm(3),
        'question': question,
        'goal': GOAL,
        'goals': rrth.goal_configurations(ARM, GOAL, world, FOLDED, 64),
        'result': result,
        'trees': tuple(result.trees),
        'plan': rrth.plan_motion(
            ARM,
            wearer(),
            FOLDED,
            GOAL,
            LIMITS,
            OPTIONS,
            margin=0.02,
            ray_guard_length=1.0,
            seed=1,
        ),
        'map': point,
        'map problem': rrth.map_problem(point),
        'other checks': (sampled(world, 0.1), by_check_points(world, 0.1)),
        'settings': rrth.load_settings(4),
        'options': tuple(kind() for kind in (*ALGORITHMS.values(), rrth.PrintedRRTHOptions)),
        'certificate': Certificate(is_proven=True),
        'disagreement': Disagreement(motion, violation, 0.5),
        'blend': Blend(FOLDED, FOLDED, FOLDED, 0.1),
        'lead-in': lead_in(state, LIMITS),
        'rate': steady(0.1, 1.0),
        'body': seen_body(wearer(), 0.1, SeparationRules()),
        'skeleton': load_skeleton('azure_kinect'),
        'posture': Posture(names=('chest',), positions=np.zeros((1, 3))),
    }


def answers(value):
    """Return what a value answers, asked through public functions; itself where it is no more."""
    if isinstance(value, rrth.PlanningProblem):
        result = rrth.plan(value, OPTIONS, np.random.default_rng(0))
        again = rrth.plan(value, OPTIONS, np.random.default_rng(0), previous=result)
        return result.path, again.path, answers(value.world)
    if isinstance(value, rrth.World):
        low, high = value.bounds
        rng = np.random.default_rng(1)
        drawn = rng.uniform(low, high, (8, len(low)))
        edges = [value.is_edge_valid(p, q) for p, q in zip(drawn, drawn[1:], strict=False)]
        return edges, [value.is_valid(q) for q in drawn]
    if isinstance(value, rrth.ArmModel):
        q = value.bounds.mean(axis=0)
        world = rrth.arm_world(value, wearer(), 0.0, 0.1)
        return rrth.forward_kinematics(value, q), world.clearances(q), answers(world)
    if isinstance(value, rrth.Scene):
        return rrth.arm_world(ARM, value, 0.02, 1.0).obstacles
    if isinstance(value, rrth.Trajectory) and len(value.times) > 1:
        world = rrth.arm_world(ARM, wearer(), 0.02, 1.0)
        limited = limits(value.positions.shape[1])
        return rrth.sample(value, 0.1), rrth.brake(value, 0.1, limited), rrth.certify(value, world)
    return [value]


@pytest.fixture(scope='module')
def originals():
    return made_of_all()


def kinds(module):
    """Return the dataclasses that a module defines."""
    return [
        kind
        for _, kind in inspect.getmembers(module, inspect.isclass)
        if dataclasses.is_dataclass(kind) and kind.__module__ == module.__name__
    ]


def has_arrays(kind):
    """Return whether a dataclass is declared to hold arrays."""
    return any('ndarray' in repr(field.type) for field in dataclasses.fields(kind))


def test_every_frozen_value_with_arrays_says_how_it_is_copied():
    own = []
    for room in ROOMS:
        home = import_module(f'rrth_planner.{room}')
        for info in pkgutil.walk_packages(home.__path__, f'{home.__name__}.'):
            own += [
                f'{info.name}: {kind.__qualname__}'
                for kind in kinds(import_module(info.name))
                if kind.__dataclass_params__.frozen
                # What a module keeps to itself is never sent.
                and not kind.__qualname__.startswith('_')
                and has_arrays(kind)
                and not issubclass(kind, Frozen)
                and '__reduce__' not in vars(kind)
            ]
    assert not own


def test_every_public_value_is_among_those_that_are_copied(originals):
    copied = {type(value) for value in values_within(originals)}
    public = [getattr(rrth, name) for name in rrth.__all__]
    assert not [k.__name__ for k in public if dataclasses.is_dataclass(k) and k not in copied]


@pytest.mark.parametrize('way', WAYS)
def test_a_copy_is_the_same_frozen_value(originals, way):
    seen = set()
    for value in values_within(originals):
        if id(value) in seen:
            continue
        seen.add(id(value))
        assert not [*writable(value, type(value).__name__)]
        other = WAYS[way](value)
        assert not [*differences(value, other, type(value).__name__)]
        assert not [*writable(other, type(value).__name__)]
        if dataclasses.fields(value):
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(other, dataclasses.fields(value)[0].name, None)
    assert len(seen) > 40


@pytest.mark.parametrize('way', WAYS)
def test_a_copy_gives_the_same_answers(originals, way):
    for name, value in originals.items():
        others = {value if dataclasses.is_dataclass(value) else None, *values_within(value)} - {
            None
        }
        for one in others:
            assert not [*differences(answers(one), answers(WAYS[way](one)), name)]


def test_no_copy_compiles_anything(originals):
    data = pickle.dumps(originals)
    with install_recorder('numba:compile') as recorded:
        sent, copied = pickle.loads(data), copy.deepcopy(originals)
        for name, value in originals.items():
            for one, *others in zip(
                *(values_within(v) for v in (value, sent[name], copied[name])), strict=True
            ):
                for other in others:
                    answers(other)
                    for seam in ('chain', 'edge_check', 'slide_goal'):
                        # To ask whether it is a certain one is how some functions choose.
                        assert getattr(other, seam, None) is getattr(one, seam, None)
    assert not recorded.buffer


def test_a_seam_that_no_module_has_is_not_sent():
    from rrth_planner.kernels.jit import CHAIN, first_class, kernel

    @kernel(CHAIN.signature)
    def chain(q, ray_length, points, at):
        return 0

    with pytest.raises(
        pickle.PicklingError, match='chain: of a function, expected one of a module'
    ):
        pickle.dumps(first_class(chain))


def answered(job):
    """Return what a value answers here, and whether it is frozen; in another process."""
    name, value = job
    return name, [answers(one) for one in values_within(value)], [*writable(value, name)]


@pytest.mark.parametrize('method', ['fork', 'spawn', 'forkserver'])
def test_a_pool_of_processes_gives_the_same_answers(originals, method):
    with get_context(method).Pool(2) as pool:
        found = pool.map(answered, [*originals.items()], chunksize=4)
        # A child of a process in which ROS has handled signals does not end by one.
        pool.close()
        pool.join()
    for (name, value), (told, there, open_arrays) in zip(originals.items(), found, strict=True):
        assert told == name
        assert not open_arrays
        assert not [*differences(there, [answers(one) for one in values_within(value)], name)]


@pytest.mark.parametrize(
    'again',
    [
        'importlib.reload(rrth)',
        "del sys.modules['rrth_planner']",
        "forget('rrth_planner.kernels')",
    ],
)
def test_the_package_may_be_imported_a_second_time(again):
    code = f'{REIMPORT}\n{again}\nassert (plan().q_goals == before.q_goals).all()'
    subprocess.run([sys.executable, '-c', code], check=True, timeout=300)


@pytest.mark.parametrize(
    'again', ['forget()', "importlib.reload(sys.modules['rrth_planner.kernels.jit'])"]
)
def test_kernels_are_not_imported_a_second_time_and_say_why(again):
    code = f'{REIMPORT}\n{again}\nplan()'
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith(
        'ImportError: rrth_planner.kernels: imported a second time in this proc'
    )
    assert 'start a new process' in last
