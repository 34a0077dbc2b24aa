# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The executable `planner_node`: it starts the planning process before it loads the node."""

import signal
import sys
from typing import Any

from rrth_planner.pipeline.worker_process import WorkerProcess


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    # ROS's own handlers take effect only once the node spins.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _exit_at_once)
    worker = WorkerProcess()
    from rrth_planner.ros.planner import run

    return run(args, worker)


def _exit_at_once(*_: Any) -> None:
    raise SystemExit(0)


if __name__ == '__main__':
    sys.exit(main())
