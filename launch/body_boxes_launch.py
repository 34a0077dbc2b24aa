# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0

from rrth_planner.ros.middleware.node_launch import node_launch


def generate_launch_description():
    """Start the node that makes boxes of what a tracker sees of the wearer."""
    return node_launch('body_boxes_node', 'body_boxes_node', 'body_boxes.yaml')
