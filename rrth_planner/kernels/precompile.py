# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compiling of what a plan needs, before it is needed: by two processes, kept for all others."""

from collections.abc import Callable
import os
from pathlib import Path
import subprocess
import sys

from rrth_planner.kernels.jit import cache_folder, compiling_notice, is_compiled

# What each of the two processes compiles: all that a node or a command with the default planner
# needs, in equal shares, and nothing that the other one needs soon.
SHARES = (
    (
        'vectors',
        'kinematics.generated_fk',
        'collision.separation',
        'collision.containment',
        'kinematics.pan_tilt_ik',
        'search.elastic_band',
        'collision.arm_clearance',
        'collision.trajectory_check',
    ),
    (
        'trajectory.points',
        'trajectory.quintics',
        'trajectory.fast_stop',
        'search.shortcut',
        'trajectory.timed_path',
        'trajectory.rate_profile',
        'search.rrt',
        'search.rrt_h',
        'kinematics.goal_selection',
    ),
)

# The compiler makes few cycles, and to look for them takes a twentieth of its time.
RARE_COLLECTIONS = 'import gc; gc.set_threshold(100_000)'


def prepare_kernels(say: Callable[[str], object]) -> None:
    """
    Compile the kernels of the default planner if they are not, and have said so before.

    To be called before anything is imported that has kernels.
    """
    if is_compiled():
        return
    if notice := compiling_notice():
        say(notice)
    if cache_folder() is not None:
        compile_kernels()


def compile_kernels() -> bool:
    """
    Compile the kernels of the default planner in processes of their own; return whether they did.

    The compiler keeps some 150 MB for good; so they end, and this process loads what they leave.
    Without a folder to leave it in, each process compiles for itself.
    """
    folder = str(Path(__file__).parents[2])
    paths = os.pathsep.join(filter(None, (folder, os.environ.get('PYTHONPATH', ''))))
    env, nothing = {**os.environ, 'PYTHONPATH': paths}, subprocess.DEVNULL
    children = []
    for share in SHARES:
        imports = '; '.join(f'import rrth_planner.kernels.{name}' for name in share)
        command = [sys.executable, '-W', 'ignore', '-c', f'{RARE_COLLECTIONS}; {imports}']
        children.append(
            subprocess.Popen(command, env=env, stdin=nothing, stdout=nothing, stderr=nothing)
        )
    codes = [child.wait() for child in children]
    return not any(codes)
