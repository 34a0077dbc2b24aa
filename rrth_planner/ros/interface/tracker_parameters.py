# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node that makes boxes of a tracked skeleton."""

from dataclasses import dataclass
from functools import partial

from rclpy.node import Node
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import OptionsError, shown
from rrth_planner.ros.messages.wearer_choice import NEAREST, ONLY
from rrth_planner.ros.middleware.parameter_declaration import declare, reject_unknown, Setting
from rrth_planner.wearer.hands import LARGEST
from rrth_planner.wearer.skeleton import Skeleton, STATURES

# What a tracker publishes, and which of these have numbers in place of names.
INPUTS = ('markers', 'poses', 'bodies', 'joint_states', 'tf', 'zed', 'rigid_bodies')
NUMBERED = ('markers', 'poses', 'zed')
# Numbers of persons are at most this.
MOST_PERSON = 10**7
# The arm is no further from a tracker [m].
FARTHEST_ARM = 1e3
# What stands for the name of a rigid body in the name of its topic.
NAME = '{name}'

# None changes while the node runs.
_fixed = partial(Setting, is_read_only=True)
HAND_SIZE = _fixed(
    'hand_size',
    0.0,
    'm',
    'edge of the boxes of hands without finger points; 0: as in the skeleton',
    0.0,
    LARGEST,
)
SETTINGS = (
    _fixed('skeleton', 'azure_kinect', 'name or path', 'of config/skeletons, or a .yaml file'),
    _fixed('input', 'markers', ' or '.join(INPUTS), 'what the tracker publishes'),
    _fixed(
        'person',
        ONLY,
        f'number or {NEAREST}',
        'the wearer among several; -1: the only one; nearest: who is nearest to the arm at first',
        is_dynamic=True,
    ),
    _fixed(
        'arm_position',
        [0.0, 0.0, 0.0],
        'm',
        'base of the arm in the frame of the tracker, for `person: nearest`',
    ),
    _fixed(
        'min_confidence',
        0.0,
        '-',
        'a point (zed: a person) with less confidence is lost',
        0.0,
        1.0,
    ),
    _fixed('name_prefix', '', 'name', 'stands before each name of the skeleton, as `Anna_`'),
    _fixed('pose_topic', f'{NAME}/pose', 'name', 'topic of each rigid body; {name} is its name'),
    _fixed('rate', 120.0, 'Hz', 'how often TF is looked up', 1.0, 1000.0),
    _fixed('base_frame', 'torso', 'frame id', 'frame of the boxes'),
    _fixed('lifetime', 0.2, 's', 'a part that is not seen for so long is lost', 0.001, 60.0),
    _fixed('stature', list(STATURES), 'm', 'of the smallest and the largest wearer', 0.5, 2.8),
    HAND_SIZE,
    _fixed('max_jump', 0.3, 'm', 'a point that moves further is held back', 0.01, 100.0),
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TrackerParameters:
    """All parameters, checked: as `SETTINGS`, and the skeleton read."""

    skeleton: Skeleton
    input: str
    person: int | str
    arm_position: Array
    min_confidence: float
    name_prefix: str
    pose_topic: str
    rate: float
    base_frame: str
    lifetime: float
    max_jump: float


def declare_tracker_parameters(node: Node) -> TrackerParameters:
    """
    Declare all parameters on a node, none of which changes while it runs, and return them.

    Raises
    ------
    RrthError
        A value that is rejected, or a skeleton that cannot be read or does not fit the input.

    """
    reject_unknown(node, SETTINGS)
    declare(node, SETTINGS)
    values = {setting.name: node.get_parameter(setting.name).value for setting in SETTINGS}
    if values['input'] not in INPUTS:
        raise OptionsError(f'input: "{values["input"]}", expected one of {", ".join(INPUTS)}')
    if not values['base_frame']:
        raise OptionsError('base_frame: empty, expected the name of the frame of the boxes')
    if NAME not in values['pose_topic']:
        raise OptionsError(f'pose_topic: "{values["pose_topic"]}", expected a name with {NAME}')
    skeleton = load_skeleton(values['skeleton'], values.pop('stature'), values.pop('hand_size'))
    person = values['person']
    is_number = type(person) is int and ONLY <= person <= MOST_PERSON
    if not is_number and person != NEAREST:
        raise OptionsError(
            f'person: {shown(person)}, expected a whole number from {ONLY} to {MOST_PERSON}, or '
            f'{NEAREST}'
        )
    place = frozen_array(
        list(values['arm_position'] or ()), (3,), 'arm_position', 'm', OptionsError, FARTHEST_ARM
    )
    if values['input'] in NUMBERED and not skeleton.names_by_id:
        raise OptionsError(
            f'input: {values["input"]}, which have no names; expected a skeleton with '
            f'names_by_id, which "{values["skeleton"]}" has not'
        )
    return TrackerParameters(**{**values, 'skeleton': skeleton, 'arm_position': place})
