# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The demo: planner and playback nodes, targets, a person at work; checked and drawn."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
import math
import os
import sys
from typing import Any

from geometry_msgs.msg import PointStamped
import numpy as np
import rclpy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rrth_planner.cli import ros_parsers
from rrth_planner.cli.program import interrupt_on_signals, INTERRUPTED
from rrth_planner.collision.motion_inspection import inspect_motion
from rrth_planner.collision.reference_checker import first_contact, least_clearance
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings, PlanSettings
from rrth_planner.io.text_file import load_yaml
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.ros.client.planner_client import DemoClient, DemoError
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import configuration_from_msg
from rrth_planner.ros.messages.message_file import message_from_file
from rrth_planner.ros.middleware.child_process import ChildProcess
from rrth_planner.visualization.motion_figure import Motion, motion_figure
from visualization_msgs.msg import Marker, MarkerArray

POINTING_TOLERANCE = 1e-3
DOTS_PER_INCH = 110
# Beside these seconds of a person at work the arm points at these targets; at other times he bends
# forward so fast that his head would meet an arm that stands still.
PERSON, PERSON_TARGETS = ('--begin', '1.2', '--end', '5.2'), ('low', 'front')
# Until a new publisher is known to all nodes [s]; so many bodies come before the first request.
MATCHED, FIRST_BODIES = 1.0, 30
HEADER = (
    f'{"target":10}{"planning":>12}{"path":>11}{"duration":>11}{"clearance":>12}{"ray error":>12}'
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demo and return the exit code."""
    options = ros_parsers.demo().parse_args(arguments)
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

    domain = os.environ['ROS_DOMAIN_ID']
    print(f'Starting planner_node and playback_node (ROS_DOMAIN_ID {domain}).', flush=True)
    print('The first start compiles the planner, which may take a minute or two.', flush=True)
    with ExitStack() as stack:
        children = []
        for name, file, extra in (
            ('planner', planner_file, ['-p', f'seed:={options.seed}']),
            ('playback', resource_path('config/playback.yaml'), []),
        ):
            words = ['--ros-args', '--params-file', str(file), *extra]
            child = ChildProcess(f'rrth_planner.ros.{name}_node', words, partial(_show, name))
            children.append(stack.enter_context(child))

        def check() -> None:
            for child in children:
                child.check()

        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        client = DemoClient(arm, options.timeout, check)
        stack.callback(client.destroy_node)
        client.wait_for_nodes()
        client.publish(body)
        lines, figure = _visit(client, settings, frame, body, targets)
        figure.savefig(options.output, dpi=DOTS_PER_INCH)
        print('The wearer is now a person at work, as he was recorded.', flush=True)
        child = ChildProcess('rrth_planner.cli.wearer', PERSON, partial(_show, 'wearer'))
        children.append(stack.enter_context(child))
        beside = _beside_a_person(client, settings, frame, body)
    print('\n' + '\n'.join([HEADER, *lines, *beside]))
    print(f'\nEvery motion passed an independent collision check. Picture: {options.output}')


def _visit(
    client: DemoClient,
    settings: PlanSettings,
    frame: str,
    body: MarkerArray,
    targets: dict[str, PointStamped],
) -> tuple[list[str], Any]:
    """Return one table row per target, and the figure of all motions."""
    arm, limits, length = client.arm, settings.limits, settings.ray_guard_length
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
            limits,
            q_present=q_present,
            target=target,
            margin=settings.margin,
            ray_guard_length=length,
        )
        client.wait_for_arrival(trajectory)
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
    return lines, motion_figure(arm, scene, motions, limits, length)


def _checked_error(client: DemoClient, name: str, target: Array) -> float:
    """Return by how much the ray misses a target, (3,) [m], or raise DemoError."""
    error = pointing_error(client.arm, client.positions(), target)
    if not error <= POINTING_TOLERANCE:
        raise DemoError(f'target {name}: the ray misses it by {1e3 * error:.2f} mm')
    return error


def _beside_a_person(
    client: DemoClient, settings: PlanSettings, frame: str, before: MarkerArray
) -> list[str]:
    """Point beside a person at work who replaces the wearer before; return a line per target."""
    client.wait_for(
        lambda: client.count_publishers('body_boxes') > 1, 'the publisher of the person at work'
    )
    # The planner, too, is to have found it before the other body is deleted.
    client.receive_for(MATCHED)
    client.publish(_without(before))
    client.see_bodies()
    client.wait_for(lambda: len(client.bodies) >= FIRST_BODIES, 'body_boxes of the person at work')
    lines = []
    for name in PERSON_TARGETS:
        message = _example(f'target_{name}', PointStamped)
        target = goal_from_msg(message, frame).target
        client.publish(message)
        client.observed = []
        n_stops = client.point(partial(_aims_at, client, target))
        clearance, n_bodies = _clearance_beside(client, settings, frame)
        error = _checked_error(client, name, target)
        lines.append(
            f'{name:10} beside a person at work: {n_stops} stops, {clearance:.3f} m clearance at '
            f'every instant from {n_bodies} bodies, and the ray misses the target by '
            f'{1e3 * error:.3f} mm'
        )
    return lines


def _aims_at(client: DemoClient, target: Array, q: Array) -> bool:
    return pointing_error(client.arm, q, target) <= POINTING_TOLERANCE


def _without(body: MarkerArray) -> MarkerArray:
    """Return the array that deletes the boxes of another one, and nothing else."""
    markers = [m for m in body.markers if m.action == Marker.ADD]
    return MarkerArray(markers=[Marker(ns=m.ns, id=m.id, action=Marker.DELETE) for m in markers])


def _clearance_beside(client: DemoClient, settings: PlanSettings, frame: str) -> tuple[float, int]:
    """
    Return the least clearance of all observed states, and from how many bodies.

    Each is checked against the boxes of the newest body that was measured until then. Raises
    DemoError where the arm or its ray was in contact with one.
    """
    arm, length = client.arm, settings.ray_guard_length
    states = client.observed[:]
    taken = np.array([seconds_of(msg.header.stamp) for msg in states])
    q = np.array([configuration_from_msg(msg, arm.joint_names) for msg in states])
    # Bodies that were measured until the last state may still be on their way.
    client.wait_for(lambda: _measured(_body(client.bodies[-1])) >= taken[-1], 'body_boxes')
    bodies = [_body(data) for data in client.bodies]
    measured = np.array([_measured(body) for body in bodies])
    newest = np.searchsorted(measured, taken, side='right') - 1
    clearances = []
    for k in np.unique(newest):
        # Whenever it was measured: it is the newest of its time.
        scene = scene_of(WearerBody().apply(bodies[max(k, 0)], math.inf, frame))
        contact = first_contact(arm, scene, q[newest == k], length, 0.0)
        if contact is not None:
            raise DemoError(f'bar {contact.bar} of the arm was in contact with {contact.box}')
        clearances.append(least_clearance(arm, scene, q[newest == k], length))
    return min(clearances), len(clearances)


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
