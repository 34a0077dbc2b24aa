# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compare the planners on a map; `python examples/03_compare_planners.py [MAP]`."""

import sys

import numpy as np
from rrth_planner.campaign.paper_runs import ALGORITHMS, FIVE
from rrth_planner.campaign.problems import load_map, load_problem
from rrth_planner.planner import plan
from rrth_planner.shortest import shortest_path

name = sys.argv[1] if len(sys.argv) > 1 else 'c_shape'
exact, _ = shortest_path(load_map(name))
problem = load_problem(name).problem

print(f'{name}: the shortest path is {exact:.2f} long')
for algorithm in FIVE:
    result = plan(problem, ALGORITHMS[algorithm], np.random.default_rng(seed=0))
    told = 'no path' if result.path is None else f'{result.path.length / exact:.4f} times that'
    print(f'{algorithm:14} {told} after {result.n_samples} draws')
