# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The topics, services and actions of the nodes: what each is called, its type and meaning."""

from dataclasses import dataclass
from enum import Enum
from functools import partial


class Direction(Enum):
    """What a node does with a topic, a service or an action."""

    SUBSCRIBES = 'subscribes'
    PUBLISHES = 'publishes'
    SERVES = 'serves'
    # An action, where the package of its type is installed.
    PERFORMS = 'performs'


@dataclass(frozen=True, slots=True, kw_only=True)
class Interface:
    """
    A topic, a service or an action of a node.

    Parameters
    ----------
    name : str
        Before namespace and remaps; `~` stands for the name of the node, `{name}` for the name of
        a rigid body.
    type : str
        As ROS writes it.
    meaning : str
        What a user has to know of it.
    parameter : str
        The interface exists only where this parameter has one of the values; empty: always.

    """

    direction: Direction
    name: str
    type: str
    meaning: str
    parameter: str = ''
    values: tuple[object, ...] = ()


def _interface(
    direction: Direction, name: str, kind: str, meaning: str, **only: object
) -> Interface:
    (parameter, values), *_ = [*only.items(), ('', ())]
    return Interface(
        direction=direction,
        name=name,
        type=kind,
        meaning=meaning,
        parameter=parameter,
        values=values if isinstance(values, tuple) else (values,),
    )


_subscribed = partial(_interface, Direction.SUBSCRIBES)
_published = partial(_interface, Direction.PUBLISHES)
_served = partial(_interface, Direction.SERVES)
MARKERS, MOTION = 'visualization_msgs/msg/MarkerArray', 'trajectory_msgs/msg/JointTrajectory'
JOINTS, DIAGNOSTICS = 'sensor_msgs/msg/JointState', 'diagnostic_msgs/msg/DiagnosticArray'
TRIGGER = 'std_srvs/srv/Trigger'

# By the names of the nodes.
INTERFACES = {
    'rrth_planner': (
        _subscribed(
            'body_boxes',
            MARKERS,
            'the wearer: CUBE or CUBE_LIST markers, `scale` = full size, `text` = which part; '
            'identity, ADD, DELETE, DELETEALL, lifetime nearly as in RViz. An array with one bad '
            'marker is rejected whole: the last good body stays, a running motion stops, and '
            'nothing is planned until a good one comes. Stamp each box with the time of its '
            'measurement, and give it a lifetime: a part whose lifetime runs out, or that an '
            'array with DELETEALL leaves out, is lost; it stays where it was for `keep_lost`, '
            'then the arm stops, and it is reported by name. DELETE removes a part, while a '
            'motion runs after `keep_lost`. An array without stamps, more than 1 s after the last '
            'one of its publisher, is another description: what it leaves out is removed, too',
        ),
        _subscribed(
            'target',
            'geometry_msgs/msg/PointStamped',
            'the point to point at; the last one wins',
        ),
        _subscribed(
            'joint_states', JOINTS, 'where the arm is; matched by name, other joints ignored'
        ),
        _served(
            '~/plan',
            TRIGGER,
            'plan from the present joints to the present target round the present body; publish, '
            'then answer',
        ),
        _served(
            '~/get_plan',
            'nav_msgs/srv/GetPlan',
            'the same, target in `goal.pose.position` (`start` empty); answers the tool path',
        ),
        _served('~/cancel', TRIGGER, 'ends a plan in progress'),
        _interface(
            Direction.PERFORMS,
            '~/point_head',
            'control_msgs/action/PointHead',
            'a request as a goal, which ends once the arm has arrived, and stops it where it is '
            'cancelled; where control_msgs is installed',
        ),
        _served(
            '~/reset',
            TRIGGER,
            'with `separation`: allows motions again after a FAULT, and with `resume: manual` '
            'lets a stopped one go on',
        ),
        _served('~/save', TRIGGER, 'writes the last 30 s of the monitor to a file, by its name'),
        _published(
            'joint_trajectory',
            MOTION,
            'the next stretch of the motion and a stop, or the proven rest, with every body; '
            'without `separation`, or beside a body that stands still, the whole motion, latched; '
            'positions, velocities, accelerations. It begins shortly before its publication, with '
            'the rest or the motion that is commanded then; the stamp says when. Never published '
            'on failure',
        ),
        _published(
            '~/planned_trajectory',
            MOTION,
            'latched: the whole planned motion',
            separation=('auto', True),
        ),
        _published(
            '~/state',
            'diagnostic_msgs/msg/DiagnosticStatus',
            'latched: NORMAL, SLOWED, PROTECTIVE_STOP or FAULT, with cause, rate, part of the arm '
            'and box; UNSEPARATED beside a body that stands still. WARN or ERROR also where the '
            'arm does not follow its motion, or holds its position',
            separation=('auto', True),
        ),
        _published(
            '~/ray_clear',
            'std_msgs/msg/Bool',
            '50 Hz, deadline 0.1 s, liveliness: whether the pointing ray is known to meet nobody, '
            'for tools whose beam matters; never beside a body that stands still',
            separation=('auto', True),
        ),
        _published(
            '~/answer',
            'diagnostic_msgs/msg/DiagnosticStatus',
            'each answer, before the service sends it: `message` as there, and by key `answer`, '
            'its number, with which the sentence of `~/plan` ends (`answer 12`), `code`, and of a '
            'motion the figures and `stamp`, which the header of its message has, on '
            '`joint_trajectory`, or with `separation` on `~/planned_trajectory`: seconds with '
            'nine decimals',
        ),
        _published('~/tool_path', 'nav_msgs/msg/Path', 'latched: the path of the tool'),
        _published(
            '~/markers',
            MARKERS,
            'latched: body with margin, arm at start and goal, ray, tool path',
        ),
        _published(
            '/diagnostics',
            DIAGNOSTICS,
            '1 Hz and on change: inputs, the last answer, what the monitor does, whether the arm '
            'follows; `request`: the number of the last answer with a motion, `given up`: why its '
            'goal is not pursued any more, if the arm has not arrived',
        ),
    ),
    'arm_playback': (
        _subscribed(
            'joint_trajectory',
            MOTION,
            'a motion to execute, with the quintic interpolation of a controller; it also listens '
            'to the liveliness of the planner',
        ),
        _published('joint_states', JOINTS, 'the state of the arm, at `rate`'),
        _published('~/tool_pose', 'geometry_msgs/msg/PoseStamped', 'the tool, at `rate`'),
        _served('~/stop', TRIGGER, 'brakes along the path'),
    ),
    'arm_simulation': (
        _subscribed(
            'joint_trajectory',
            MOTION,
            'a motion to execute, or to reject, as by joint_trajectory_controller',
        ),
        _published(
            'joint_states',
            JOINTS,
            'positions by the encoders, velocities as their smoothed differences, efforts of the '
            'motors, at `rate`',
        ),
        _published(
            '~/contacts',
            DIAGNOSTICS,
            'a status for each part of the arm and part of the wearer in contact: WARN while it '
            'lasts, OK when it has ended; force, speed at the first instant, depth. When one '
            'begins or ends, every 0.1 s meanwhile, and, without any, an empty one every second',
        ),
        _published(
            'body_boxes',
            MARKERS,
            'the boxes of the wearer in the scene, at `body_rate`, stamped',
            wearer=('standing', 'recorded'),
        ),
        _published(
            '/diagnostics',
            DIAGNOSTICS,
            '1 Hz: real-time factor, the greatest distance of the tool from its motion, steps '
            'with a motor at its limit, contacts',
        ),
    ),
    'body_boxes_node': (
        _subscribed('markers', MARKERS, 'a SPHERE a joint, by numbers', input='markers'),
        _subscribed(
            'poses',
            'geometry_msgs/msg/PoseArray',
            'a pose a joint, by their order',
            input='poses',
        ),
        _subscribed(
            '{name}/pose',
            'geometry_msgs/msg/PoseStamped',
            'a rigid body each, by names; `pose_topic` says how they are called',
            input='bodies',
        ),
        _subscribed('joint_states', JOINTS, 'angles of joints', input='joint_states'),
        _subscribed(
            'robot_description',
            'std_msgs/msg/String',
            'the URDF of the person (REP 155)',
            input='joint_states',
        ),
        _subscribed(
            'skeletons',
            'zed_msgs/msg/ObjectsStamped',
            'the persons whom a ZED camera sees; where zed_msgs is installed',
            input='zed',
        ),
        _subscribed(
            'rigid_bodies',
            'mocap4r2_msgs/msg/RigidBodies',
            'all rigid bodies, by their names; where mocap4r2_msgs is installed',
            input='rigid_bodies',
        ),
        _served(
            '~/reset',
            TRIGGER,
            'the next person who is seen becomes the wearer, where `person` is -1 or `nearest`',
        ),
        _published(
            'body_boxes',
            MARKERS,
            'a CUBE of each part; `ns` is the name of the part; a part of which a point is lost '
            'is left out, and without the base frame all is. Other persons are a CUBE each, '
            '`person 3`, deleted when they have left',
        ),
        _published('/diagnostics', DIAGNOSTICS, '1 Hz'),
    ),
}
