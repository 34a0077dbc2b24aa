# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Publish a target, and follow by topics what the planner does for whoever asks it to plan."""

from geometry_msgs.msg import PointStamped
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from trajectory_msgs.msg import JointTrajectory

rclpy.init()
node = rclpy.create_node('follow_by_topics')
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
target = PointStamped()
target.header.frame_id = 'torso'
target.point.x, target.point.y, target.point.z = 1.5, 0.1, 0.3
node.create_publisher(PointStamped, 'target', latched).publish(target)
motions: list[JointTrajectory] = []
node.create_subscription(JointTrajectory, 'joint_trajectory', motions.append, latched)
while not motions:
    rclpy.spin_once(node)
end = motions[-1].points[-1]
print(f'a motion to {[round(q, 3) for q in end.positions]} rad')
node.destroy_node()
rclpy.shutdown()
