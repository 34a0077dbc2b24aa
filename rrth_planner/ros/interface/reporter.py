# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Report the outcomes of requests and the state of the monitor: log and diagnostics."""

from dataclasses import replace
from pathlib import Path
from threading import Lock
import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.model.errors import one_line
from rrth_planner.ros.interface.diagnostics import diagnostics_msg, Figures, PlanReport
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.error_codes import answer, ErrorCode

PERIOD = 1.0
# So many boxes are remembered as reported.
MOST_NAMED = 1000
# Changes are published at most this often; the last one always is [s].
SHORTEST_PERIOD = 0.1


class Reporter:
    """
    Publish `/diagnostics` every second and on change, and log each request once.

    Parameters
    ----------
    node : Node
    inputs : Inputs
    parameters : PlannerParameters
        Those of the start; `parameters` is to be kept up to date.

    """

    def __init__(self, node: Node, inputs: Inputs, parameters: PlannerParameters) -> None:
        """Advertise `/diagnostics`."""
        self.parameters = parameters
        self.report = PlanReport()
        self._node, self._inputs = node, inputs
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # The state of the monitor, and its reason.
        self.monitor_state = ('no motion', '')
        self._remaining_motion_checks, self._stops_published = Figures(), Figures()
        self._n_incidents, self._last_incident = 0, ''
        # Of what the threads of executor and worker count and publish.
        self._lock = Lock()
        self._published = -SHORTEST_PERIOD
        self._is_changed = False
        self._named: set[tuple[str, int]] = set()
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers = [
            node.create_timer(PERIOD, self._publish, clock=steady),
            node.create_timer(SHORTEST_PERIOD, self._publish_change, clock=steady),
        ]

    def remaining_motion_checked(self, elapsed: float) -> None:
        """Count a check of the remaining motion against a new body, and its time [s]."""
        with self._lock:
            self._remaining_motion_checks.add(elapsed)

    def stop_published(self, elapsed: float) -> None:
        """Count a fail-safe stop, and how long after the body's arrival it was published [s]."""
        with self._lock:
            self._stops_published.add(elapsed)

    def incident(self, file: Path | None) -> None:
        """Count an incident, and keep the name of its file if there is one."""
        with self._lock:
            self._n_incidents += 1
            self._last_incident = '' if file is None else str(file)

    def publish_soon(self) -> None:
        """Publish the diagnostics within a tenth of a second."""
        self._is_changed = True

    def publish(self) -> None:
        """Publish the diagnostics of now, or, when the last are too recent, soon."""
        self._is_changed = True
        self._publish_change()

    def _publish_change(self) -> None:
        if self._is_changed and time.monotonic() - self._published >= SHORTEST_PERIOD:
            self._publish()

    def _publish(self) -> None:
        with self._lock:
            self._published, self._is_changed = time.monotonic(), False
            now = self._node.get_clock().now()
            seconds = now.nanoseconds * 1e-9
            self._warn_of_expired(seconds)
            self._publisher.publish(
                diagnostics_msg(
                    self._node.get_fully_qualified_name(),
                    now.to_msg(),
                    seconds,
                    self._inputs,
                    self.parameters,
                    self.report,
                    self.monitor_state,
                    {
                        'remaining motion checks': self._remaining_motion_checks,
                        'fail-safe stops': self._stops_published,
                        'incidents': self._n_incidents,
                        'last incident': self._last_incident,
                    },
                )
            )

    def _warn_of_expired(self, now: float) -> None:
        """Log each expired box once."""
        expired = self._inputs.body.value.at(now).expired
        new = [(key, part) for key, part in expired if key not in self._named]
        if new:
            if len(self._named) > MOST_NAMED:
                self._named = {key for key, _ in expired}
            self._named.update(key for key, _ in new)
            names = WearerBody(expired=tuple(new)).expired_names
            self._node.get_logger().warning(
                f'{self._inputs.body.topic}: lifetime of {names} expired: no motion until '
                'published again or deleted'
            )

    def reject(self, code: ErrorCode, sentence: str) -> None:
        """Log and publish the rejection of a request."""
        self.conclude(code, sentence, PlanReport())

    def conclude(self, code: ErrorCode, sentence: str, figures: PlanReport) -> str:
        """Log and publish how a request ended, and return the answer to it."""
        text, sentence = answer(code, sentence), one_line(sentence)
        is_solved = code is ErrorCode.SUCCESS
        with self._lock:
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
        elif code is ErrorCode.FAILURE:
            logger.error(text)
        else:
            logger.warning(text)
        self.publish()
        return text
