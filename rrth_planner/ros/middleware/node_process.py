# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A process of one node, from its arguments to its exit code."""

from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.logging import get_logger
from rclpy.node import Node
from rrth_planner.model.errors import one_line, RrthError


def run_node(
    name: str, create: Callable[[], Node], run: Callable[[Any], None], args: list[str] | None
) -> int:
    """
    Create a node and run it until a signal; return the exit code.

    Where it cannot start, for bad arguments or parameters, the exit code is 1, and `name` logs the
    reason in one sentence.
    """
    node = None
    try:
        try:
            rclpy.init(args=args)
        except RuntimeError as problem:
            # Arguments that ROS cannot read.
            raise RrthError(str(problem)) from problem
        node = create()
        run(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (RrthError, ParameterException) as problem:
        get_logger(name).fatal(f'cannot start: {one_line(" ".join(str(problem).split()))}')
        return 1
    except Exception:
        # A signal between two statements of a callback leaves publishers without a context.
        if rclpy.ok():
            raise
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
