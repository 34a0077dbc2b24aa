# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `record`: keep what the nodes say in a file that Foxglove and `plot` open."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
import re
import signal
import sys
import time

import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rclpy.validate_topic_name import validate_topic_name
from rrth_planner.cli.parsers.record import parser, TOPICS
from rrth_planner.cli.program import say
from rrth_planner.io.extras import require
from rrth_planner.model.errors import one_line, OptionsError, RrthError

SOURCE_LINES = re.compile(r', at /\S+\.c:\d+')


def main(arguments: Sequence[str] | None = None) -> int:
    """Record until a signal or the end of the duration, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = parser().parse_args(remove_ros_args(['record', *given])[1:])
        return _record(options, given)
    except (RrthError, OSError, RuntimeError, InvalidTopicNameException) as problem:
        # Errors of ROS name lines of its own sources.
        sentence = SOURCE_LINES.sub('', ' '.join(str(problem).split()))
        say('record', one_line(sentence))
        return 1


def _record(options: argparse.Namespace, given: Sequence[str]) -> int:
    require('tools', 'mcap', 'tqdm')
    # Imported here: `require` has checked that they are installed.
    from rrth_planner.ros.client.recorder import Recorder, RecordingFile
    from tqdm import tqdm  # type: ignore[import-untyped]

    for topic in options.topics or ():
        validate_topic_name(topic)
    signals: list[int] = []
    known: set[str] = set()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Only stored, so that no message is truncated.
        signal.signal(number, lambda number, _: signals.append(number))
    file = options.output or Path(time.strftime('run-%Y%m%d-%H%M%S.mcap'))
    begin = time.monotonic()
    with ExitStack() as stack:
        rclpy.init(args=list(given), signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        recording = stack.enter_context(RecordingFile(file))
        recorder = Recorder(recording, TOPICS, options.topics or list(TOPICS))
        stack.callback(recorder.destroy_node)
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)
        print(f'recording to {file}; Ctrl-C ends it', flush=True)
        bar = stack.enter_context(tqdm(unit=' messages', disable=None, dynamic_ncols=True))
        while not signals and (left := begin + options.duration - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=min(0.1, left))
            recorder.check()
            received = {topic: n for topic, n in recording.counts.items() if n}
            for topic in received.keys() - known:
                tqdm.write(f'receiving {topic}')
                sys.stdout.flush()
            known |= received.keys()
            bar.set_postfix({k.rsplit('/', 1)[-1]: n for k, n in received.items()}, refresh=False)
            bar.update(sum(recording.counts.values()) - bar.n)
    for topic, count in recording.counts.items():
        print(f'{count:8d}  {topic}')
    n, passed = sum(recording.counts.values()), time.monotonic() - begin
    if n == 0:
        raise OptionsError(
            f'no message received in {passed:.1f} s, {file} not written; expected nodes '
            'running with the same ROS_DOMAIN_ID'
        )
    print(f'{n} messages in {passed:.1f} s: {file}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
