# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The viewer's feed follows both nodes in their namespace, and the newest target counts."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from conftest import spinning, wait_until
from rrth_planner.arm import pointing_error
from rrth_planner.errors import RrthError
from rrth_planner.resources import load_arm
from rrth_planner.ros.planner_node import PlannerNode
from rrth_planner.ros.playback_node import PlaybackNode
from rrth_planner.ros.viewer_feed import following, LATCHED
from samples import wearer
from visualization_msgs.msg import MarkerArray

LEFT = ['--ros-args', '-r', '__ns:=/left']
TARGETS = np.array([[1.5, 0.1 + 0.01 * k, 0.3] for k in range(10)])


def test_the_feed_shows_what_the_nodes_say_and_asks_for_the_newest_target():
    with following(None, None, LEFT) as feed:
        assert f'waiting for {feed.resolve_topic_name("body_boxes")}' in feed.said
        planner, playback = PlannerNode(), PlaybackNode()
        try:
            with spinning(planner), spinning(playback):
                feed.create_publisher(MarkerArray, 'body_boxes', LATCHED).publish(wearer())
                wait_until(lambda: feed.scene.boxes and feed.positions is not None)
                wait_until(lambda: 'service' not in feed.said)
                assert feed.resolve_topic_name('target') == '/left/target'
                assert feed.scene is feed.scene
                assert feed.trajectory is None
                for target in TARGETS:
                    feed.ask(target)
                    time.sleep(0.05)
                wait_until(lambda: feed.said.startswith('SUCCESS'))
                wait_until(lambda: np.allclose(feed.target, TARGETS[-1]))
                wait_until(lambda: not feed.is_asking)
                # The motion that is shown is the one that the arm follows to its end.
                wait_until(
                    lambda: np.allclose(feed.trajectory.positions[-1], feed.positions, atol=1e-6)
                )
                assert pointing_error(load_arm(), feed.positions, TARGETS[-1]) < 1e-3
                feed.ask(np.zeros(3))
                wait_until(lambda: feed.said.startswith('GOAL_IN_COLLISION'))
                assert 'inside box' in feed.said
        finally:
            planner.close()
            planner.destroy_node()
            playback.destroy_node()


def test_a_bad_parameter_is_one_sentence():
    with (
        pytest.raises(RrthError, match='margin'),
        following(None, None, ['--ros-args', '-p', 'margin:=-1.0']),
    ):
        pass
    # Nothing is left behind that would be in the way of a good one.
    with following(None, None, LEFT):
        pass
