# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Results of planning."""

from enum import Enum


class PlanStatus(Enum):
    """Results of planning that are not errors; each comes with a sentence."""

    SOLVED = 'solved'
    TIMEOUT = 'timeout'
    SAMPLE_LIMIT = 'sample limit'
    CANCELLED = 'cancelled'
    START_OUT_OF_BOUNDS = 'start out of bounds'
    START_MOVES = 'start moves'
    START_IN_COLLISION = 'start in collision'
    GOAL_IN_COLLISION = 'goal in collision'
    GOAL_UNREACHABLE = 'goal unreachable'
    NOT_CERTIFIED = 'not certified'
