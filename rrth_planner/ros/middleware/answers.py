# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Answers of a node's services, a few at a time, and only to clients that can receive them."""

from collections import deque
from collections.abc import Callable
import ctypes
from dataclasses import dataclass
from functools import partial
import struct
import time
import traceback
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Infinite
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, qos_check_compatible, QoSCompatibility, QoSProfile
from rclpy.service import Service
from rclpy.topic_endpoint_info import TopicEndpointInfo

# So many answers of a service leave in such a period [s]: clients keep ten that they have not
# taken yet, those to others included, and a busy machine may not run them for half a second.
MOST_AT_ONCE, SENDING_PERIOD = 2, 0.1
# A client that was not there for so long [s] has left, or was never found.
LONGEST_ABSENCE = 5.0
# Of more answers that wait the first one leaves at once.
MOST_WAITING = 1000
# These send an answer to the reader that a request names; if that is not there, they wait for it
# for 100 ms. Such a reader has this bit in its last byte.
WAITS_FOR_READER, READER_BIT = ('rmw_fastrtps_cpp', 'rmw_fastrtps_dynamic_cpp'), 0x04
# rclpy's header of a request is an object of pybind11, of this size with one pointer to the
# structure of rmw behind Python's own part: identity of the reader, 16 bytes, and a number.
SIZE, REQUEST_ID = 56, struct.Struct('16sq')
# Of the answers.
OFFERED = QoSProfile(
    depth=1,
    deadline=Infinite,
    liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=Infinite,
)
Readers = dict[bytes, dict[str, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class _Answer:
    """One that waits: for which reader (None: not known), and since when, monotonic [s]."""

    reader: bytes | None
    send: Callable[[], None]
    since: float


class _Line:
    """The answers of one service; their clients share a topic, and get those to others, too."""

    def __init__(self, node: Node, service_name: str) -> None:
        """Begin without an answer."""
        self._node, self._topic = node, f'rr{service_name}Reply'
        # The clients of some are not there; they are looked for in each period.
        self._waiting: deque[_Answer] = deque()
        self._absent: deque[_Answer] = deque()
        # To which readers some were sent in this period, and when by the system's clock [ns].
        self._sent: list[tuple[bytes | None, int]] = []
        self._is_fast_dds = rclpy.get_rmw_implementation_identifier() in WAITS_FOR_READER

    def put(self, header: Any, send: Callable[[], None]) -> None:
        """Have an answer to a request sent."""
        reader, asked = reader_of(header), getattr(header, 'received_timestamp', 0)
        self._waiting.append(_Answer(reader, send, time.monotonic()))
        # What was sent to it before it asked, it has taken.
        self._sent = [(r, sent) for r, sent in self._sent if r != reader or sent > asked]
        self._send_some()

    def begin_period(self) -> bool:
        """Send some more; return whether there is anything left to do in the next period."""
        is_used = bool(self._sent or self._waiting or self._absent)
        self._sent.clear()
        self._waiting.extendleft(reversed(self._absent))
        self._absent.clear()
        self._send_some()
        return is_used

    def _send_some(self) -> None:
        """Send what may leave now, and drop what has waited too long for its client."""
        readers: Readers | None = None
        n_gone, present = 0, time.monotonic()
        while self._waiting and (
            len(self._sent) < MOST_AT_ONCE or len(self._waiting) + len(self._absent) > MOST_WAITING
        ):
            answer = self._waiting.popleft()
            if readers is None:
                readers = self._readers()
            if not self._may_send(answer.reader, readers):
                if present - answer.since < LONGEST_ABSENCE and len(self._absent) < MOST_WAITING:
                    self._absent.append(answer)
                else:
                    n_gone += 1
                continue
            self._sent.append((answer.reader, time.time_ns()))
            try:
                answer.send()
            except Exception:
                self._node.get_logger().error(traceback.format_exc())
        if n_gone:
            self._node.get_logger().warning(f'{n_gone} answers to clients that are not there')

    def _may_send(self, reader: bytes | None, readers: Readers) -> bool:
        """Return whether nothing would wait for a reader."""
        if not self._is_fast_dds or reader is None or not reader[-1] & READER_BIT:
            return True
        info = readers.get(reader)
        if info is None:
            return False
        # One of another quality of service is never connected.
        profile = TopicEndpointInfo(**info).qos_profile
        return bool(qos_check_compatible(OFFERED, profile)[0] != QoSCompatibility.ERROR)

    def _readers(self) -> Readers:
        """Return what is known of the readers of these answers, by their identities."""
        with self._node.handle:
            found = rclpy_implementation.rclpy_get_subscriptions_info_by_topic(
                self._node.handle, self._topic, True
            )
        return {bytes(info['endpoint_gid']): info for info in found}


class Answers:
    """
    Sends what services answer, in the node's own thread, which waits for no client.

    Fast DDS waits 100 ms for the reader of a client that has left, and rclpy holds the
    interpreter's lock meanwhile. So an answer leaves once the reader of its client is known to be
    there. `MOST_AT_ONCE` leaves out what a client has taken, since it asked again after it.

    Parameters
    ----------
    node : Node
        All its services, so far, answer by this.

    """

    def __init__(self, node: Node) -> None:
        """Begin without an answer."""
        self._node = node
        self._lines: dict[str, _Line] = {}
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(SENDING_PERIOD, self._on_period, clock=steady)
        self._timer.cancel()
        for service in node.services:
            self._serve(service)

    def put(self, service_name: str, header: Any, send: Callable[[], None]) -> None:
        """Have an answer to a request sent; service_name is the resolved one."""
        if service_name not in self._lines:
            self._lines[service_name] = _Line(self._node, service_name)
        self._lines[service_name].put(header, send)
        if self._timer.is_canceled():
            self._timer.reset()

    def _serve(self, service: Service) -> None:
        send, name = service.send_response, service.service_name
        # Called by whatever executor spins the node.
        service.send_response = lambda response, header: self.put(  # type: ignore[method-assign]
            name, header, partial(send, response, header)
        )

    def _on_period(self) -> None:
        is_used = [line.begin_period() for line in self._lines.values()]
        if not any(is_used):
            self._timer.cancel()


def reader_of(header: Any) -> bytes | None:
    """
    Return the identity of the reader that waits for the answer to a request, 16 bytes.

    None where it is not known: rclpy has it, but no name for it.
    """
    request_id = getattr(header, 'request_id', header)
    kind = rclpy_implementation.rmw_request_id_t
    if not isinstance(request_id, kind) or kind.__basicsize__ != SIZE:
        return None
    address = ctypes.c_void_p.from_address(id(request_id) + object.__basicsize__).value
    if not address:
        return None
    reader, number = REQUEST_ID.unpack(ctypes.string_at(address, REQUEST_ID.size))
    # Of another structure it would be another number.
    return reader if number == request_id.sequence_number else None
