# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The demo: planner and arm, played or simulated, a person at work; checked and drawn."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, ExitStack
from dataclasses import replace
from functools import partial
from itertools import pairwise
import math
import os
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
import numpy as np
import rclpy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rrth_planner.cli.parsers.demo import parser
from rrth_planner.cli.program import interrupt_on_signals, INTERRUPTED
from rrth_planner.collision.motion_inspection import inspect_motion
from rrth_planner.collision.separation_inspection import (
    inspect_separation,
    SeparationInspection,
    Sights,
)
from rrth_planner.execution.command import begin_of
from rrth_planner.execution.separation_status import SeparationState
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.extras import require
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings, PlanSettings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.curves import part
from rrth_planner.model.errors import RrthError
from rrth_planner.model.separation import reach_of, SeenBody, Separation
from rrth_planner.model.trajectory import REST_SPEED
from rrth_planner.ros.client.planner_client import (
    DemoClient,
    DemoError,
    parameters_of_planner,
    STILL,
)
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.contacts import GREATEST_FORCE
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import joint_reading
from rrth_planner.ros.messages.message_file import message_from_file
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from rrth_planner.visualization.motion_figure import Motion, motion_figure
from rrth_planner.visualization.separation_view import Instant, reserves, Span
from visualization_msgs.msg import MarkerArray

POINTING_TOLERANCE = 1e-3
DOTS_PER_INCH = 110
# Beside these seconds of a person at work the arm points at these targets; at other times he bends
# forward so fast that his head would meet an arm that stands still. A busy machine, too, has time
# for 30 bodies per second.
PERSON = ('--begin', '1.2', '--end', '5.2', '--fps', '30')
PERSON_TARGETS = ('low', 'front')
# The same of the simulation.
SIMULATED_PERSON = (
    *('-p', 'wearer:=recorded', '-p', 'body_rate:=30.0'),
    *('-p', 'wearer_begin:=1.2', '-p', 'wearer_end:=5.2'),
)
SIMULATION = 'arm_simulation'
# The servos of config/simulation.yaml are at most so late: 11.4 ms, a step of 2 ms, and what comes
# late to them [s].
SERVO_DELAY = 0.02
# They come to their goals so long after they are slow [s].
SETTLING_TIME = 0.5
HEADER = (
    f'{"target":10}{"planning":>12}{"path":>11}{"duration":>11}{"clearance":>12}{"ray error":>12}'
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo and return the exit code."""
    options = parser().parse_args(arguments)
    interrupt_on_signals()
    try:
        _run(options)
    except (RrthError, OSError) as problem:
        print(f'demo failed: {" ".join(str(problem).split())}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('demo interrupted', file=sys.stderr)
        return INTERRUPTED
    return 0


def _run(options: argparse.Namespace) -> None:
    if not options.output.absolute().parent.is_dir():
        raise DemoError(f'--output {options.output}: its folder does not exist')
    # Isolated from other robots and other demos.
    os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    planner_file = resource_path('config/planner.yaml')
    parameters = load_yaml(planner_file)['/**']['ros__parameters']
    arm, frame = load_arm(parameters.get('arm')), parameters['base_frame']
    settings = load_settings(arm.dof, planner_file)
    body = _example(options.body, MarkerArray)
    targets = {name: _example(f'target_{name}', PointStamped) for name in options.targets}

    if options.physics:
        require('simulation', 'mujoco')
    domain = os.environ['ROS_DOMAIN_ID']
    node = 'simulation_node' if options.physics else 'playback_node'
    print(f'Starting planner_node and {node} (ROS_DOMAIN_ID {domain}).', flush=True)
    print('The first start compiles the planner, which may take a minute or two.', flush=True)
    children: list[ChildProcess] = []

    @contextmanager
    def started(name: str, module: str, words: Sequence[str]) -> Iterator[None]:
        with ChildProcess(f'rrth_planner.{module}', words, partial(_show, name)) as child:
            children.append(child)
            try:
                yield
            finally:
                children.remove(child)

    def planner(separation: str) -> AbstractContextManager[None]:
        own = ['-p', f'seed:={options.seed}', '-p', f'separation:={separation}']
        if options.physics:
            own += ['-p', f'controller_delay:={SERVO_DELAY}']
        words = ['--ros-args', '--params-file', str(planner_file), *own]
        return started('planner', 'ros.planner_node', words)

    def arm_node(*own: str) -> AbstractContextManager[None]:
        kind = 'simulation' if options.physics else 'playback'
        file = str(resource_path(f'config/{kind}.yaml'))
        return started(kind, f'ros.{kind}_node', ['--ros-args', '--params-file', file, *own])

    def check() -> None:
        for child in children:
            child.check()

    with ExitStack() as stack:
        # The body is published once: beside one that stands still nobody has to keep watching.
        first = stack.enter_context(ExitStack())
        (first if options.physics else stack).enter_context(arm_node())
        first.enter_context(planner('false'))
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        rest = (REST_SPEED, SETTLING_TIME) if options.physics else (STILL, 0.0)
        client = DemoClient(arm, options.timeout, check, *rest)
        stack.callback(client.destroy_node)
        client.wait_for_nodes()
        client.publish(body)
        lines, motions = _visit(client, settings, frame, body, targets)
        first.close()
        client.wait_for_end_of_planner()
        client.withdraw_body()
        print('The wearer is now a recorded person at work.', flush=True)
        contacts: list[DiagnosticArray] = []
        if options.physics:
            # The same person: in the scene of the physics, which publishes him as well.
            client.create_subscription(
                DiagnosticArray, f'{SIMULATION}/contacts', contacts.append, 100
            )
            stack.enter_context(arm_node(*SIMULATED_PERSON))
        stack.enter_context(planner('true'))
        if not options.physics:
            stack.enter_context(started('wearer', 'cli.wearer', PERSON))
        client.wait_for_nodes()
        separation, error, wanted = _beside_a_person(client, frame)
    # Once nobody else needs the processors.
    beside = _sentences(client, separation, frame, error)
    if options.physics:
        beside.append(_sentence_of_contacts(contacts))
    scene = scene_of(WearerBody().apply(body, math.inf, frame))
    figure = motion_figure(
        arm,
        scene,
        motions,
        settings.limits,
        settings.ray_guard_length,
        _seen_beside(client, separation, frame, wanted),
    )
    figure.savefig(options.output, dpi=DOTS_PER_INCH)
    print('\n' + '\n'.join([HEADER, *lines, *beside]))
    print(f'\nEvery motion passed an independent collision check. Picture: {options.output}')


def _visit(
    client: DemoClient,
    settings: PlanSettings,
    frame: str,
    body: MarkerArray,
    targets: dict[str, PointStamped],
) -> tuple[list[str], list[Motion]]:
    """Return one table row per target, and the motions."""
    arm = client.arm
    scene = scene_of(WearerBody().apply(body, math.inf, frame))
    motions, lines = [], []
    for name, message in targets.items():
        target = goal_from_msg(message, frame).target
        client.publish(message)
        q_present = client.positions()
        trajectory, planning_time = client.ask_for_motion()
        found = inspect_motion(
            arm,
            scene,
            trajectory,
            settings.limits,
            q_present=q_present,
            target=target,
            margin=settings.margin,
            ray_guard_length=settings.ray_guard_length,
        )
        client.wait_for_arrival(trajectory, partial(_aims_at, client, target))
        error = _checked_error(client, name, target)
        lines.append(
            f'{name:10}{planning_time:9.1f} ms{found.length:7.2f} rad{found.duration:9.2f} s'
            f'{found.clearance:10.3f} m{1e3 * error:9.3f} mm'
        )
        motions.append(
            Motion(
                label=name,
                trajectory=trajectory,
                target=target,
                caption=f'{found.length:.2f} rad in {found.duration:.2f} s, '
                f'{1e3 * found.clearance:.0f} mm clearance, planned in {planning_time:.0f} ms',
            )
        )
    return lines, motions


def _checked_error(client: DemoClient, name: str, target: Array) -> float:
    """Return by how much the ray misses a target, (3,) [m], or raise DemoError."""
    error = pointing_error(client.arm, client.positions(), target)
    if not error <= POINTING_TOLERANCE:
        raise DemoError(f'target {name}: the ray misses it by {1e3 * error:.2f} mm')
    return error


def _beside_a_person(
    client: DemoClient, frame: str
) -> tuple[Separation, float, list[tuple[float, Array]]]:
    """
    Point beside a person at work, and keep what is published meanwhile.

    Return what the planner assumes, by how much the ray misses the targets at most [m], and each
    target, (3,) [m], with when it was wanted [s].
    """
    separation = parameters_of_planner(client).execution.separation
    if separation is None:
        raise DemoError('separation: false, expected a planner with separation')
    client.see_separation()
    client.wait_for(lambda: bool(client.bodies), 'body_boxes of the person at work')
    client.wait_for(lambda: bool(client.statuses), 'rrth_planner/state')
    client.observed, errors, wanted = [], [], []
    for name in PERSON_TARGETS:
        message = _example(f'target_{name}', PointStamped)
        target = goal_from_msg(message, frame).target
        now = seconds_of(client.observed[-1].header.stamp) if client.observed else -math.inf
        wanted.append((now, target))
        client.publish(message)
        client.point(partial(_aims_at, client, target))
        errors.append(_checked_error(client, name, target))
    # Bodies that were measured until the last state may still be on their way.
    last = seconds_of(client.observed[-1].header.stamp)
    client.wait_for(lambda: _measured(_body(client.bodies[-1])) >= last, 'body_boxes')
    return separation, max(errors), wanted


def _sentences(client: DemoClient, separation: Separation, frame: str, error: float) -> list[str]:
    """Return what was seen beside a person; raise RrthError where the arm was not separate."""
    found, rules = _inspected(client, separation, frame), separation.rules
    n_stops = sum(
        status.state is SeparationState.PROTECTIVE_STOP is not before.state
        for (_, before), (_, status) in pairwise(client.statuses)
    )
    n_targets, share = len(PERSON_TARGETS), 100.0 * found.n_further / found.n_frames
    least = min(span.rate for span in _spans(client))
    return [
        f'Beside a person at work, with separation: {n_targets} of {n_targets} targets reached '
        f'(the ray misses them by at most {1e3 * error:.3f} mm) with {found.n_commitments} '
        f'commitments, protective stops: {n_stops}, least rate {least:.2f}. '
        f'In {share:.1f} % of {found.n_frames} frames a part of the body had got further than '
        'assumed.',
        'Each commitment ends at rest and is clear of wherever the person may be (exceptions: '
        f'{found.n_excused} near parts that got further, {found.n_unknown} where bodies are '
        f'missing). At {found.n_instants} instants no part of the arm above '
        f'{rules.contact_speed:g} m/s was in contact with the person (exceptions: '
        f'{found.n_contacts} with parts that got further).',
    ]


def _sentence_of_contacts(messages: Sequence[DiagnosticArray]) -> str:
    """Return what the physics had of contacts; raise DemoError where it published nothing."""
    if not messages:
        raise DemoError(f'{SIMULATION}/contacts: none came, expected one a second')
    found: dict[str, float] = {}
    for status in (status for msg in messages for status in msg.status):
        (force,) = (float(pair.value) for pair in status.values if pair.key == GREATEST_FORCE)
        found[status.name] = max(found.get(status.name, 0.0), force)
    if not found:
        return 'The simulation had no contact between arm and person.'
    pairs = ', '.join(f'{name} ({force:.0f} N)' for name, force in found.items())
    return f'The simulation had contacts between arm and person, greatest forces: {pairs}.'


def _spans(client: DemoClient) -> list[Span]:
    """Return how fast the arm was from one status to the next, from the first state on."""
    begin = seconds_of(client.observed[0].header.stamp)
    last = seconds_of(client.observed[-1].header.stamp) - begin
    times = [min(max(time - begin, 0.0), last) for time, _ in client.statuses] + [last]
    return [
        Span(begin=since, end=until, rate=status.rate, state=status.state, part=status.box)
        for (since, until), (_, status) in zip(pairwise(times), client.statuses, strict=True)
        if until > since
    ]


def _seen_beside(
    client: DemoClient,
    separation: Separation,
    frame: str,
    wanted: Sequence[tuple[float, Array]],
) -> tuple[Instant, list[Span]]:
    """Return the arm and the person when it was slowed down most, and how fast it was when."""
    spans, arm = _spans(client), client.arm
    begin = seconds_of(client.observed[0].header.stamp)
    bodies = [_body(data) for data in client.bodies]
    measured = np.array([_measured(body) for body in bodies])
    commitments = [
        (seconds_of(msg.header.stamp), joint_trajectory_from_msg(msg, client.joint_names))
        for msg in client.commitments
    ]

    def instant_at(time: float) -> Instant:
        """Return what the arm had been given at a time after the first state [s]."""
        given = [one for one in commitments if one[0] <= begin + time] or commitments[:1]
        since, motion = given[-1]
        k = max(0, int(np.searchsorted(measured, since, 'right')) - 1)
        scene = scene_of(WearerBody().apply(bodies[k], math.inf, frame))
        ages = np.full(len(scene.boxes), max(begin + time - measured[k], 0.0))
        elapsed = min(max(begin + time - since, 0.0), motion.duration)
        return Instant(
            time=time,
            seen=SeenBody(scene, ages, reach_of(scene.names, separation.rules)),
            rules=separation.rules,
            left=part(motion, elapsed, motion.duration),
            target=[target for since, target in wanted if since <= begin + time][-1],
        )

    def named(span: Span) -> Span:
        """Say of a slowed arm which part is nearest to where it would be met, if nothing did."""
        if span.part or span.state is not SeparationState.SLOWED:
            return span
        at = instant_at(span.begin)
        left = reserves(arm, at)
        nearest = int(left.argmin())
        return replace(span, part=at.seen.scene.names[nearest] if left[nearest] < np.inf else '')

    moving = [span for span in spans if span.rate > 0.0] or spans
    slowest = min(moving, key=lambda span: span.rate)
    return instant_at(slowest.begin), [named(span) for span in spans]


def _aims_at(client: DemoClient, target: Array, q: Array) -> bool:
    return pointing_error(client.arm, q, target) <= POINTING_TOLERANCE


def _inspected(client: DemoClient, separation: Separation, frame: str) -> SeparationInspection:
    """Return what became of all that was published."""
    names = client.joint_names
    taken = np.array([seconds_of(msg.header.stamp) for msg in client.observed])
    readings = [
        joint_reading(msg, names, time, None)
        for msg, time in zip(client.observed, taken, strict=True)
    ]
    bodies = [_body(data) for data in client.bodies]
    sights = Sights(
        np.array([_measured(body) for body in bodies]),
        # Whenever it was measured: it is the newest of its time.
        tuple(scene_of(WearerBody().apply(body, math.inf, frame)) for body in bodies),
    )
    begins = [seconds_of(msg.header.stamp) for msg in client.commitments]
    before = -begin_of(0.0, separation.rules.controller_delay)
    commitments = [
        (begin + before, begin, joint_trajectory_from_msg(msg, names))
        for begin, msg in zip(begins, client.commitments, strict=True)
    ]
    return inspect_separation(
        client.arm,
        separation.rules,
        separation.margin,
        sights,
        commitments,
        taken,
        np.array([reading.positions for reading in readings]),
        np.array([reading.velocities for reading in readings]),
    )


def _body(data: bytes) -> MarkerArray:
    return deserialize_message(data, MarkerArray)


def _measured(body: MarkerArray) -> float:
    """Return when a body was measured [s]."""
    return seconds_of(body.markers[0].header.stamp)


def _show(name: str, line: str) -> None:
    print(f'  {name:9}| {line}', flush=True)


def _example(name: str, message_type: Any) -> Any:
    return message_from_file(resource_path(f'msg_examples/{name}.yaml'), message_type)


if __name__ == '__main__':
    sys.exit(main())
