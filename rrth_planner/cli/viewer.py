# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The viewer in the browser: plan by dragging the target, or show the running nodes."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from functools import partial
from io import StringIO
import os
import socket
import sys
from typing import Any
import webbrowser

from rrth_planner.cli.file_question import question_of
from rrth_planner.cli.parsers.viewer import parser
from rrth_planner.cli.program import interrupt_on_signals, say
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.extras import require, ROS
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.text_file import parse_yaml
from rrth_planner.io.urdf.placed_robot import place_robot, PlacedRobot
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.errors import OptionsError, RrthError
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.visualization.viewer.examples import example_target, start_of
from rrth_planner.visualization.viewer.screenshot import save_picture
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import posture_at, RecordedPerson
from rrth_planner.wearer.skeleton import Skeleton

ROS_ARGS = '--ros-args'
# A picture is taken after so long beside a person [s].
PICTURE_TIME = 4.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve the page until it is interrupted; return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    at = given.index(ROS_ARGS) if ROS_ARGS in given else len(given)
    options, ros_args = parser().parse_args(given[:at]), given[at:]
    interrupt_on_signals()
    try:
        if ros_args and not options.live:
            raise OptionsError(f'{ROS_ARGS}: given, expected only with --live')
        require('tools', 'viser')
        if options.live:
            _run_live(options, ros_args)
        else:
            _run_planning(options)
    except (RrthError, OSError) as problem:
        say('viewer', ' '.join(str(problem).split()))
        return 1
    except KeyboardInterrupt:
        pass
    return 0


def _run_planning(options: argparse.Namespace) -> None:
    """Serve the page that plans itself."""
    # Not for --help: loading the planner takes seconds, and compiling it, once, minutes.
    from rrth_planner.kernels.precompile import prepare_kernels

    arm, changes = load_arm(options.arm), {}
    for text in options.set:
        name, sign, value = text.partition('=')
        if not sign:
            raise OptionsError(f'--set {text}: expected NAME=VALUE, as seed=3')
        changes[name] = parse_yaml(value, f'--set {name}')
    settings = load_settings(arm.dof, options.settings, **changes)
    target = example_target('front') if options.target is None else options.target
    person, skeleton = None, None
    if options.person is None:
        scene = load_body(options.body)
    else:
        if options.body:
            raise OptionsError('--person: given with --body, expected one of them')
        person = load_person(options.person or None, unit=options.unit, say=partial(say, 'viewer'))
        skeleton = load_skeleton(options.skeleton, options.stature, options.hand_size)
        scene, _ = body_boxes(skeleton, posture_at(person, 0.0))
    q_start = start_of(arm)
    question = question_of(arm, scene, q_start, target, settings, max(0, settings.seed))
    prepare_kernels(partial(say, 'viewer'))
    from rrth_planner.pipeline.plan_motion import warm_up
    from rrth_planner.visualization.viewer.page import ViewerPage

    warm_up(question.arm, question.options)
    if person is not None and skeleton is not None:
        _run_person(options, question, person, skeleton)
        return
    with _served(options) as (server, url):
        page = ViewerPage(server, question, _robot(options, arm))
        try:
            if options.screenshot is None:
                page.run()
            else:
                page.model.wait(1, question.options.time_limit + 60.0)
                page.show_end()
                page.draw()
                save_picture(url, options.screenshot)
        finally:
            page.model.close()


def _run_person(
    options: argparse.Namespace,
    question: PlanQuestion,
    person: RecordedPerson,
    skeleton: Skeleton,
) -> None:
    """Serve the page of a recorded person."""
    from rrth_planner.visualization.viewer.person_page import PersonPage

    with _served(options) as (server, url):
        page = PersonPage(server, question, person, skeleton, _robot(options, question.arm))
        try:
            if options.screenshot is None:
                page.run()
            else:
                page.run_for(PICTURE_TIME)
                save_picture(url, options.screenshot)
        finally:
            page.model.close()


def _run_live(options: argparse.Namespace, ros_args: list[str]) -> None:
    """Serve the page that follows the nodes."""
    require('ros,tools', ROS)
    is_own = options.body or options.target or options.set or options.person is not None
    if options.screenshot or is_own:
        raise OptionsError(
            '--live: given with --screenshot, --body, --person, --target or --set, expected '
            'without: the nodes determine what is shown'
        )
    from rrth_planner.ros.client.viewer_feed import following
    from rrth_planner.visualization.viewer.live_page import LivePage

    with (
        following(options.arm, options.settings, ros_args) as feed,
        _served(options) as (server, _),
    ):
        LivePage(server, feed, _robot(options, feed.arm)).run()


def _robot(options: argparse.Namespace, arm: ArmModel) -> PlacedRobot | None:
    """Return the robot of --urdf, where the arm is."""
    return None if options.urdf is None else place_robot(options.urdf, arm)


@contextmanager
def _served(options: argparse.Namespace) -> Iterator[tuple[Any, str]]:
    """Serve an empty page while the block runs; give the server and the page's address."""
    import viser

    port = _free_port(options.host, options.port)
    # It draws a box round its address, whether verbose or not.
    with redirect_stdout(StringIO()):
        server = viser.ViserServer(host=options.host, port=port, verbose=False)
    host = 'localhost' if options.host in ('0.0.0.0', '::') else options.host
    url = f'http://{f"[{host}]" if ":" in host else host}:{server.get_port()}'
    print(f'The viewer is at {url} (Ctrl-C ends it).', flush=True)
    has_display = any(os.environ.get(name) for name in ('DISPLAY', 'WAYLAND_DISPLAY'))
    is_wanted = has_display and options.screenshot is None
    try:
        if is_wanted if options.open is None else options.open:
            webbrowser.open(url)
        yield server, url
    finally:
        with redirect_stdout(StringIO()):
            server.stop()


def _free_port(host: str, port: int) -> int:
    """Return the port, for 0 one that is free, or raise OptionsError where it is taken."""
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        families = [family for family, *_ in found]
        # A name may have addresses of both kinds, and a machine only one of them.
        family = socket.AF_INET if socket.AF_INET in families else families[0]
        with socket.create_server((host, port), family=family) as listener:
            return int(listener.getsockname()[1])
    except (OSError, OverflowError, UnicodeError) as problem:
        raise OptionsError(
            f'--host {host} --port {port}: {problem}; expected an address of this machine and a '
            'port that is free (--port 0: any that is)'
        ) from problem


if __name__ == '__main__':
    sys.exit(main())
