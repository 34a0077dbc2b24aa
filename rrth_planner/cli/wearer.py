# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `wearer`: a recorded person is published as a tracker would."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
import signal
import sys
import time

import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rrth_planner.cli.parsers.wearer import parser
from rrth_planner.cli.program import run, say
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.errors import OptionsError, SceneError
from rrth_planner.ros.client.person_publisher import PersonPublisher
from rrth_planner.ros.client.stand_in_publisher import DRIVERS, StandInPublisher
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import excerpt, posture_at, RecordedPerson
from rrth_planner.wearer.tracker import measurement, newest_number, publishing_time, Tracker

# A signal does not end a sleep: it is seen after this long at most [s].
LONGEST_SLEEP = 0.1
# Measurements per second of what no driver publishes [1/s].
FPS = 60.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Publish until a signal, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    options = parser().parse_args(remove_ros_args(['wearer', *given])[1:])
    return run('wearer', lambda: _publish(options, given), 1)


def _publish(options: argparse.Namespace, given: Sequence[str]) -> None:
    driver = DRIVERS.get(options.form)
    usual = driver.fps if driver else FPS
    tracker = Tracker(
        fps=usual if options.fps is None else options.fps,
        rate=options.rate,
        latency=options.latency,
        drop=options.drop,
        noise=options.noise,
        seed=options.seed,
    )
    person = load_person(options.file, unit=options.unit, say=lambda words: say('wearer', words))
    person = excerpt(person, options.begin, options.end)
    skeleton = load_skeleton(options.skeleton, options.stature, options.hand_size)
    if options.form == 'boxes' or driver:
        # A skeleton of another tracker is named at once.
        try:
            _, missing = body_boxes(skeleton, posture_at(person, 0.0))
        except SceneError as problem:
            raise OptionsError(f'--skeleton {options.skeleton}: {problem}') from problem
        if missing:
            known = {point for joint in skeleton.joints for point in joint.points}
            absent = known - set(person.names)
            say(
                'wearer',
                f'no {", ".join(missing)}: '
                + (
                    f'points that are not in the recording: {", ".join(sorted(absent))}'
                    if absent
                    else 'not seen, or not believed, in the first frame'
                ),
            )
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Only stored: an Event that is waited for would be locked against its own handler.
        signal.signal(number, lambda number, _: signals.append(number))
    with ExitStack() as stack:
        rclpy.init(args=list(given), signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        node: PersonPublisher | StandInPublisher
        if driver is None:
            node = PersonPublisher(skeleton, options.form)
        else:
            node = StandInPublisher(skeleton, posture_at(person, 0.0), options.form)
        stack.callback(node.destroy_node)
        print(
            f'publishing {person.duration:.2f} s of a person, forwards and backwards, on '
            f'{node.topic_name}; Ctrl-C ends it',
            flush=True,
        )
        _publish_until(signals, node, tracker, person)


def _publish_until(
    signals: Sequence[int],
    node: PersonPublisher | StandInPublisher,
    tracker: Tracker,
    person: RecordedPerson,
) -> None:
    """Publish each measurement when it is due; a busy machine skips those that are outdated."""
    begin, number = time.monotonic(), -1
    while not signals:
        left = publishing_time(tracker, number + 1) - (time.monotonic() - begin)
        if left > 0.0:
            time.sleep(min(left, LONGEST_SLEEP))
            continue
        number = newest_number(tracker, time.monotonic() - begin)
        posture = measurement(tracker, person, number) if number >= 0 else None
        if posture is not None:
            node.publish(posture, time.monotonic() - begin - number / tracker.fps)


if __name__ == '__main__':
    sys.exit(main())
