# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A course in real time: planner and playback as processes, beside a recorded person."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
import re
from threading import Event, Thread
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.srv import GetPlan
import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rrth_planner.execution.flight_recorder import read_flight, replay, Replayed
from rrth_planner.execution.watch import PlainRules
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RrthError
from rrth_planner.model.scene import Box, Scene
from rrth_planner.rehearsal.rehearsed_wearer import INSTANT, RecordedWearer
from rrth_planner.rehearsal.world import BEGIN
from rrth_planner.requests.answer import Answer
from rrth_planner.ros.messages.answer import answer_from_msg
from rrth_planner.ros.messages.body_writer import body_to_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from benchmarks.common.client import FRAME

# Frames a second [1/s], and how old one is that is published [s].
RATE, AGE = 60.0, 0.015
# The planner's events are saved so often: it keeps 30 s of them [s].
SAVING = 12.0
# Targets are drawn from a box with these corners [m].
LOWEST, HIGHEST = (0.8, -0.6, -0.6), (1.6, 0.6, 0.0)
# A target has so long [s]; the next one is asked for so long after that [s].
LONGEST, PAUSE = 8.0, 0.3
# The share of targets that the next one replaces on the way, and after how long [s].
REPLACED, ON_THE_WAY = 0.25, (0.2, 1.0)
# An arm rests below this [rad/s].
REST = 1e-3
READY, SERVICE = 60.0, 20.0
# Of the planner, for each plan.
SEED = 3
# So much of the person is made ready before the course begins [s].
PREPARED = 20.0


@dataclass(slots=True)
class Course:
    """
    What happened.

    Parameters
    ----------
    events : list of Replayed
        What the planner's monitor decided, decided again.
    asked : list of (float, ndarray)
        When each request was sent [s], and its target, (3,) [m].
    answers : list of Answer
        By their numbers.

    """

    rules: PlainRules
    events: list[Replayed] = field(default_factory=list)
    asked: list[tuple[float, Array]] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)

    def add(self, content: bytes) -> None:
        """Add the events of a flight record that are later than those that are known."""
        last = self.events[-1].event.at.steady if self.events else -np.inf
        self.events += [one for one in replay(read_flight(content)) if one.event.at.steady > last]


class Client(Node):
    """Publishes the body, asks for motions, and saves what the planner records."""

    def __init__(self, wearer: RecordedWearer) -> None:
        """Stand beside the planner."""
        super().__init__('course')
        self._wearer, self._begin = wearer, time.time()
        self._body = self.create_publisher(MarkerArray, 'body_boxes', 5)
        self.create_timer(1.0 / RATE, self._publish)
        self._state: JointState | None = None
        self.answers: dict[int, Answer] = {}
        self.create_subscription(JointState, 'joint_states', self._on_state, 10)
        self.create_subscription(
            DiagnosticStatus, 'rrth_planner/answer', self._on_answer, QoSProfile(depth=200)
        )
        self._plan = self.create_client(GetPlan, 'rrth_planner/get_plan')
        self._save = self.create_client(Trigger, 'rrth_planner/save')

    @property
    def is_ready(self) -> bool:
        """Whether planner and arm are there."""
        return self._plan.service_is_ready() and self._state is not None

    @property
    def is_at_rest(self) -> bool:
        """Whether no joint moves."""
        state = self._state
        return state is not None and float(np.abs(state.velocity).max()) < REST

    def ask(self, target: Array) -> None:
        """Return once a request for a target is answered."""
        goal = PoseStamped()
        goal.header.frame_id = FRAME
        goal.pose.position.x, goal.pose.position.y, goal.pose.position.z = target.tolist()
        self._called(self._plan, GetPlan.Request(goal=goal))

    def save(self) -> bytes:
        """Return what the planner has saved."""
        answer = self._called(self._save, Trigger.Request())
        found = re.search(r'\S+\.flight', answer.message)
        if found is None:
            raise RrthError(f'{answer.message}, expected the name of a flight record')
        return Path(found[0]).read_bytes()

    def _called(self, client: Any, request: Any) -> Any:
        future, is_over = client.call_async(request), Event()
        future.add_done_callback(lambda _: is_over.set())
        if not is_over.wait(SERVICE):
            raise RrthError(f'{client.srv_name}: no answer within {SERVICE:g} s')
        return future.result()

    def _publish(self) -> None:
        measured = time.time() - AGE
        rows = self._wearer.rows_at(BEGIN + measured - self._begin)
        boxes = zip(self._wearer.names, rows, strict=True)
        scene = Scene(tuple(Box.of_row(name, row) for name, row in boxes))
        message = body_to_msg(scene, FRAME)
        seconds, nanoseconds = divmod(int(measured * 1e9), 1_000_000_000)
        for marker in message.markers:
            marker.header.stamp.sec, marker.header.stamp.nanosec = seconds, nanoseconds
        self._body.publish(message)

    def _on_state(self, msg: JointState) -> None:
        self._state = msg

    def _on_answer(self, msg: DiagnosticStatus) -> None:
        answer = answer_from_msg(msg)
        self.answers[answer.number] = answer


def course_of(folder: Path, n: int, seed: int, progress: Callable[[], None]) -> Course:
    """Return what happened while n targets were asked for; files come into a folder."""
    said: list[str] = []
    planner = [
        *('seed', SEED, 'separation', 'true', 'incident_folder', folder),
    ]
    given = [f'{name}:={value}' for name, value in zip(planner[::2], planner[1::2], strict=True)]
    ros = ['--ros-args', *(word for one in given for word in ('-p', one))]
    wearer = RecordedWearer(load_person(None), load_skeleton('cmu_bvh'))
    for k in range(round(PREPARED / INSTANT)):
        # Once made, a place of his takes no time.
        wearer.rows_at(BEGIN + k * INSTANT)
    client, executor = Client(wearer), SingleThreadedExecutor()
    executor.add_node(client)
    with (
        ChildProcess('rrth_planner.ros.planner_node', ros, said.append),
        ChildProcess('rrth_planner.ros.playback_node', [], said.append),
    ):
        spinning = Thread(target=executor.spin, daemon=True)
        spinning.start()
        try:
            return _asked(client, n, np.random.default_rng(seed), progress)
        except RrthError as problem:
            raise RrthError(f'{problem}; the nodes said: {" / ".join(said[-5:])}') from problem
        finally:
            executor.shutdown()
            spinning.join(5.0)
            client.destroy_node()


def _asked(
    client: Client, n: int, rng: np.random.Generator, progress: Callable[[], None]
) -> Course:
    _wait(lambda: client.is_ready, READY, 'planner and arm')
    # Of the wearer something is known by then.
    time.sleep(1.0)
    content = client.save()
    course, saved = Course(read_flight(content).rules[-1]), time.monotonic()
    course.add(content)
    for _ in range(n):
        target = rng.uniform(LOWEST, HIGHEST)
        course.asked.append((time.time(), target))
        client.ask(target)
        is_replaced = rng.random() < REPLACED
        end = time.monotonic() + (float(rng.uniform(*ON_THE_WAY)) if is_replaced else LONGEST)
        rests = 0.0
        while time.monotonic() < end and rests < PAUSE:
            time.sleep(0.02)
            rests = rests + 0.02 if client.is_at_rest else 0.0
            if time.monotonic() - saved > SAVING:
                saved = time.monotonic()
                course.add(client.save())
        progress()
    time.sleep(1.0)
    course.add(client.save())
    course.answers = [client.answers[number] for number in sorted(client.answers)]
    return course


def _wait(condition: Callable[[], bool], longest: float, what: str) -> None:
    end = time.monotonic() + longest
    while not condition():
        if time.monotonic() > end:
            raise RrthError(f'{what}: not there within {longest:g} s')
        time.sleep(0.05)
