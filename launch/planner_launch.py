# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from rrth_planner.ros.middleware.node_launch import node_launch


def generate_launch_description():
    """Start the planner node."""
    return node_launch('planner_node', 'rrth_planner', 'planner.yaml')
