# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Have the arm point at a target by the action point_head; needs control_msgs, and only rclpy."""

from control_msgs.action import PointHead
import rclpy
from rclpy.action import ActionClient

rclpy.init()
node = rclpy.create_node('point_at_by_action')
client = ActionClient(node, PointHead, 'rrth_planner/point_head')
client.wait_for_server()
goal = PointHead.Goal(max_velocity=1.0)
goal.target.header.frame_id = 'torso'
goal.target.point.x, goal.target.point.y, goal.target.point.z = 1.5, 0.1, 0.3
sent = client.send_goal_async(
    goal, lambda msg: print(f'{msg.feedback.pointing_angle_error:.3f} rad to go')
)
rclpy.spin_until_future_complete(node, sent)
result = sent.result().get_result_async()
rclpy.spin_until_future_complete(node, result)
# 4: the arm has arrived, 5: cancelled, 6: aborted; /diagnostics says why.
print(f'status {result.result().status}')
node.destroy_node()
rclpy.shutdown()
