# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Tell how requests ended: to the log, and to diagnostics."""

from dataclasses import replace

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.ros.diagnostics import diagnostics_msg, PlanReport
from rrth_planner.ros.error_codes import answer, ErrorCode
from rrth_planner.ros.inputs import Inputs
from rrth_planner.ros.parameters import PlannerParameters

PERIOD = 1.0


class Reporter:
    """
    Publish `/diagnostics` every second and on change, and log each request once.

    Parameters
    ----------
    node : Node
    heard : Inputs
    parameters : PlannerParameters
        Those of the start; `parameters` is to be kept up to date.

    """

    def __init__(self, node: Node, heard: Inputs, parameters: PlannerParameters) -> None:
        """Advertise `/diagnostics`."""
        self.parameters = parameters
        self.report = PlanReport()
        self._node, self._heard = node, heard
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # Not the node's clock: simulated time may stand still.
        self._timer = node.create_timer(
            PERIOD, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def publish(self) -> None:
        """Publish the diagnostics of now."""
        now = self._node.get_clock().now()
        self._publisher.publish(
            diagnostics_msg(
                now.to_msg(), now.nanoseconds * 1e-9, self._heard, self.parameters, self.report
            )
        )

    def conclude(self, code: ErrorCode, sentence: str, figures: PlanReport) -> str:
        """Log and publish how a request ended, and return the answer to it."""
        text = answer(code, sentence)
        is_solved = code is ErrorCode.SUCCESS
        self.report = replace(
            figures,
            n_requests=self.report.n_requests + 1,
            n_solved=self.report.n_solved + is_solved,
            code=code,
            sentence=sentence,
        )
        logger = self._node.get_logger()
        if is_solved:
            logger.info(text)
        else:
            logger.warning(text)
        self.publish()
        return text
