# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Have the arm point at two targets by the planner's service, as a call and by asyncio."""

import asyncio
import sys

import rclpy
from rrth_planner import RrthError
from rrth_planner.ros.client import PlannerClient


async def point_and_count() -> None:
    """Count while the planner plans."""
    pointing, n_rounds = asyncio.create_task(client.point_at_async((0.8, 1.6, 0.6))), 0
    while not pointing.done():
        n_rounds += 1
        await asyncio.sleep(0.001)
    print(f'{pointing.result().code.name} after {n_rounds} rounds of another task')


rclpy.init()
client = PlannerClient(timeout=30.0)
try:
    answer = client.point_at((1.5, 0.1, 0.3))
    print(f'{answer.code.name}: {answer.sentence}')
    asyncio.run(point_and_count())
except RrthError as problem:
    sys.exit(f'no answer: {problem}')
client.destroy_node()
rclpy.shutdown()
