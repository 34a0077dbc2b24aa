# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What a request is answered, and what is left to do then."""

from collections.abc import Callable
from dataclasses import dataclass

from nav_msgs.msg import Path


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """
    What a request is answered.

    Parameters
    ----------
    is_solved : bool
        Whether a motion was published.
    text : str
    tool_path : callable
        Returns the tool's path; empty where no motion was published.
    conclude : callable
        What is left to do when it has been answered: to show and to report it.

    """

    is_solved: bool
    text: str
    tool_path: Callable[[], Path]
    conclude: Callable[[], None]
