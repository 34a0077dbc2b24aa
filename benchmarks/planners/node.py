# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node as its client sees it: answers, memory, start."""

from collections.abc import Iterator
from contextlib import contextmanager
import importlib.util
import os
import re
import tempfile
import time

import psutil
from rrth_planner.model.errors import RrthError
from rrth_planner.ros.middleware.child_process import ChildProcess

from benchmarks.common.queries import table_1_arm
from benchmarks.common.size import Extent
from benchmarks.common.task import figure_row, Row, Task
from benchmarks.planners.full_query import cases

NODE = 'rrth_planner.ros.planner_node'
# Plans between two looks at the memory, and requests round one wearer.
SAMPLE, PER_BODY = 100, 20
# Wearers that the requests go through again and again.
N_BODIES = 25
# Bodies are sent once, before the request.
ARGUMENTS = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=false']


def tasks(extent: Extent) -> list[Task]:
    """Return the measurements of this section; node and client share all cores."""
    starts = [('warm', i) for i in range(extent.warm_starts)]
    starts += [('cold', i) for i in range(extent.cold_starts)]
    return [
        Task(
            section='node',
            name='plans',
            measure=lambda: _plans(extent.n_plans),
            is_pinned=False,
        ),
        *(
            Task(
                section='node',
                name=f'{kind} start {i}',
                measure=lambda kind=kind, i=i: _start(kind, i),
                is_pinned=False,
            )
            for kind, i in starts
        ),
    ]


def is_possible() -> bool:
    """Return whether ROS 2 is there."""
    return importlib.util.find_spec('rclpy') is not None


def _plans(n: int) -> list[Row]:
    from benchmarks.common.client import ros_client

    arm = table_1_arm()
    bodies = [cases(body, PER_BODY) for body in range(min(N_BODIES, -(-n // PER_BODY)))]
    rows, n_solved = [], 0
    with ros_client() as client, ChildProcess(NODE, ARGUMENTS, _ignore) as child:
        client.wait_for_service(child)
        process = _node_process()
        for k in range(n):
            case = bodies[k // PER_BODY % len(bodies)][k % PER_BODY]
            if k % PER_BODY == 0:
                client.publish_body(case.scene)
            client.publish_joints(arm.joint_names, case.q_start)
            client.publish_target(case.goal.target)
            elapsed, answer = client.ask()
            child.check()
            if answer.success:
                n_solved += 1
                inside = client.figures_of(answer)['planning_time_ms']
                rows.append(figure_row('round trip', 1e3 * elapsed, 'ms', seed=k))
                rows.append(figure_row('planning in the node', inside, 'ms', seed=k))
            else:
                rows.append(
                    figure_row('rejection', 1e3 * elapsed, 'ms', seed=k, detail=answer.message)
                )
            if (k + 1) % SAMPLE == 0:
                memory = process.memory_info().rss / 2**20
                rows.append(figure_row('memory', memory, 'MB', seed=k + 1))
    rows.append(figure_row('solved', n_solved / n, '', detail=f'{n_solved} of {n}'))
    return rows


def _start(kind: str, seed: int) -> list[Row]:
    from benchmarks.common.client import ros_client

    ready: list[str] = []
    with _kernels(kind), ros_client() as client:
        begin = time.perf_counter()
        with ChildProcess(NODE, ARGUMENTS, ready.append) as child:
            client.wait_for_service(child)
            elapsed = time.perf_counter() - begin
            # It says so after its services are there.
            while not ready or 'ready after' not in ready[-1]:
                child.check()
                time.sleep(0.01)
    matches = [re.search(r'ready after ([0-9.]+) s', line) for line in ready]
    own = [float(found.group(1)) for found in matches if found]
    return [
        figure_row(f'{kind} start', elapsed, 's', seed=seed),
        *(figure_row(f'{kind} start by its own log', value, 's', seed=seed) for value in own),
    ]


@contextmanager
def _kernels(kind: str) -> Iterator[None]:
    """Have no compiled kernels for a cold start while the block runs."""
    if kind == 'warm':
        yield
        return
    before = os.environ.get('RRTH_CACHE_DIR')
    with tempfile.TemporaryDirectory(prefix='rrth-cold-') as folder:
        os.environ['RRTH_CACHE_DIR'] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ['RRTH_CACHE_DIR']
            else:
                os.environ['RRTH_CACHE_DIR'] = before


def _node_process() -> psutil.Process:
    for child in psutil.Process().children():
        if NODE in child.cmdline():
            return child
    raise RrthError('planner node: its process is gone')


def _ignore(_: str) -> None:
    """Leave the node's log alone."""
