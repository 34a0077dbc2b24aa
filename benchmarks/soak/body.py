# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer who sways, and now and then holds a hand somewhere: where the boxes are, and when."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from threading import Condition, Event, get_native_id, Thread
import time
from typing import Any

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.model.scene import Box, Scene
from visualization_msgs.msg import Marker, MarkerArray

from benchmarks.common.random_draws import random_wearer
from benchmarks.common.real_time import put_ahead

FRAME, RATE = 'torso', 100.0
# A message that is so late counts as on time [s].
LATE = 1e-3
# Greatest displacement along one axis [m], and the speed that no box exceeds [m/s].
SWAY, SPEED = 0.03, 0.05
# The second axis swings slower, so that the body does not come by the same places.
RATIO = 0.7
PULSE = SPEED / (SWAY * np.hypot(1.0, RATIO))
# Limbs follow the trunk so late [rad].
LAG = 0.5
HAND = 'hand'
NO_HAND = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class BodyAt:
    """
    The body of one message.

    Parameters
    ----------
    sent : int
        Just before it was published [ns].
    wearer : int
        Which one; negative: this one, who stands still.
    phase : float
        Time within the sway [s].
    hand : tuple of float
        Centre and side of a cube [m]; side 0: there is none.

    """

    sent: int
    wearer: int
    phase: float
    hand: tuple[float, float, float, float] = NO_HAND


def scene_of_body(body: BodyAt) -> Scene:
    """Return the boxes of a message."""
    base = _wearer(abs(body.wearer))
    offsets = _offsets(len(base.boxes), body.phase if body.wearer > 0 else 0.0)
    boxes = [
        Box(box.name, box.center + offset, box.size, box.rotation)
        for box, offset in zip(base.boxes, offsets, strict=True)
    ]
    *center, side = body.hand
    if side > 0.0:
        boxes.append(Box(HAND, center, [side] * 3, np.eye(3)))
    return Scene(tuple(boxes))


@cache
def _wearer(number: int) -> Scene:
    return random_wearer(np.random.default_rng(number))


def _offsets(n: int, phase: float) -> Array:
    """Return by how much each box is displaced, (n, 3) [m]; the first two are the trunk."""
    angle = PULSE * phase - LAG * (np.arange(n) > 1)
    return SWAY * np.stack([np.sin(angle), np.sin(RATIO * angle), np.zeros(n)], axis=1)


def next_due(due: float, now: float) -> float:
    """
    Return when the message after one that was due at a time, and was sent by now, is due [s].

    Never two in a row: a tracker that was late does not make up for it.
    """
    return (due if now - due <= LATE else now) + 1.0 / RATE


class BodyStream:
    """
    Publishes the body at 100 Hz from a thread of its own, and remembers each message.

    Parameters
    ----------
    publish : callable
        Takes a MarkerArray.
    wearer : int
        As in `BodyAt`, not 0.

    """

    def __init__(self, publish: Callable[[MarkerArray], None], wearer: int) -> None:
        """Begin with a wearer without a hand."""
        self.log: list[BodyAt] = []
        self._publish, self._begin = publish, time.monotonic()
        self._lock, self._end = Condition(), Event()
        self._hand = NO_HAND
        self._thread = Thread(target=self._run, daemon=True)
        self.change(wearer)

    def __enter__(self) -> 'BodyStream':
        """Start to publish."""
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        """Publish no more."""
        self._end.set()
        self._thread.join()

    def change(self, wearer: int) -> None:
        """Be another wearer from the next message on."""
        # Bodies go on to be sent while this one is drawn.
        msg = _message(scene_of_body(BodyAt(0, wearer, 0.0)))
        with self._lock:
            self._wearer, self._msg = wearer, msg

    def put(self, hand: tuple[float, float, float, float]) -> BodyAt:
        """Return the first body with a hand, `NO_HAND` to take it away, once it is sent."""
        with self._lock:
            self._hand = hand
            n_before = len(self.log)
            self._lock.wait_for(lambda: len(self.log) > n_before, timeout=1.0)
            return self.log[n_before]

    def _run(self) -> None:
        # Bodies come of a machine that does nothing else.
        put_ahead(get_native_id())
        due = time.monotonic()
        while not self._end.is_set():
            with self._lock:
                self._publish_body()
            due = next_due(due, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))

    def _publish_body(self) -> None:
        phase = time.monotonic() - self._begin
        boxes = self._msg.markers[:-1]
        base = _wearer(abs(self._wearer)).boxes
        offsets = _offsets(len(boxes), phase if self._wearer > 0 else 0.0)
        for marker, box, offset in zip(boxes, base, offsets, strict=True):
            p = marker.pose.position
            p.x, p.y, p.z = (box.center + offset).tolist()
        hand, side = self._msg.markers[-1], self._hand[3]
        hand.action = Marker.ADD if side > 0.0 else Marker.DELETE
        hand.pose.position.x, hand.pose.position.y, hand.pose.position.z = self._hand[:3]
        hand.scale.x = hand.scale.y = hand.scale.z = side
        body = BodyAt(time.time_ns(), self._wearer, phase, self._hand)
        self._publish(self._msg)
        self.log.append(body)
        self._lock.notify_all()


def _message(scene: Scene) -> MarkerArray:
    markers = []
    for box in (*scene.boxes, Box(HAND, np.zeros(3), np.ones(3), np.eye(3))):
        marker = Marker(ns=box.name, text=box.name, type=Marker.CUBE, action=Marker.ADD)
        marker.header.frame_id = FRAME
        o, scale = marker.pose.orientation, marker.scale
        o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
        scale.x, scale.y, scale.z = box.size.tolist()
        markers.append(marker)
    return MarkerArray(markers=markers)
