# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compare the planners on a map; `python examples/03_compare_planners.py [MAP or FILE.yaml]`."""

import sys

import numpy as np
from rrth_planner.io.map_file import load_map
from rrth_planner.model.errors import RrthError
from rrth_planner.planning.planner import plan
from rrth_planner.planning.visibility_graph import shortest_path
from rrth_planner.reproduction.experiments import ALGORITHMS, FIVE
from rrth_planner.reproduction.problems import load_problem

name = sys.argv[1] if len(sys.argv) > 1 else 'c_shape'
try:
    box_map, problem = load_map(name), load_problem(name).problem
except RrthError as refused:
    sys.exit(str(refused))
exact, _ = shortest_path(box_map)

print(f'{name}: the shortest path is {exact:.2f} long')
for algorithm in FIVE:
    result = plan(problem, ALGORITHMS[algorithm], np.random.default_rng(seed=0))
    told = 'no path' if result.path is None else f'{result.path.length / exact:.4f} times that'
    print(f'{algorithm:14} {told} after {result.n_samples} draws')
