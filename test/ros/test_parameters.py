# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The planner's parameters: defaults, descriptions, and a sentence for each rejection."""

from dataclasses import fields
import sys

import pytest

pytest.importorskip('rclpy')

from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.body_reach import BODY_REACH  # noqa: E402
from rrth_planner.model.errors import ModelError, OptionsError  # noqa: E402
from rrth_planner.model.separation import governing_reach  # noqa: E402
from rrth_planner.planning.options import RRTHOptions  # noqa: E402
from rrth_planner.ros.interface.parameters import (  # noqa: E402
    current_parameters,
    declare_parameters,
    declared,
)
from rrth_planner.ros.middleware.parameter_declaration import ARM  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')
NAN = float('nan')


@pytest.fixture(name='started')
def _started():
    nodes = []

    def start(**overrides):
        given = [Parameter(name=name, value=value) for name, value in overrides.items()]
        nodes.append(Node('rrth_planner', parameter_overrides=given))
        return nodes[-1], declare_parameters(nodes[-1])

    yield start
    for node in nodes:
        node.destroy_node()


def test_the_defaults_are_those_of_the_core(started):
    _, parameters = started()
    assert parameters.options == RRTHOptions()
    assert (parameters.base_frame, parameters.seed) == ('torso', -1)
    assert (parameters.margin, parameters.ray_guard_length) == (0.02, 1.0)
    assert parameters.limits.velocity.tolist() == [1.5] * 4
    assert parameters.limits.acceleration.tolist() == [4.0] * 4
    assert parameters.limits.jerk.tolist() == [40.0] * 4


def test_the_packaged_file_holds_every_parameter_with_its_default():
    file = load_yaml(resource_path('config/planner.yaml'))['/**']['ros__parameters']
    assert file == {s.name: s.default for s in (ARM, *declared(4))}


def test_every_parameter_says_its_unit_and_range(started):
    node, _ = started()
    for setting in (ARM, *declared(4)):
        descriptor = node.describe_parameter(setting.name)
        assert descriptor.description.endswith(f'[{setting.unit}]')
        (numeric,) = [
            *descriptor.floating_point_range,
            *descriptor.integer_range,
            *([] if setting.low is not None else [None]),
        ]
        assert numeric is None or (numeric.from_value, numeric.to_value, numeric.step) == (
            setting.low,
            setting.high,
            0,
        )


def test_a_single_value_counts_for_every_joint(started):
    _, parameters = started(max_velocity=[0.5], max_jerk=[1.0, 2.0, 3.0, 4.0])
    assert parameters.limits.velocity.tolist() == [0.5] * 4
    assert parameters.limits.jerk.tolist() == [1.0, 2.0, 3.0, 4.0]


def test_stops_have_the_limits_of_motions_or_greater_ones(started):
    _, parameters = started(max_jerk=[50.0])
    assert parameters.stop_limits.rows[0].tolist() == parameters.limits.velocity.tolist()
    assert parameters.stop_limits.acceleration.tolist() == [4.0] * 4
    assert parameters.stop_limits.jerk.tolist() == [50.0] * 4
    _, parameters = started(stop_acceleration=[10.0, 2.0, 0.0, 5.0], stop_jerk=[400.0])
    assert parameters.stop_limits.acceleration.tolist() == [10.0, 4.0, 4.0, 5.0]
    assert parameters.stop_limits.jerk.tolist() == [400.0] * 4
    assert parameters.limits.acceleration.tolist() == [4.0] * 4


def test_parts_get_as_far_as_speeds_of_ones_own_take_them_or_lines_of_ones_own(started):
    def lines(name, **values):
        _, parameters = started(**values)
        return governing_reach(parameters.execution.separation.rules, name)[1]

    assert lines('hand', separation='true') == dict(BODY_REACH)['hand']
    speeds = {'separation': 'true', 'body_speeds': ['hand: 3', ': 1.5']}
    assert lines('hand', **speeds) == ((0.0, 3.0),)
    assert lines('foot', **speeds) == ((0.0, 1.5),)
    reach = {**speeds, 'body_reach': ['hand: 4t, .2 + 1 t']}
    assert lines('left hand', **reach) == ((0.0, 4.0), (0.2, 1.0))
    assert lines('foot', **reach) == ((0.0, 1.5),)
    # Without any lines the speeds count alone.
    assert lines('hand', separation='true', body_reach=['']) == ((0.0, 2.0),)


def test_a_change_is_there_for_the_next_plan(started):
    node, before = started()
    assert node.set_parameters([Parameter(name='margin', value=0.05)])[0].successful
    assert current_parameters(node, before.arm).margin == 0.05
    assert before.margin == 0.02


def test_pairs_that_are_allowed_no_more_may_not_meet():
    node, changes = Node('rrth_planner'), []
    before = declare_parameters(node, changes.append)
    for pairs in (['link 3: torso'], ['link 4: head'], ['']):
        assert node.set_parameters([Parameter(name='allowed', value=pairs)])[0].successful
    node.destroy_node()
    assert not before.arm.allowed
    assert [p.arm.allowed for p in changes] == [(('link 3', 'torso'),), (('link 4', 'head'),), ()]


@pytest.mark.parametrize(
    ('name', 'value', 'sentence'),
    [
        ('margin', 3.0, 'margin out of range'),
        ('margin', NAN, 'margin out of range'),
        ('seed', -2, 'seed out of range'),
        ('step_size', 0.0, 'step_size out of range'),
        ('max_velocity', [1.0, 2.0], 'max_velocity: [1.0, 2.0], expected 4 values, or one'),
        ('max_velocity', [NAN], 'max_velocity: [nan], expected finite numbers [rad/s]'),
        ('max_acceleration', [0.0] * 4, '1e+06 [rad/s^2]'),
        ('max_jerk', [-1.0], '[rad/s^3]'),
        ('stop_jerk', [-1.0], 'stop_jerk: [-1.0], expected 4 values, or one for all joints, 0 or'),
        ('stop_acceleration', [1.0, 2.0], 'stop_acceleration: [1.0, 2.0], expected 4 values'),
        ('stop_acceleration', [NAN], 'stop_acceleration: [nan], expected finite'),
        (
            'body_speeds',
            ['hand: fast', ': 2'],
            'body_speeds: "hand: fast", expected words',
        ),
        ('body_speeds', ['hand: 2'], 'body_speeds: none for any other part of the body'),
        (
            'body_reach',
            ['hand'],
            'body_reach: "hand", expected words of a name and lines',
        ),
        ('body_reach', ['hand: 2'], 'body_reach: "hand: 2", expected words of a name and lines'),
        ('body_reach', ['hand: 2 t, 1 - 2 t'], 'body_reach: "hand: 2 t, 1 - 2 t", expected words'),
        ('body_reach', ['hand: 1 + 2 t'], '"hand: 1 + 2 t", expected one of its lines without c'),
        (
            'body_reach',
            ['hand: 2 t, 11 + 1 t'],
            '"c + w t" with c from 0 to 10 [m]',
        ),
        ('algorithm', 'prm', 'algorithm: "prm", expected one that is available: rrt_h, rrt,'),
        ('second_checker', 'bullet', 'second_checker: "bullet", expected fcl or coal'),
        ('time_limit', 'soon', 'Wrong parameter type'),
        ('arm', 'other.yaml', 'read-only'),
        ('base_frame', 'camera', 'read-only'),
        ('separation', False, 'read-only'),
    ],
)
def test_a_bad_value_is_rejected_and_changes_nothing(started, name, value, sentence):
    node, _ = started()
    before = node.get_parameter(name).value
    (result,) = node.set_parameters([Parameter(name=name, value=value)])
    assert not result.successful
    assert sentence in result.reason
    assert '\n' not in result.reason
    assert node.get_parameter(name).value == before


def test_a_second_checker_that_is_not_installed_is_rejected_by_name(started, monkeypatch):
    monkeypatch.setitem(sys.modules, 'coal', None)
    node, parameters = started()
    assert parameters.second_checker == 'fcl'
    (result,) = node.set_parameters([Parameter(name='second_checker', value='coal')])
    assert result.reason == (
        'second_checker: coal is not installed, expected for the second check of every motion '
        '(pip install coal)'
    )
    assert current_parameters(node, parameters.arm).second_checker == 'fcl'


def test_an_empty_array_is_rejected(started):
    node, _ = started()
    empty = Parameter('max_jerk', Parameter.Type.DOUBLE_ARRAY, [])
    (result,) = node.set_parameters([empty])
    assert result.reason.startswith('max_jerk: [], expected 4 values, or one for all joints')


@pytest.mark.parametrize(
    ('name', 'value', 'error'),
    [
        ('margin', 3.0, OptionsError),
        ('margin', 3, OptionsError),
        ('margin', NAN, OptionsError),
        ('margin', [0.1], OptionsError),
        ('margin', True, OptionsError),
        ('seed', 1.0, OptionsError),
        ('is_bidirectional', 1, OptionsError),
        ('max_velocity', 1.5, OptionsError),
        ('max_velocity', [NAN], OptionsError),
        ('speed_limit', 1.0, OptionsError),
        ('max_jerk', [1.0, 2.0], OptionsError),
        ('algorithm', 'a_star', OptionsError),
        ('base_frame', '', OptionsError),
        ('separation', 'on', OptionsError),
        ('separation', 1, OptionsError),
        ('separation', [True], OptionsError),
        ('arm', '/nowhere/arm.yaml', ModelError),
    ],
)
def test_a_bad_override_is_rejected_at_the_start(started, name, value, error):
    with pytest.raises(error, match=name):
        started(**{name: value})


def test_every_option_of_the_core_is_a_parameter():
    assert {f.name for f in fields(RRTHOptions)} <= {s.name for s in declared(4)}


@pytest.mark.parametrize(
    ('value', 'chosen'),
    [
        ('auto', 'auto'),
        (True, 'true'),
        (False, 'false'),
        ('true', 'true'),
        ('False', 'false'),
    ],
)
def test_separation_is_a_word_or_a_truth_value(started, value, chosen):
    _, parameters = started(separation=value)
    assert parameters.separates == chosen
    assert (parameters.execution.separation is None) == (chosen == 'false')
    assert parameters.body_timeout == (0.0 if chosen == 'false' else 0.2)


def test_a_bad_separation_is_rejected_in_a_sentence(started):
    with pytest.raises(OptionsError, match=r"^separation: 'on', expected auto, true or false$"):
        started(separation='on')


def test_an_arm_of_ones_own_is_loaded(started, tmp_path):
    text = resource_path('config/arm.yaml').read_text().replace('joint_', 'axis_')
    (tmp_path / 'arm.yaml').write_text(text)
    _, parameters = started(arm=str(tmp_path / 'arm.yaml'))
    assert parameters.arm.joint_names == ('axis_1', 'axis_2', 'axis_3', 'axis_4')


def test_files_that_are_no_arm_are_rejected_by_name(tmp_path):
    (tmp_path / 'bad.yaml').write_text('joints: [')
    (tmp_path / 'empty.yaml').write_text('')
    for name in ('bad.yaml', 'empty.yaml', 'none.yaml'):
        with pytest.raises(ModelError, match=f'{name}.*expected'):
            load_arm(tmp_path / name)
    with pytest.raises(ModelError, match=r'config/other.yaml: not found, expected in one of'):
        resource_path('config/other.yaml')
