# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the simulation."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from rclpy.node import Node
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.scene import Scene
from rrth_planner.ros.interface.playback_parameters import (
    EACH,
    FOLDED,
    initial_positions,
    of_each_joint,
)
from rrth_planner.ros.interface.tracker_parameters import HAND_SIZE
from rrth_planner.ros.middleware.parameter_declaration import ARM, declare, reject_unknown, Setting
from rrth_planner.simulation.mechanics import Mechanics
from rrth_planner.simulation.moving_body import MovingBody, recorded_body, scene_at, standing_body
from rrth_planner.simulation.servo import servo_for_lag
from rrth_planner.simulation.simulated_arm import Imperfections, SimulatedArm
from rrth_planner.simulation.trajectory_controller import (
    ControllerRules,
    ControllerVersion,
    DEFAULT_RULES,
    Tolerances,
)
from rrth_planner.simulation.urdf_inertia import urdf_inertias
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import excerpt, posture_at, RecordedPerson
from rrth_planner.wearer.skeleton import Skeleton, STATURES

NOBODY, STANDING, RECORDED = 'none', 'standing', 'recorded'
*_FIRST, _LAST = (version.value for version in ControllerVersion)
VERSIONS = f'{", ".join(_FIRST)} or {_LAST}'


_fixed = partial(Setting, is_read_only=True)
SETTINGS = (
    ARM,
    _fixed('base_frame', 'torso', 'frame id', 'frame of the boxes of the wearer'),
    _fixed('rate', 100.0, 'Hz', 'joint states per second, rounded to whole steps', 1.0, 500.0),
    _fixed('initial_positions', FOLDED, 'rad', 'where each joint is at the start', -1e4, 1e4),
    _fixed(
        'urdf', '', 'path of a URDF', 'masses and inertias of the links, in place of link_mass'
    ),
    _fixed('link_mass', [1.0], 'kg', f'of the links up to the next joint; {EACH}', 1e-3, 1e3),
    _fixed('payload', 0.2, 'kg', 'at the origin of the tool', 0.0, 1e3),
    _fixed('max_effort', [20.0], 'N m or N', f'of each motor; {EACH}', 1e-3, 1e5),
    _fixed('friction', [0.1], 'N m or N', f'dry friction; {EACH}', 0.0, 1e4),
    _fixed('damping', [0.5], 'N m s/rad', f'viscous friction; {EACH}', 0.0, 1e4),
    _fixed('armature', [0.1], 'kg m^2', f'of the rotor behind its gear; {EACH}', 0.0, 1e3),
    _fixed('max_velocity', [1.5], 'rad/s', f'speed for which `lag` holds; {EACH}', 1e-3, 1e6),
    _fixed('lag', 0.01, 'm', 'lag of the tool behind its motion at top speed', 1e-4, 1.0),
    _fixed('bandwidth', 60.0, 'rad/s', 'greatest bandwidth of a servo', 1.0, 200.0),
    _fixed('gravity_compensation', 1.0, '-', 'share of the weight compensated', 0.0, 1.0),
    _fixed('encoder_noise', 5e-6, 'rad', 'standard deviation of a measured position', 0.0, 0.1),
    _fixed('command_delay', 0.002, 's', 'from the controller to the servo', 0.0, 1.0),
    _fixed('seed', 0, '-', 'of the noise', 0, 2**31 - 1),
    _fixed(
        'controller_version',
        DEFAULT_RULES.version.value,
        '-',
        f'how a motion replaces another one: {VERSIONS}',
    ),
    _fixed(
        'interpolate_from_desired_state',
        True,
        '-',
        'a motion replaces another one from what is commanded, not from what is measured',
    ),
    _fixed('path_tolerance', [0.0], 'rad', f'while it moves; 0: none; {EACH}', 0.0, 1e4),
    _fixed('goal_tolerance', [0.0], 'rad', f'at the end; 0: none; {EACH}', 0.0, 1e4),
    _fixed('goal_time', 0.0, 's', 'after which goal_tolerance holds; 0: never', 0.0, 1e3),
    _fixed('wearer', NOBODY, '-', f'{NOBODY}, {STANDING} or {RECORDED}: who is in the scene'),
    _fixed(
        'wearer_file',
        '',
        'path of a file',
        'boxes of one who stands, or a recording; empty: the packaged one',
    ),
    _fixed('skeleton', 'cmu_bvh', 'name or path', 'what makes boxes of a recording'),
    _fixed('stature', list(STATURES), 'm', 'of the smallest and the largest one', 0.5, 2.8),
    HAND_SIZE,
    _fixed(
        'wearer_unit',
        '',
        'm, cm, mm, inch, foot or how long it is [m]',
        'of the lengths of a recording; empty: what the file says, or an adult measures',
    ),
    _fixed('wearer_begin', 0.0, 's', 'where a recording begins', 0.0, 1e6),
    _fixed('wearer_end', 0.0, 's', 'where it ends; 0: at its end', 0.0, 1e6),
    _fixed('body_rate', 30.0, 'Hz', 'bodies published per second; 0: none', 0.0, 500.0),
)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedWearer:
    """Who is in the scene, and of what his boxes are published."""

    body: MovingBody
    person: RecordedPerson | None = None
    skeleton: Skeleton | None = None

    def scene_at(self, time: float) -> Scene:
        """Return his boxes at a time [s], as a tracker would have them."""
        if self.person is None or self.skeleton is None:
            return scene_at(self.body, time)
        return body_boxes(self.skeleton, posture_at(self.person, time))[0]


def declare_simulation_parameters(node: Node) -> ArmModel:
    """
    Declare all parameters on a node and return its arm.

    Raises
    ------
    RrthError
        A value that the node was started with is rejected, or describes no arm.

    """
    reject_unknown(node, SETTINGS)
    declare(node, SETTINGS)
    return load_arm(node.get_parameter(ARM.name).value)


def simulated_wearer(node: Node) -> SimulatedWearer | None:
    """Return who the parameters of a node put in the scene, None: nobody; or raise RrthError."""
    value = {setting.name: node.get_parameter(setting.name).value for setting in SETTINGS}
    kind, file = value['wearer'], value['wearer_file'] or None
    if kind == NOBODY:
        return None
    if kind == STANDING:
        return SimulatedWearer(standing_body(load_body(file)))
    if kind != RECORDED:
        raise OptionsError(f'wearer: "{kind}", expected {NOBODY}, {STANDING} or {RECORDED}')
    say = node.get_logger().info
    person = excerpt(
        load_person(file, unit=value['wearer_unit'] or None, say=say),
        value['wearer_begin'],
        value['wearer_end'] or None,
    )
    skeleton = load_skeleton(value['skeleton'], value['stature'], value['hand_size'])
    return SimulatedWearer(recorded_body(person, skeleton), person, skeleton)


def simulated_arm(
    node: Node, arm: ArmModel, wearer: SimulatedWearer | None, time: float
) -> SimulatedArm:
    """Return the arm that the parameters of a node describe at a time [s], or raise RrthError."""
    value = {setting.name: node.get_parameter(setting.name).value for setting in SETTINGS}
    each = partial(of_each_joint, node, arm)
    names = ('link_mass', 'max_effort', 'friction', 'damping', 'armature')
    mechanics = Mechanics(
        **{name: each(name) for name in names},
        payload=value['payload'],
        inertias=urdf_inertias(value['urdf'], arm) if value['urdf'] else (),
    )
    servo = servo_for_lag(
        arm,
        mechanics,
        each('max_velocity'),
        lag=value['lag'],
        bandwidth=value['bandwidth'],
        delay=value['command_delay'],
        gravity_compensation=value['gravity_compensation'],
    )
    return SimulatedArm(
        arm,
        mechanics,
        servo,
        ControllerRules(
            version=_version(value['controller_version']),
            is_from_desired=value['interpolate_from_desired_state'],
            tolerances=Tolerances(
                path=each('path_tolerance'),
                goal=each('goal_tolerance'),
                goal_time=value['goal_time'],
            ),
        ),
        q=np.array(initial_positions(node, arm)),
        body=None if wearer is None else wearer.body,
        body_begin=time,
        imperfections=Imperfections(
            encoder_noise=value['encoder_noise'],
            command_delay=value['command_delay'],
            seed=value['seed'],
        ),
        time=time,
    )


def _version(name: str) -> ControllerVersion:
    """Return a version of the controller by its name, or raise OptionsError."""
    try:
        return ControllerVersion(name)
    except ValueError:
        raise OptionsError(f'controller_version: "{name}", expected {VERSIONS}') from None
