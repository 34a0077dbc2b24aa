# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes that talk with planner and arm from outside; `PlannerClient` is the public one."""

from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from rrth_planner.ros.client.planner_client import PlannerClient

__all__ = ['PlannerClient']


def __getattr__(name: str) -> Any:
    # Only when it is used: the other modules of this package do not need it.
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    from rrth_planner.ros.client import planner_client

    return getattr(planner_client, name)
