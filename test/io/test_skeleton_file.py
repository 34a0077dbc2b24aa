# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Skeletons from files: the ready-made ones, an owner's own, and what is none."""

import numpy as np
import pytest
from rrth_planner.io.resources import resource_path
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.text_file import load_yaml, to_yaml
from rrth_planner.model.errors import ModelError, SceneError
from rrth_planner.wearer.skeleton import FrameBase, JointBase

READY = sorted(path.stem for path in resource_path('config/skeletons/xsens.yaml').parent.iterdir())
ARM = ('upper arm', 'forearm', 'hand')
ARMS = {f'{side} {part}' for side in ('left', 'right') for part in ARM}


def changed(folder, name, change):
    """Return a file of a ready-made skeleton that was changed."""
    data = load_yaml(resource_path(f'config/skeletons/{name}.yaml'))
    change(data)
    file = folder / 'mine.yaml'
    file.write_text(to_yaml(data))
    return file


def test_all_ready_made_ones_are_there():
    assert READY == [
        'azure_kinect',
        'cmu_bvh',
        'coco_17',
        'halpe_26',
        'mediapipe',
        'rigid_bodies',
        'ros4hri',
        'tum_bvh',
        'xsens',
        'xsens_bvh',
        'zed_body_18',
        'zed_body_34',
        'zed_body_38',
        'zed_body_70',
    ]


@pytest.mark.parametrize('name', READY)
def test_a_ready_made_skeleton_has_both_sides_alike(name):
    skeleton = load_skeleton(name)
    parts = {part.name: part for part in skeleton.parts}
    assert {'torso', 'pelvis', 'head', *ARMS} <= set(parts)
    for part in skeleton.parts:
        if part.name.startswith('left '):
            other = parts[part.name.replace('left', 'right')]
            mirrored = other.margins.copy()
            mirrored[1] = mirrored[1, ::-1]
            np.testing.assert_array_equal(part.margins, mirrored)
            assert [joint.replace('left', 'right') for joint in part.joints] == [*other.joints]
            np.testing.assert_array_equal(part.rest * [1, -1, 1], other.rest)
    for joint in skeleton.joints:
        if joint.offset is not None and joint.name.startswith('left '):
            (other,) = (
                j for j in skeleton.joints if j.name == joint.name.replace('left', 'right')
            )
            np.testing.assert_array_equal(joint.offset * [1, -1, 1], other.offset)


@pytest.mark.parametrize('name', ['azure_kinect', 'mediapipe'])
def test_points_by_number_have_all_the_names_that_joints_use(name):
    skeleton = load_skeleton(name)
    assert len(skeleton.names_by_id) == {'azure_kinect': 32, 'mediapipe': 33}[name]
    assert {point for joint in skeleton.joints for point in joint.points} <= {
        *skeleton.names_by_id
    }


def test_joints_frames_and_base_are_those_of_the_file():
    skeleton = load_skeleton('cmu_bvh')
    assert isinstance(skeleton.base, FrameBase)
    assert skeleton.base.frame == 'chest'
    # x left, y up, z forward.
    np.testing.assert_array_equal(skeleton.axes, [[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    kinect = load_skeleton('azure_kinect')
    assert isinstance(kinect.base, JointBase)
    assert [axis.axis for axis in kinect.base.axes] == ['up', 'left']
    (head,) = (joint for joint in kinect.joints if joint.name == 'head')
    assert head.points == ('EAR_LEFT', 'EAR_RIGHT')


def test_parts_are_changed_entry_by_entry_added_and_left_out(tmp_path):
    def change(data):
        data['without'] = ['left hand']
        del data['joints']['left hand']
        data['parts'] = {
            'head': {'up': 0.25},
            'rucksack': {
                **dict.fromkeys(('forward', 'left', 'right', 'up', 'down'), 0.2),
                'around': ['base'],
                'backward': 0.5,
            },
            'neck': {'bone': ['neck', 'head'], 'radius': 0.2, 'ends': [0.0, 0.1]},
        }

    own = {part.name: part for part in load_skeleton(changed(tmp_path, 'xsens', change)).parts}
    ready = {part.name: part for part in load_skeleton('xsens').parts}
    assert set(own) == {*ready, 'rucksack'} - {'left hand'}
    assert own['head'].margins[2].tolist() == [ready['head'].margins[2, 0], 0.25]
    np.testing.assert_array_equal(own['head'].margins[:2], ready['head'].margins[:2])
    assert own['rucksack'].margins.tolist() == [[0.5, 0.2], [0.2, 0.2], [0.2, 0.2]]
    assert own['neck'].margins.tolist() == [[0.2, 0.2], [0.2, 0.2], [0.0, 0.1]]
    np.testing.assert_array_equal(own['torso'].margins, ready['torso'].margins)


def test_a_tracker_that_reports_in_the_base_frame_has_no_base(tmp_path):
    file = changed(tmp_path, 'xsens', lambda data: data.update(base='none'))
    assert load_skeleton(file).base is None


def drop(*keys):
    """Return a change that takes an entry away."""

    def change(data):
        for key in keys[:-1]:
            data = data[key]
        del data[keys[-1]]

    return change


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        (drop('joints'), 'skeleton: no joints, expected base, joints'),
        (drop('base'), 'skeleton: no base, expected base, joints'),
        (lambda d: d.update(joint={}), 'skeleton: joint, expected only base, joints, axes'),
        (lambda d: d.update(joints=[]), r'joints: \[\], expected a mapping by names'),
        (drop('joints', 'left wrist'), 'part "left forearm": no joint "left wrist", expected it'),
        (lambda d: d['joints'].update(wirst='Neck'), 'joint "wirst": used by no part'),
        (lambda d: d['joints'].update(neck=7), 'joint "neck": 7, expected a text'),
        (lambda d: d['joints'].update(neck=['Neck', 1]), 'joint "neck": 1, expected a text'),
        (
            lambda d: d['joints']['nose'].update(offset=[0.1, 'x', 0.0]),
            r'joint "nose": offset: .*expected numbers of shape \(3\) \[m\]',
        ),
        (
            lambda d: d['joints']['nose'].update(shift=1),
            'joint "nose": shift, expected only frame, offset',
        ),
        (lambda d: d.update(base='T8'), "base: 'T8', expected a mapping with origin, offset"),
        (lambda d: d['base'].update(origin='neck'), 'base: origin, expected only frame, offset'),
        (lambda d: d['axes'].update(up='w'), "axes: up 'w', expected one of x, -x, y"),
        (lambda d: d['axes'].update(up='y'), 'axes: .*expected right-handed, perpendicular'),
        (lambda d: d.update(without=['hat']), 'without: "hat", expected a part of config/human'),
        (
            lambda d: d.update(without=['head'], parts={'head': {'up': 0.3}}),
            'without: "head", expected a part .* that parts does not change',
        ),
        (lambda d: d.update(without=['neck', 7]), 'without: 7, expected a text'),
        (lambda d: d.update(names_by_id={'a': 1}), 'names_by_id: .*expected a list'),
        (
            lambda d: d.update(parts={'head': {'raduis': 0.1}}),
            'part "head": raduis, expected only bone, radius, ends, around',
        ),
        (
            lambda d: d.update(parts={'head': {'radius': 0.1}}),
            'part "head": radius, expected only around, backward',
        ),
        (
            lambda d: d.update(parts={'left shin': {'radius': '1'}}),
            r"part \"left shin\": radius: '1', expected a number \[m\]",
        ),
        (
            lambda d: d.update(parts={'left shin': {'ends': [0.1]}}),
            'part "left shin": .*expected',
        ),
        (
            lambda d: d.update(parts={'hat': {'up': 0.1}}),
            'part "hat": no around, backward',
        ),
        (
            lambda d: d.update(parts={'head': {'axes': {'up': ['neck']}}}),
            r"part \"head\": up: \['neck'\], expected two joints",
        ),
    ],
)
def test_a_file_that_describes_no_skeleton_is_named_in_one_sentence(tmp_path, change, words):
    with pytest.raises(SceneError, match=f'^file .*mine.yaml: {words}'):
        load_skeleton(changed(tmp_path, 'xsens', change))


def test_a_skeleton_that_is_not_there_is_named():
    with pytest.raises(ModelError, match='config/skeletons/kinect.yaml: not found'):
        load_skeleton('kinect')
    with pytest.raises(ModelError, match='file none.yaml: .*expected a readable file'):
        load_skeleton('none.yaml')
