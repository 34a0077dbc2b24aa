# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan on a map of rectangles; `python examples/01_plan_on_a_map.py [MAP.yaml]`."""

import sys

import numpy as np
from rrth_planner.box_map import map_from_mapping, map_problem
from rrth_planner.options import RRTHOptions
from rrth_planner.planner import plan
from rrth_planner.resources import load_yaml, resource_path

file = sys.argv[1] if len(sys.argv) > 1 else resource_path('config/maps/spiral.yaml')
box_map = map_from_mapping(load_yaml(file), str(file))
options = RRTHOptions(step_size=10.0, corner_spacing=0.05, club_radius=10.0)
result = plan(map_problem(box_map), options, np.random.default_rng(seed=0))
print(f'{box_map.name}: {result.status.value} after {result.n_samples} draws')
if result.path is not None:
    waypoints = result.path.waypoints.round(1).tolist()
    print(f'length {result.path.length:.2f} in map units, by way of {waypoints}')
