# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of the planner: fields of the core's options as ROS parameters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.logging import get_logging_directory
from rclpy.node import Node
from rclpy.parameter import Parameter
from rrth_planner.collision.distance_library import LIBRARIES, require_library
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.settings import (
    HIGHEST_LIMIT,
    LOWEST_LIMIT,
    PlanSettings,
    required_clearance,
    settings_from_values,
)
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import frozen_array
from rrth_planner.model.body_reach import BODY_REACH, lines_of_text, lines_shown
from rrth_planner.model.errors import ModelError, OptionsError, RrthError, shown
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.separation import BODY_SPEEDS, Separation, SeparationRules
from rrth_planner.model.trajectory import MotionLimits, REST_SPEED
from rrth_planner.planning.options import ALGORITHMS
from rrth_planner.ros.messages.body_source import BodySource
from rrth_planner.ros.middleware.parameter_declaration import ARM, declare, reject_unknown, Setting

T = TypeVar('T')
# The options of all algorithms by name; the same name means the same in each.
OPTIONS = {f.name: f for kind in ALGORITHMS.values() for f in fields(kind)}
STOP_LIMITS = {'stop_acceleration': 'rad/s^2', 'stop_jerk': 'rad/s^3'}
LONGEST_TIMEOUT, LONGEST_LATENCY, LONGEST_PATIENCE = 86400.0, 10.0, 600.0
# A timeout that is not given: with separation these [s], else none.
NOT_GIVEN = -1.0
TIMEOUTS = {'body_timeout': 0.2, 'joint_timeout': 0.1}
# Whether a motion that stopped goes on by itself, or after `~/reset`.
AUTO, MANUAL = 'auto', 'manual'
# Whether there is separation always, never, or (auto) unless the body stands still.
ALWAYS, NEVER = 'true', 'false'
# Where an arm rests is a mean: 1 mrad of noise at 50 Hz makes 0.35 mrad between two of these. What
# a controller makes of a start so far from the arm is a step [rad].
START_TOLERANCE = 2e-3

RULES = SeparationRules()
SPEEDS = [f'{words}: {speed:g}' for words, speed in BODY_SPEEDS]
REACH = [f'{words}: {lines_shown(lines)}' for words, lines in BODY_REACH]


def declared(dof: int) -> tuple[Setting, ...]:
    """Return all parameters but `arm`, for an arm of so many joints."""
    each = f'of each of the {dof} joints, or one value for all'
    limit = (LOWEST_LIMIT, HIGHEST_LIMIT)
    timeout, given_timeout = (0.0, LONGEST_TIMEOUT), (NOT_GIVEN, LONGEST_TIMEOUT)
    by_default = '0: never; -1: {:g} with separation, else never'
    ray = 'length of the pointing ray kept clear in motion'
    reserve = 'clearance kept beyond the margin where there is room'
    escape = 'greatest depth of a bar in a box, margin included, to escape from; 0: none'
    latency = 'age at reception of a body without stamp'
    lost = 'time that a lost part of the body stays where it was before the arm stops'
    allowed = 'parts of the arm that may meet a box or another part, beside those of its file'
    second = 'library behind the second check of every motion'
    again = (
        'so long after a stop a motion to the same goal is tried while inputs are missing or the '
        'wearer is in the way'
    )
    separate = (
        'publish only motions that are proven clear of a wearer who moves; auto: unless his body '
        'stands still, as one that was sent once'
    )
    meeting = 'greatest speed of a part of the arm that may meet the wearer'
    reaching = (
        'how far parts of the body get within t seconds, by whole words of their texts: the least '
        'of the lines; default: not with body_speeds of your own'
    )
    moving = (
        'greatest speeds of parts of the body by whole words of their texts, 0 by the whole text; '
        'the greatest of those that fit'
    )
    late = 'greatest delay with which the controller executes a motion'
    rest = 'greatest speed of a joint at rest, by the mean of up to 0.3 s'
    start = 'greatest distance of a joint from where its motion begins'
    resuming = 'whether a motion that stopped for the wearer goes on by itself, or after ~/reset'
    folder = 'folder of incident files; empty: rrth_planner/ of the ROS logs'
    return (
        Setting('base_frame', 'torso', 'frame id', 'frame of the wearer', is_read_only=True),
        Setting('algorithm', 'rrt_h', ' or '.join(ALGORITHMS), 'planning algorithm'),
        Setting('seed', -1, '-', 'random seed; -1: a new one each time', -1, 2**31 - 1),
        Setting('margin', 0.02, 'm', 'clearance kept from every box', 0.0, 1.0),
        Setting('ray_guard_length', 1.0, 'm', ray, 0.0, 100.0),
        Setting('reserve', 0.05, 'm', reserve, 0.0, 1.0),
        Setting('escape_depth', 0.05, 'm', escape, 0.0, 1.0),
        Setting('second_checker', 'fcl', ' or '.join(LIBRARIES), second),
        Setting('max_velocity', [1.5] * dof, 'rad/s', f'greatest velocity {each}', *limit),
        Setting(
            'max_acceleration', [4.0] * dof, 'rad/s^2', f'greatest acceleration {each}', *limit
        ),
        Setting('max_jerk', [40.0] * dof, 'rad/s^3', f'greatest jerk {each}', *limit),
        *(
            Setting(name, [0.0], unit, f'of fail-safe stops, {each}; 0: as for motions')
            for name, unit in STOP_LIMITS.items()
        ),
        Setting(
            'body_timeout',
            NOT_GIVEN,
            's',
            f'an older body is rejected; {by_default.format(TIMEOUTS["body_timeout"])}',
            *given_timeout,
        ),
        Setting('body_latency', 0.03, 's', latency, 0.0, LONGEST_LATENCY, is_read_only=True),
        Setting('keep_lost', 2.0, 's', lost, *timeout),
        Setting('required_boxes', [''], 'names', 'a body without one of these is rejected'),
        Setting('allowed', [''], 'part: box', allowed),
        Setting('incident_folder', '', 'path', folder),
        Setting('replan', True, '-', 'plan again after a fail-safe stop'),
        Setting('patience', 5.0, 's', again, 0.0, LONGEST_PATIENCE),
        Setting(
            'joint_timeout',
            NOT_GIVEN,
            's',
            f'older joint positions are rejected; {by_default.format(TIMEOUTS["joint_timeout"])}',
            *given_timeout,
        ),
        Setting(
            'separation',
            AUTO,
            f'{AUTO}, {ALWAYS} or {NEVER}',
            separate,
            is_read_only=True,
            is_dynamic=True,
        ),
        Setting('contact_speed', RULES.contact_speed, 'm/s', meeting, 0.0, 10.0),
        Setting('body_reach', REACH, 'words: m + m/s t', reaching),
        Setting('body_speeds', SPEEDS, 'words: m/s', moving),
        Setting('body_error', RULES.body_error, 'm', 'greatest error of a box', 0.0, 1.0),
        Setting('controller_delay', RULES.controller_delay, 's', late, 0.0, 1.0),
        Setting('resume', AUTO, f'{AUTO} or {MANUAL}', resuming),
        Setting('rest_speed', REST_SPEED, 'rad/s', rest, 1e-4, 0.2),
        Setting('start_tolerance', START_TOLERANCE, 'rad', start, 1e-5, 0.05),
        *(Setting(f.name, f.default, **f.metadata) for f in OPTIONS.values()),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlannerParameters(PlanSettings):
    """
    All parameters as the core wants them, checked; a plan keeps the ones that it began with.

    Parameters
    ----------
    stop_limits : MotionLimits
        Of fail-safe stops.
    separates : str
        `ALWAYS`, `NEVER` or `AUTO`, as the node was started.
    execution : ExecutionRules
        How a motion that is planned with these is executed.
    body_timeout, joint_timeout : float
        [s]; 0: never.
    body_latency, keep_lost, patience : float
        [s].
    required_boxes : tuple of str
        Names of boxes, or of namespaces.
    incident_folder : str
        Empty: a folder of the ROS logs.
    rest_speed : float
        Greatest one of a joint at rest [rad/s].
    start_tolerance : float
        Greatest distance of a joint from where its motion begins [rad].

    """

    arm: ArmModel
    base_frame: str
    stop_limits: MotionLimits
    separates: str
    execution: ExecutionRules
    body_timeout: float
    joint_timeout: float
    body_latency: float
    keep_lost: float
    required_boxes: tuple[str, ...]
    replan: bool
    patience: float
    incident_folder: str
    rest_speed: float
    start_tolerance: float

    @property
    def required(self) -> RequiredClearance:
        """What stays clear of the wearer."""
        return required_clearance(self.arm, self)

    @property
    def stands_still(self) -> bool:
        """Whether motions are published as they are planned since the body stands still."""
        return self.separates == AUTO and self.execution.separation is None

    @property
    def incident_path(self) -> Path:
        """Where incidents and flight records are written, by default among the logs of ROS."""
        if self.incident_folder:
            return Path(self.incident_folder).expanduser()
        return Path(get_logging_directory()) / 'rrth_planner'


def in_effect(parameters: PlannerParameters, source: BodySource) -> PlannerParameters:
    """Return the parameters of a request, or of a check, for a body of such a source."""
    is_standing = parameters.separates == AUTO and source.stands_still
    return _beside_standing(parameters) if is_standing else parameters


# Of the same parameters it is asked with each body.
@lru_cache(maxsize=4)
def _beside_standing(parameters: PlannerParameters) -> PlannerParameters:
    """Return parameters without separation, with which a body gets never too old."""
    execution = replace(parameters.execution, separation=None)
    return replace(parameters, execution=execution, body_timeout=0.0)


def parameters_from_values(values: Mapping[str, Any], arm: ArmModel) -> PlannerParameters:
    """
    Return the parameters that values by name describe.

    Raises
    ------
    OptionsError
        The first value that is rejected: its name, what was given, what is expected, the unit.
    ModelError
        The library of the second checker is not installed.

    """
    settings = settings_from_values(values, arm.dof)
    require_library(settings.second_checker)
    if not values['base_frame']:
        raise OptionsError('base_frame: empty, expected the name of the frame of the wearer')
    own = (*('base_frame', 'body_latency', 'keep_lost', 'replan', 'incident_folder'),)
    tolerances = 'rest_speed', 'start_tolerance'
    if values['resume'] not in (AUTO, MANUAL):
        raise OptionsError(f'resume: "{values["resume"]}", expected {AUTO} or {MANUAL}')
    separates = str(values['separation']).lower()
    if separates not in (AUTO, ALWAYS, NEVER):
        raise OptionsError(
            f'separation: {shown(values["separation"])}, expected {AUTO}, {ALWAYS} or {NEVER}'
        )
    timeouts: dict[str, Any] = {
        name: values[name] if values[name] >= 0.0 else default * (separates != NEVER)
        for name, default in TIMEOUTS.items()
    }
    # ROS has no type for an empty array.
    pairs = tuple(pair for pair in values['allowed'] or () if pair)
    arm = _with_allowed(arm, pairs) if pairs else arm
    stop_limits = _stop_limits(values, settings.limits)
    rules = _separation_rules(values)
    separation = Separation(
        arm=arm,
        rules=rules,
        margin=settings.margin,
        limits=settings.limits,
        stop_limits=stop_limits,
    )
    return PlannerParameters(
        arm=arm,
        stop_limits=stop_limits,
        separates=separates,
        execution=ExecutionRules(
            None if separates == NEVER else separation,
            rules.controller_delay,
            values['resume'] == MANUAL,
        ),
        **timeouts,
        required_boxes=tuple(name for name in values['required_boxes'] or () if name),
        **{name: values[name] for name in (*own, *tolerances, 'patience')},
        **{field.name: getattr(settings, field.name) for field in fields(settings)},
    )


def _stop_limits(values: Mapping[str, Any], limits: MotionLimits) -> MotionLimits:
    """Return the limits of fail-safe stops: those of motions where they are not greater."""
    dof, given = len(limits.velocity), {}
    for name, unit in STOP_LIMITS.items():
        value = frozen_array(values[name], (None,), name, unit, OptionsError)
        is_within = (value == 0.0) | ((value >= LOWEST_LIMIT) & (value <= HIGHEST_LIMIT))
        if len(value) not in (1, dof) or not is_within.all():
            raise OptionsError(
                f'{name}: {value.tolist()}, expected {dof} values, or one for all joints, 0 or '
                f'from {LOWEST_LIMIT:g} to {HIGHEST_LIMIT:g} [{unit}]'
            )
        given[name] = value
    return MotionLimits(
        velocity=limits.velocity,
        acceleration=np.maximum(limits.acceleration, given['stop_acceleration']),
        jerk=np.maximum(limits.jerk, given['stop_jerk']),
    )


def _entries(
    name: str, entries: Sequence[str], read: Callable[[str], T], expected: str
) -> tuple[tuple[str, T], ...]:
    """Return the words of the entries of a parameter, `words: ...`, and what is read behind."""
    found = []
    for entry in entries:
        words, colon, text = entry.rpartition(':')
        try:
            if not colon:
                raise ValueError(text)
            found.append((words.strip(), read(text)))
        except ValueError:
            raise OptionsError(f'{name}: "{entry}", expected {expected}') from None
    return tuple(found)


def _separation_rules(values: Mapping[str, Any]) -> SeparationRules:
    """Return the rules that parameters describe; also where they are not used."""
    given = [entry for entry in values['body_reach'] or () if entry.strip()]
    lines = 'words of a name and lines, as "hand: 3.6 t, 0.21 + 1.45 t" [m, m/s]'
    reach = _entries('body_reach', given, lines_of_text, lines)
    speed = 'words of a name and a speed, as "upper arm: 1.6" [m/s]'
    speeds = _entries('body_speeds', values['body_speeds'] or (), float, speed)
    return SeparationRules(
        contact_speed=values['contact_speed'],
        body_speeds=speeds,
        body_reach=None if list(values['body_reach'] or ()) == REACH else reach,
        body_error=values['body_error'],
        controller_delay=values['controller_delay'],
    )


# What is derived of an arm is kept for it.
@lru_cache(maxsize=4)
def _with_allowed(arm: ArmModel, pairs: tuple[str, ...]) -> ArmModel:
    """Return an arm of which some more pairs, "part: box" each, may meet."""
    found = []
    for pair in pairs:
        part, _, other = (word.strip() for word in pair.partition(':'))
        if not part or not other:
            raise OptionsError(
                f'allowed: "{pair}", expected a part of the arm and a box or part, as '
                '"shoulder: torso"'
            )
        found.append((part, other))
    try:
        return replace(arm, allowed=(*arm.allowed, *found))
    except ModelError as problem:
        raise OptionsError(str(problem)) from problem


def declare_parameters(
    node: Node, on_change: Callable[[PlannerParameters], None] | None = None
) -> PlannerParameters:
    """
    Declare all parameters on a node, and let it reject bad values from now on.

    Parameters
    ----------
    on_change : callable, optional
        Called with all of them after each change.

    Raises
    ------
    RrthError
        A value that the node was started with is rejected, or describes no arm.

    """
    declare(node, (ARM,))
    arm = load_arm(node.get_parameter(ARM.name).value)
    reject_unknown(node, (ARM, *declared(arm.dof)))
    declare(node, declared(arm.dof))

    def reject_bad(changes: Sequence[Parameter]) -> SetParametersResult:
        try:
            current_parameters(node, arm, changes)
        except RrthError as problem:
            return SetParametersResult(successful=False, reason=str(problem))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(reject_bad)
    if on_change is not None:
        # Of the arm of the file: pairs that were `allowed` before may not meet any more.
        node.add_post_set_parameters_callback(lambda _: on_change(current_parameters(node, arm)))
    return current_parameters(node, arm)


def current_parameters(
    node: Node, arm: ArmModel, changes: Sequence[Parameter] = ()
) -> PlannerParameters:
    """Return what the parameters of a node are now, or would be after changes."""
    values = {s.name: node.get_parameter(s.name).value for s in declared(arm.dof)}
    return parameters_from_values(values | {change.name: change.value for change in changes}, arm)
