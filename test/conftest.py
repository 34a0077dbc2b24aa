# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

import os

# A domain for each worker, before anything imports rclpy. Workers share the parent, so their
# domains are neighbours; 1 to 100 is the range whose ports are safe on every system.
_worker = os.environ.get('PYTEST_XDIST_WORKER', 'gw0')
_run = os.getppid() if 'PYTEST_XDIST_WORKER' in os.environ else os.getpid()
os.environ['ROS_DOMAIN_ID'] = str(1 + (7 * _run + int(_worker.removeprefix('gw'))) % 100)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# Before anything imports numpy: its products are small here, and threads for them only wait for
# each other, and for the other workers.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

from contextlib import ExitStack  # noqa: E402

from benchmarks.common.processors import lose_time_asleep, OnEachProcessor, stay_awake  # noqa: E402
from hypothesis import settings  # noqa: E402

# How long an example takes says how busy the machine is.
settings.register_profile('untimed', deadline=None)
settings.load_profile('untimed')
_session = ExitStack()


def pytest_sessionstart(session):
    """Keep a virtual machine's processors awake, so that no test has to wait for them."""
    # Workers are of a session that does so.
    if 'PYTEST_XDIST_WORKER' not in os.environ and lose_time_asleep():
        _session.enter_context(OnEachProcessor(stay_awake))


def pytest_sessionfinish(session):
    """Let them sleep again."""
    _session.close()
