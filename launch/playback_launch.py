# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from rrth_planner.ros.middleware.node_launch import node_launch


def generate_launch_description():
    """Start the playback node, which stands in for the arm."""
    return node_launch('playback_node', 'arm_playback', 'playback.yaml')
