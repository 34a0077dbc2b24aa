# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The executable `planner_node`: it starts the planning process before it loads the node."""

import sys

from rrth_planner.pipeline.worker_process import WorkerProcess


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    worker = WorkerProcess()
    from rrth_planner.ros.planner import run

    return run(args, worker)


if __name__ == '__main__':
    sys.exit(main())
