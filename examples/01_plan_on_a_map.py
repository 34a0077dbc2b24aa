# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan on a map of boxes; `python examples/01_plan_on_a_map.py [MAP or FILE.yaml]`."""

import sys

import numpy as np
import rrth_planner as rrth

try:
    box_map = rrth.load_map(sys.argv[1] if len(sys.argv) > 1 else 'spiral')
except rrth.RrthError as problem:
    sys.exit(str(problem))
options = rrth.RRTHOptions(step_size=10.0, corner_spacing=0.05, club_radius=10.0)
result = rrth.plan(rrth.map_problem(box_map), options, np.random.default_rng(seed=0))
print(f'{box_map.name}: {result.status.value} after {result.n_samples} draws')
if result.path is not None:
    waypoints = result.path.waypoints.round(1).tolist()
    print(f'length {result.path.length:.2f} in map units, by way of {waypoints}')
