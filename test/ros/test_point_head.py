# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The action point_head, asked for with the real control_msgs/action/PointHead, over DDS."""

import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

import control_messages  # noqa: E402
from rclpy.action import ActionClient, ActionServer  # noqa: E402
from rclpy.node import Node  # noqa: E402

pytestmark = pytest.mark.usefixtures('ros_context')


@pytest.fixture(name='action', scope='module')
def _action(request):
    """Give the type of the action."""
    control_messages.available(request.config.cache.mkdir)
    from control_msgs.action import PointHead

    return PointHead


def test_the_action_is_the_one_that_others_have(action, spinning, wait_until):
    node, received, errors = Node('head'), [], []

    def execute(goal):
        received.append(goal.request)
        goal.publish_feedback(action.Feedback(pointing_angle_error=0.25))
        goal.succeed()
        return action.Result()

    server = ActionServer(node, action, 'point_head', execute)
    client = ActionClient(node, action, 'point_head')
    goal = action.Goal(pointing_frame='tool', max_velocity=0.5)
    goal.target.header.frame_id, goal.target.point.x, goal.min_duration.sec = 'torso', 1.5, 2
    with spinning(node):
        wait_until(client.server_is_ready)
        sent = client.send_goal_async(goal, lambda msg: errors.append(msg.feedback))
        wait_until(sent.done)
        result = sent.result().get_result_async()
        wait_until(result.done)
        wait_until(lambda: errors)
    assert received == [goal]
    assert errors[0].pointing_angle_error == 0.25
    assert result.result().result == action.Result()
    server.destroy()
    client.destroy()
