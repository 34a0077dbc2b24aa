# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The viewer's feed follows both nodes in their namespace, and the newest target counts."""

from threading import Thread
import time

import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('fcl')

from conftest import spinning, wait_until
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rrth_planner.execution.separation_status import SeparationState, SeparationStatus
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.errors import RrthError
from rrth_planner.ros.client.viewer_feed import following, SERVICE, ViewerFeed
from rrth_planner.ros.interface.separation_status import RATE_KEY, separation_to_msg
from rrth_planner.ros.middleware.qos import LATCHED
from rrth_planner.ros.planner import PlannerNode
from rrth_planner.ros.playback_node import PlaybackNode
from samples import wearer
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

LEFT = ['--ros-args', '-r', '__ns:=/left']
TARGETS = np.array([[1.5, 0.1 + 0.01 * k, 0.3] for k in range(10)])


def test_the_feed_shows_what_the_nodes_say_and_asks_for_the_newest_target():
    with following(None, None, LEFT) as feed:
        assert f'waiting for {feed.resolve_topic_name("body_boxes")}' in feed.said
        # The wearer is published once.
        planner = PlannerNode(parameter_overrides=[Parameter('separation', value=False)])
        playback = PlaybackNode()
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

                def has_arrived():
                    # A busy machine may not plan in time for an arm that moves.
                    if feed.said.startswith('TIMED_OUT'):
                        feed.ask()
                    # The motion that is shown is the one that the arm follows to its end.
                    is_there = np.allclose(
                        feed.trajectory.positions[-1], feed.positions, atol=1e-6
                    )
                    return is_there and pointing_error(arm, feed.positions, TARGETS[-1]) < 1e-3

                arm = load_arm()
                wait_until(has_arrived)
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
    # Nothing is left behind that would spoil a good one.
    with following(None, None, LEFT):
        pass


class Planner(Node):
    """Offers the planner's service, and answers the same at once or never."""

    def __init__(self, does_answer):
        """Offer it."""
        super().__init__('planner', namespace='left')
        self._does_answer, self.n_asked = does_answer, 0
        self.create_service(Trigger, SERVICE, self._on_request)

    async def _on_request(self, _, response):
        self.n_asked += 1
        if not self._does_answer:
            await Future()
        response.message = 'SUCCESS (1): so it is'
        return response


def test_a_planner_that_ends_while_it_is_asked_leaves_the_next_one_to_be_asked():
    with following(None, None, LEFT) as feed:
        first = Planner(does_answer=False)
        with spinning(first):
            feed.ask()
            wait_until(lambda: first.n_asked)
        first.destroy_node()
        wait_until(lambda: 'ended without an answer' in feed.said)
        assert f'waiting for {feed.resolve_topic_name("body_boxes")}' in feed.said
        second = Planner(does_answer=True)
        with spinning(second):
            feed.ask()
            wait_until(lambda: feed.said.startswith('SUCCESS'))
        second.destroy_node()


class FailingClient:
    """A client of a service: the first request fails, the others are never answered."""

    srv_name = '/rrth_planner/plan'

    def __init__(self):
        self.n_asked = 0

    def service_is_ready(self):
        """As of `Client`."""
        return True

    def call_async(self, _):
        """As of `Client`."""
        self.n_asked, future = self.n_asked + 1, Future()
        if self.n_asked == 1:
            future.set_exception(RuntimeError('no way\nout'))
        return future


class FailingFeed(ViewerFeed):
    """A feed with that client."""

    def create_client(self, *_, **__):
        """As of `Node`."""
        self.client = FailingClient()
        return self.client


def test_a_failed_request_is_reported_and_the_next_one_is_made(ros_context):
    feed = FailingFeed()
    with spinning(feed):
        feed.ask()
        wait_until(lambda: feed.said.startswith('no answer of the planner: no way out'))
        assert feed.client.n_asked == 1
        feed.ask()
        wait_until(lambda: feed.client.n_asked == 2)
    feed.destroy_node()


def test_the_feed_knows_how_a_motion_is_executed_and_rejects_what_is_no_state(ros_context):
    feed = ViewerFeed()
    (take,) = (s.callback for s in feed.subscriptions if s.topic_name == '/rrth_planner/state')
    assert feed.separation is None
    slowed = SeparationStatus(
        SeparationState.SLOWED, 'bar is too near to head', 0.25, 'bar', 'head'
    )
    for status in (SeparationStatus(), slowed):
        take(separation_to_msg('planner', status))
        assert feed.separation == status
    assert feed.said.startswith(
        'SLOWED: bar is too near to head, at 25% of its speed; waiting for'
    )
    for name, rate in (('SLOW', '0.5'), ('NORMAL', 'fast'), ('NORMAL', 'nan'), ('NORMAL', None)):
        values = [] if rate is None else [KeyValue(key=RATE_KEY, value=rate)]
        take(DiagnosticStatus(message=name, values=values))
        assert feed.separation == slowed
    take(separation_to_msg('planner', SeparationStatus(rate=1.004)))
    assert feed.separation == SeparationStatus()
    feed.destroy_node()


class SlowFeed(ViewerFeed):
    """A feed that another thread asks for something just when it takes what it was asked for."""

    asker = None

    @property
    def _newest(self):
        newest, asker, self.asker = self._kept, self.asker, None
        if asker is not None:
            asker.start()
            # As long as it takes, unless it has to wait.
            asker.join(0.5)
        return newest

    @_newest.setter
    def _newest(self, newest):
        self._kept = newest


def test_no_target_is_lost_between_two_threads(ros_context):
    planner, feed = Planner(does_answer=True), SlowFeed(namespace='left')
    with spinning(planner):
        feed.ask(TARGETS[0])
        feed.asker = asker = Thread(target=feed.ask, args=(TARGETS[1],))
        with spinning(feed):
            wait_until(lambda: planner.n_asked == 2)
            assert feed.asker is None
            asker.join()
            wait_until(lambda: np.allclose(feed.target, TARGETS[1]))
    feed.destroy_node()
    planner.destroy_node()
