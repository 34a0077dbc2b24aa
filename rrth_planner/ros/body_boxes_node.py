# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The node `body_boxes_node`: boxes round a wearer whom a tracker sees."""

from collections.abc import Callable
import sys
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from rrth_planner.model.errors import MessageError, SceneError
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.interface.posture_inputs import create_input, PersonInput
from rrth_planner.ros.interface.tracker_parameters import declare_tracker_parameters
from rrth_planner.ros.interface.tracker_reporter import because, TrackerReporter
from rrth_planner.ros.messages.body_source import TRACKER
from rrth_planner.ros.messages.other_persons import OtherPersons
from rrth_planner.ros.messages.part_markers import PartMarkers
from rrth_planner.ros.messages.posture import TrackedPosture
from rrth_planner.ros.middleware.executor import settle_interpreter, spin
from rrth_planner.ros.middleware.node_process import run_node
from rrth_planner.wearer.body_boxes import base_pose, boxes_of_plausible
from rrth_planner.wearer.jump_filter import FilteredPosture, without_jumps
from rrth_planner.wearer.plausible_posture import plausible_posture
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

NAME = TRACKER
# Stamps have seconds of 32 bits [ns].
MOST_STAMP = 2**31 * NANOSECONDS


class BodyBoxesNode(Node):
    """Publishes the boxes of each posture that comes, in the base frame, with its own stamp."""

    def __init__(self, **options: Any) -> None:
        """Declare parameters and interfaces; bad values raise, naming the parameter."""
        super().__init__(NAME, **options)
        self._settings = declare_tracker_parameters(self)
        self._before: FilteredPosture | None = None
        names = (part.name for part in self._settings.skeleton.parts)
        self._markers = PartMarkers(names, self._settings.lifetime)
        self._others = OtherPersons(self._settings.lifetime)
        # The last body counts, and for those only who are there.
        self._publisher = self.create_publisher(MarkerArray, 'body_boxes', QoSProfile(depth=1))
        self._reporter = TrackerReporter(self, self._settings.input, self._settings.lifetime)
        self._input = create_input(self, self._settings, self._take)
        self._reset = self.create_service(Trigger, '~/reset', self._on_reset)

    def _on_reset(self, _: Any, response: Any) -> Any:
        """Have the next person who is seen become the wearer."""
        self._before = None
        if isinstance(self._input, PersonInput):
            self._input.reset()
        response.success = True
        response.message = 'the next person who is seen is the wearer'
        return response

    def _take(self, read: Callable[[], TrackedPosture], arrived: int) -> None:
        """Publish the boxes of what `read` returns; arrived [ns]."""
        self._reporter.received()
        try:
            tracked = read()
            if not 0 <= tracked.stamp < MOST_STAMP:
                raise MessageError(
                    f'header.stamp: {tracked.stamp / NANOSECONDS:g} s, expected a time since 1970'
                )
            measured = tracked.stamp or self.get_clock().now().nanoseconds
            msg, lost, doubts = self._boxes_of(tracked, measured)
        except (MessageError, SceneError) as problem:
            self._reporter.rejected(problem)
            return
        self._publisher.publish(msg)
        self._reporter.published(measured, arrived, lost, doubts)

    def _boxes_of(
        self, tracked: TrackedPosture, measured: int
    ) -> tuple[MarkerArray, tuple[str, ...], tuple[str, ...]]:
        """
        Return the boxes of a posture, the parts that are lost, and what of it is not believed.

        measured: its stamp; without one, the time of its reception [ns].
        """
        settings = self._settings
        # First of all: what is not believed is lost, and jumps neither there nor back.
        plausible = plausible_posture(settings.skeleton, tracked.posture)
        self._before = without_jumps(
            self._before, plausible.posture, measured / NANOSECONDS, settings.max_jump
        )
        self._reporter.jumped(self._before.n_held)
        scene, lost = boxes_of_plausible(settings.skeleton, self._before.posture)
        if not scene.boxes:
            raise SceneError(
                'all parts of the wearer are lost, expected the points of at least one'
                f'{because(plausible.doubts)}'
            )
        # A tracker that reports in the base frame has its own name for it.
        own = tracked.frame if settings.skeleton.base is None else ''
        # One that is not set is handed on as such: whoever receives it adds the tracker's latency.
        stamp = Time(nanoseconds=tracked.stamp).to_msg()
        frame = own or settings.base_frame
        msg = self._markers.message(scene, frame, stamp)
        # Also where there are none any more: those who have left are deleted.
        T = base_pose(settings.skeleton, self._before.posture) if tracked.others else np.eye(4)
        msg.markers.extend(self._others.markers(tracked.others, T, frame, stamp, measured))
        return msg, lost, plausible.doubts


def _run(node: BodyBoxesNode) -> None:
    settle_interpreter()
    spin(node)


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal; return the exit code."""
    return run_node(NAME, BodyBoxesNode, _run, args)


if __name__ == '__main__':
    sys.exit(main())
