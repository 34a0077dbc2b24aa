# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The command `record`: keep what the nodes say in a file that Foxglove and `plot` open."""

import argparse
from collections.abc import Sequence
from contextlib import ExitStack
from importlib.util import find_spec
import math
from pathlib import Path
import re
import signal
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped
from nav_msgs.msg import Path as ToolPath
import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rclpy.validate_topic_name import validate_topic_name
from rrth_planner.model.errors import one_line, OptionsError, RrthError
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

# All that a planner and an arm say and hear.
TOPICS: dict[str, Any] = {
    'body_boxes': MarkerArray,
    'target': PointStamped,
    'joint_states': JointState,
    'joint_trajectory': JointTrajectory,
    'rrth_planner/tool_path': ToolPath,
    'rrth_planner/markers': MarkerArray,
    '/diagnostics': DiagnosticArray,
    'arm_playback/tool_pose': PoseStamped,
}
TOOLS = ('mcap', 'tqdm')
SOURCE_LINES = re.compile(r', at /\S+\.c:\d+')
DESCRIPTION = """\
Record a run of the nodes in an MCAP file until Ctrl-C: every message once, as it came from the
wire, whether its publisher is reliable, best effort, or latched it before. Foxglove opens the
file, `plot recording` draws it. Names are relative; namespaces and remaps go behind --ros-args.
"""
EPILOG = """\
topics, unless others are named:
  {}

example:    ./run exec record -o run.mcap --duration 30 --ros-args -r __ns:=/left
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Record until told to end, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        options = _parser().parse_args(remove_ros_args(['record', *given])[1:])
        return _record(options, given)
    except (RrthError, OSError, RuntimeError, InvalidTopicNameException) as problem:
        # ROS says in which lines of its sources it found what is wrong.
        sentence = SOURCE_LINES.sub('', ' '.join(str(problem).split()))
        print(f'record: {one_line(sentence)}', file=sys.stderr)
        return 1


def _record(options: argparse.Namespace, given: Sequence[str]) -> int:
    missing = [name for name in TOOLS if find_spec(name) is None]
    if missing:
        raise OptionsError(
            f'{", ".join(missing)}: not installed, expected what requirements/tools.txt lists'
        )
    # Not before it is known that they are there.
    from rrth_planner.ros.client.recorder import Recorder, RecordingFile, since
    from tqdm import tqdm  # type: ignore[import-untyped]

    for topic in options.topics or ():
        validate_topic_name(topic)
    told: list[int] = []
    known: set[str] = set()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Only noted, so that no message is cut in the middle.
        signal.signal(number, lambda number, _: told.append(number))
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
        while not told and since(begin) < options.duration:
            executor.spin_once(timeout_sec=min(0.1, max(0.0, options.duration - since(begin))))
            recorder.check()
            heard = {topic: n for topic, n in recording.counts.items() if n}
            for topic in heard.keys() - known:
                tqdm.write(f'hears {topic}')
                sys.stdout.flush()
            known |= heard.keys()
            bar.set_postfix({k.rsplit('/', 1)[-1]: n for k, n in heard.items()}, refresh=False)
            bar.update(sum(recording.counts.values()) - bar.n)
    for topic, count in recording.counts.items():
        print(f'{count:8d}  {topic}')
    n = sum(recording.counts.values())
    if n == 0:
        raise OptionsError(
            f'nothing was heard in {since(begin):.1f} s, so there is no {file}; expected nodes '
            'that run with the same ROS_DOMAIN_ID'
        )
    print(f'{n} messages in {since(begin):.1f} s: {file}')
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='record',
        description=DESCRIPTION,
        epilog=EPILOG.format('\n  '.join(TOPICS)),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        metavar='FILE',
        help='a new file (run-DATE-TIME.mcap)',
    )
    parser.add_argument(
        '--duration',
        type=_seconds,
        default=math.inf,
        metavar='S',
        help='end by itself after so long [s]',
    )
    parser.add_argument(
        '--topics',
        nargs='+',
        metavar='NAME',
        help='record these instead, of any installed type',
    )
    return parser


def _seconds(text: str) -> float:
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f'{text}, expected a time > 0 [s]')
    return value


if __name__ == '__main__':
    sys.exit(main())
