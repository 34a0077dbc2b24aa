# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Report what becomes of a tracked person: log and diagnostics."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.model.errors import RrthError
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.interface.figures import Figures
from rrth_planner.ros.messages.diagnostics import status_to_msg

# Diagnostics are published so often, and rejections are logged at most so often [s].
DIAGNOSTICS_PERIOD, WARNING_PERIOD = 1.0, 5.0


def because(doubts: tuple[str, ...]) -> str:
    """Return the end of a sentence that says what is not believed; empty where all is."""
    return f' ({"; ".join(doubts)})' if doubts else ''


class TrackerReporter:
    """
    Publish `/diagnostics` every second, and log rejections and lost parts.

    Parameters
    ----------
    source : str
        What the tracker publishes, for sentences.
    lifetime : float
        A body that is older is reported to be stale [s].

    """

    def __init__(self, node: Node, source: str, lifetime: float) -> None:
        """Advertise `/diagnostics`."""
        self._node, self._source, self._lifetime = node, source, lifetime
        self._n_received, self._n_published, self._n_rejected, self._n_jumps = 0, 0, 0, 0
        self._rejection: RrthError | None = None
        self._is_last_rejected = False
        self._lost: tuple[str, ...] = ()
        self._named: set[str] = set()
        # When the last body that was published was measured [ns].
        self._measured = 0
        self._latencies, self._ages = Figures(), Figures()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(DIAGNOSTICS_PERIOD, self._publish, clock=steady)

    def received(self) -> None:
        """Count a message, or what TF had."""
        self._n_received += 1

    def jumped(self, n_points: int) -> None:
        """Count points that were held back."""
        self._n_jumps += n_points

    def rejected(self, problem: RrthError) -> None:
        """Count and log what no body was published of."""
        self._n_rejected += 1
        self._rejection, self._is_last_rejected = problem, True
        self._node.get_logger().warning(
            f'{self._source} rejected: {problem}', throttle_duration_sec=WARNING_PERIOD
        )

    def published(
        self, measured: int, arrived: int, lost: tuple[str, ...], doubts: tuple[str, ...]
    ) -> None:
        """
        Count a body: when it was measured and had arrived [ns], and which parts it lacks.

        doubts: what the tracker said and is not believed.
        """
        if self._n_published == 0:
            self._node.get_logger().info(f'{self._source}: the first body is published')
        self._n_published += 1
        self._is_last_rejected = False
        self._measured, self._lost = measured, lost
        self._latencies.add((time.time_ns() - arrived) / NANOSECONDS)
        self._ages.add(self._age())
        new = [name for name in lost if name not in self._named]
        if new:
            self._named.update(new)
            self._node.get_logger().warning(
                f'{self._source}: no points of {", ".join(new)}: left out until all are seen'
                f'{because(doubts)}'
            )

    def _age(self) -> float:
        return (self._node.get_clock().now().nanoseconds - self._measured) / NANOSECONDS

    def _publish(self) -> None:
        level, message = self._summary()
        if self._n_received == 0:
            self._node.get_logger().info(message, once=True)
        name = f'{self._node.get_fully_qualified_name().lstrip("/")}: tracking'
        values: dict[str, object] = {
            'frames received': self._n_received,
            'frames published': self._n_published,
            'frames rejected': self._n_rejected,
            'last rejection': self._rejection or '',
            'jumps held back': self._n_jumps,
            'lost parts': ', '.join(self._lost),
            'received to published': self._latencies,
            'age of measurements when published': self._ages,
            'age of the last measurement [s]': f'{self._age():.3f}' if self._measured else '',
        }
        msg = DiagnosticArray(status=[status_to_msg(name, level, message, values)])
        msg.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(msg)

    def _summary(self) -> tuple[bytes, str]:
        """Return level and message."""
        if self._is_last_rejected:
            return DiagnosticStatus.WARN, f'{self._source} rejected: {self._rejection}'
        if not self._measured:
            return DiagnosticStatus.WARN, f'waiting for {self._source}'
        if self._age() > self._lifetime:
            return DiagnosticStatus.STALE, f'{self._source}: {self._age():.3f} s old'
        if self._lost:
            return DiagnosticStatus.WARN, f'lost parts: {", ".join(self._lost)}'
        return DiagnosticStatus.OK, f'{self._n_published} bodies published'
