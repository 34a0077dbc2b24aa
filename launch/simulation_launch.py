# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from rrth_planner.ros.middleware.node_launch import node_launch


def generate_launch_description():
    """Start the simulation of the arm, which stands in for it."""
    return node_launch('simulation_node', 'arm_simulation', 'simulation.yaml')
