# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which kernels are compiled beforehand: all that a node needs, by one process each."""

import json
import os
from pathlib import Path
import subprocess
import sys

from rrth_planner.kernels.precompile import SHARES

ROOT = Path(__file__).parents[2]
# Both processes of a node, and the search of its default options, without the compiler.
LOADED = """
import json, sys
from importlib import import_module

def kernels():
    return {name for name in sys.modules if name.startswith('rrth_planner.kernels.')}

for name in sys.argv[1:]:
    import_module(f'rrth_planner.kernels.{name}')
beforehand = kernels()
from rrth_planner.execution import warm_up
from rrth_planner.pipeline import in_process_planner
import_module('rrth_planner.planning.rrt_h')
print(json.dumps(sorted(kernels() - beforehand)))
"""


def test_a_node_finds_all_its_kernels_compiled():
    names = [name for share in SHARES for name in share]
    assert len(set(names)) == len(names)
    paths = os.pathsep.join(filter(None, (str(ROOT), os.environ.get('PYTHONPATH'))))
    missing = subprocess.check_output(
        [sys.executable, '-c', LOADED, *names],
        env={**os.environ, 'PYTHONPATH': paths, 'NUMBA_DISABLE_JIT': '1'},
        text=True,
        timeout=120,
    )
    assert json.loads(missing) == []
