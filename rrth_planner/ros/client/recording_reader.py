# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Read a recorded run from an MCAP file of any recorder, or from the folder of a ros2 bag."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.recording import CommandedMotion, Recording
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import MessageError, RecordError
from rrth_planner.model.scene import Scene
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.client.recording_files import decoder_of, stored_messages
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.body_publishers import BodyPublishers, UNNUMBERED
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import has_joint_of, joint_reading
from rrth_planner.ros.messages.marker_edits import read_edits
from rrth_planner.ros.messages.marker_order import MarkerOrder
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg

# The topics of a run, below whatever namespace, and their types.
TYPES = {
    'body_boxes': 'visualization_msgs/msg/MarkerArray',
    'target': 'geometry_msgs/msg/PointStamped',
    'joint_states': 'sensor_msgs/msg/JointState',
    'joint_trajectory': 'trajectory_msgs/msg/JointTrajectory',
    'diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
}
# A stamp that is further from when the message was sent is of another clock [s].
SAME_CLOCK = 1.0


class RecordedMessage(NamedTuple):
    """A message of a file, with the times of sending and reception [ns]."""

    msg: Any
    sent: int
    received: int


class RecordingReader:
    """
    The messages of a recording, checked as by the nodes; bad ones are left out.

    `rejected` says, by topic, why the last bad one was. Messages in other frames than the
    planner's `base_frame` are. Raises RecordError where a file cannot be read, or holds no run,
    or several and no namespace chooses one.
    """

    def __init__(
        self, path: Path, arm: ArmModel, base_frame: str, namespace: str | None = None
    ) -> None:
        """Read the file."""
        self._path, self._arm, self._base_frame = path, arm, base_frame
        topics, self._begin, self.rejected = _read(path)
        self._topics = {role: self._topic(topics, role, namespace) for role in TYPES}
        self._messages = {
            role: sorted(topics.get(topic or '', ()), key=lambda recorded: recorded.received)
            for role, topic in self._topics.items()
        }

    def recording(self) -> Recording:
        """Return the run."""
        readings = self._readings()
        if not readings:
            raise RecordError(
                f'{self._path}: no joint_states of {list(self._arm.joint_names)}, expected a run '
                'of this arm'
            )
        # Stamps of several publishers may cross.
        times, order = np.unique(
            [reading.taken - self._begin / NANOSECONDS for reading in readings], return_index=True
        )
        positions = np.array([readings[i].positions for i in order])
        velocities = np.array([readings[i].velocities for i in order])
        if not np.isfinite(velocities).all():
            # Where a driver has no velocities they are the differences of the positions.
            changes = np.gradient(positions, times, axis=0) if len(times) > 1 else 0.0 * positions
            velocities = np.where(np.isfinite(velocities), velocities, changes)
        commanded = self._good('joint_trajectory', self._command)
        return Recording(
            times=times,
            positions=positions,
            velocities=velocities,
            commanded=tuple(sorted(commanded, key=lambda motion: motion.begin)),
            bodies=tuple(self._bodies()),
            targets=tuple(self._good('target', self._target)),
            monitor_states=tuple(self._monitor_states()),
        )

    def _topic(
        self, topics: dict[str, list[RecordedMessage]], role: str, namespace: str | None
    ) -> str | None:
        # Diagnostics have one topic for all namespaces.
        if role == 'diagnostics' and '/diagnostics' in topics:
            return '/diagnostics'
        found = sorted(name for name in topics if name.rsplit('/', 1)[-1] == role)
        if namespace is not None:
            wanted = f'/{namespace.strip("/")}/{role}'.replace('//', '/')
            found = [name for name in found if name == wanted]
        if len(found) > 1:
            spaces = ', '.join(name.rsplit('/', 1)[0] or '/' for name in found)
            raise RecordError(
                f'{self._path}: {role} of several runs, expected --namespace with one of {spaces}'
            )
        return found[0] if found else None

    def _good(self, role: str, read: Callable[[RecordedMessage], Any]) -> list[Any]:
        """Return what is read from each message that the nodes would not reject."""
        result = []
        for recorded in self._messages[role]:
            try:
                result.append(read(recorded))
            except MessageError as problem:
                self.rejected[str(self._topics[role])] = str(problem)
        return result

    def _target(self, recorded: RecordedMessage) -> tuple[float, Array]:
        return self._when(recorded), goal_from_msg(recorded.msg, self._base_frame).target

    def _when(self, recorded: RecordedMessage) -> float:
        """Return when a message was sent, on the clock of the recording [s]."""
        return (recorded.sent - self._begin) / NANOSECONDS

    def _readings(self) -> list[JointReading]:
        before: JointReading | None = None
        names = self._arm.joint_names

        def read(recorded: RecordedMessage) -> JointReading | None:
            nonlocal before
            if not has_joint_of(recorded.msg, names):
                return None
            received = recorded.received / NANOSECONDS
            before = joint_reading(recorded.msg, names, received, before, self._arm.is_continuous)
            return before

        return [reading for reading in self._good('joint_states', read) if reading is not None]

    def _command(self, recorded: RecordedMessage) -> CommandedMotion:
        trajectory = joint_trajectory_from_msg(recorded.msg, self._arm.joint_names)
        sent = self._when(recorded)
        stamped = seconds_of(recorded.msg.header.stamp) - self._begin / NANOSECONDS
        return CommandedMotion(stamped if abs(stamped - sent) <= SAME_CLOCK else sent, trajectory)

    def _bodies(self) -> list[tuple[float, Scene]]:
        order, publishers, body = MarkerOrder(), BodyPublishers(), WearerBody()

        def read(recorded: RecordedMessage) -> tuple[float, Scene]:
            nonlocal body
            # By the clock of the stamps.
            now = recorded.received / NANOSECONDS
            edits = read_edits(recorded.msg, now, self._base_frame)
            sent = recorded.sent, UNNUMBERED
            body = order.apply(
                body,
                edits,
                sent,
                now,
                lambda other: other[0] > recorded.sent,
                is_description=publishers.is_description(recorded.msg, sent, now),
            )
            return self._when(recorded), scene_of(body)

        return sorted(self._good('body_boxes', read), key=lambda item: item[0])

    def _monitor_states(self) -> list[tuple[float, str]]:
        """Return the states of the monitor of this run, and since when [s]."""
        said: dict[str, list[tuple[float, str]]] = {}
        for recorded in self._messages['diagnostics']:
            for status in recorded.msg.status:
                values = {item.key: item.value for item in status.values}
                if status.hardware_id == 'rrth_planner' and 'monitor' in values:
                    item = (self._when(recorded), values['monitor'])
                    said.setdefault(status.name.split(':')[0], []).append(item)
        # All planners of a network share the topic.
        topic = self._topics['joint_trajectory'] or self._topics['joint_states'] or ''
        space = topic.rsplit('/', 1)[0].lstrip('/')
        ours = [name for name in said if name.rpartition('/')[0] == space]
        if len(ours) != 1:
            ours = list(said) if len(said) == 1 else []
        return sorted(said[ours[0]]) if ours else []


def _read(path: Path) -> tuple[dict[str, list[RecordedMessage]], int, dict[str, str]]:
    """Return a run by topic, when its first message came [ns], and why messages are left out."""
    topics: dict[str, list[RecordedMessage]] = {}
    rejected: dict[str, str] = {}
    decoders: dict[tuple[str, str, bytes], Callable[[bytes], Any]] = {}
    begin = 0
    for topic, schema, data, sent, received in stored_messages(path):
        begin = min(begin or received, received)
        if TYPES.get(topic.rsplit('/', 1)[-1]) != schema.name:
            continue
        recorded = topics.setdefault(topic, [])
        kind = schema.name, schema.encoding, schema.data
        try:
            if kind not in decoders:
                decoders[kind] = _decoder_of(schema)
            msg = decoders[kind](data)
        except Exception as problem:
            # A publisher may have sent anything: the next messages count.
            rejected[topic] = (
                f'{len(data)} bytes ({problem or type(problem).__name__}), '
                f'expected a {schema.name}'
            )
            continue
        recorded.append(RecordedMessage(msg, sent, received))
    if not topics:
        raise RecordError(
            f'{path}: none of {", ".join(TYPES)} in it, expected an MCAP file of a run, or the '
            'folder of a ros2 bag'
        )
    return topics, begin, rejected


def _decoder_of(schema: Any) -> Callable[[bytes], Any]:
    """Return what decodes messages of a type, or rejects each if its definition is none."""
    try:
        return decoder_of(schema)
    # A file may have anything as definition.
    except Exception as problem:
        sentence = f'unreadable definition: {problem or type(problem).__name__}'

        def reject(data: bytes) -> None:
            raise MessageError(sentence)

        return reject
