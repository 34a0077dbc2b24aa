# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of messages: the base frame, and those of TF where tf2_ros is installed."""

from collections.abc import Callable

import numpy as np
from rclpy.node import Node
from rclpy.time import Time
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError
from rrth_planner.model.rotation import pose_matrix

try:
    import tf2_ros
except ImportError:  # not among the wheels: only the base frame is known then
    tf2_ros = None

# The pose of a frame in the base frame at a time [ns], 0 for the latest one; shape (4, 4) [m], or
# FrameError.
Lookup = Callable[[str, int], Array]


class FrameError(MessageError):
    """A frame that cannot be transformed to the base frame."""


class FrameIsLateError(FrameError):
    """A frame whose pose at that time is not known yet."""


def pose_in_base(frame: str, base_frame: str, lookup: Lookup | None, stamp: int = 0) -> Array:
    """
    Return the pose of a message's frame in the base frame at its stamp [ns], shape (4, 4) [m].

    An empty frame stands for the base frame; without `lookup` any other one is a FrameError.
    """
    if frame in ('', base_frame):
        return np.eye(4)
    if lookup is None:
        raise FrameError(f'frame "{frame}", expected "{base_frame}" or an empty frame')
    return lookup(frame, stamp)


class Frames:
    """The frames of TF, relative to the base frame."""

    def __init__(self, node: Node, base_frame: str) -> None:
        """Subscribe to TF where tf2_ros is installed."""
        self._base_frame = base_frame
        self._buffer = None
        if tf2_ros is not None:
            self._buffer = tf2_ros.Buffer(node=node)
            self._listener = tf2_ros.TransformListener(self._buffer, node)

    @property
    def is_available(self) -> bool:
        """Whether tf2_ros is installed."""
        return self._buffer is not None

    def lookup(self, frame: str, stamp: int) -> Array:
        """Return the pose of a frame in the base frame at a time (`Lookup`)."""
        if self._buffer is None:
            raise FrameError(
                f'frame "{frame}", expected "{self._base_frame}" or an empty frame: '
                'tf2_ros is not installed, so no other frame is known'
            )
        try:
            stamped = self._buffer.lookup_transform(
                self._base_frame, frame, Time(nanoseconds=stamp)
            )
        except tf2_ros.TransformException as problem:
            raise (FrameIsLateError if self._is_late(frame, stamp) else FrameError)(
                f'frame "{frame}", expected a frame that TF can transform to '
                f'"{self._base_frame}": {problem}'
            ) from problem
        t, r = stamped.transform.translation, stamped.transform.rotation
        if not (r.x or r.y or r.z or r.w):
            raise FrameError(f'frame "{frame}": a quaternion of length 0, expected 1 [-]')
        return pose_matrix((t.x, t.y, t.z), (r.x, r.y, r.z, r.w))

    def newest(self, frame: str) -> int:
        """Return when a frame's pose was known last [ns], 0 where it is fixed; or FrameError."""
        assert self._buffer is not None
        try:
            newest = self._buffer.get_latest_common_time(self._base_frame, frame)
        except tf2_ros.TransformException as problem:
            raise FrameError(
                f'frame "{frame}", expected a frame that TF knows: {problem}'
            ) from problem
        return int(newest.nanoseconds)

    def _is_late(self, frame: str, stamp: int) -> bool:
        """Return whether a frame is known, but not yet at a time [ns]."""
        try:
            return self.newest(frame) < stamp
        except FrameError:
            return False
