# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planner's requests begin with and end in, in virtual time."""

from collections.abc import Callable
import math
from pathlib import Path

from rrth_planner.execution.event import Begin, Hold, Rest, StopsTaken
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.watch import MonitorRules, Stop, Watch
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import RequestError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.status import ErrorCode
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.rehearsal.world import World
from rrth_planner.requests.answer import Answer, answer
from rrth_planner.requests.inputs import InputSnapshot
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.parameters import RequestParameters


class VirtualInputs:
    """The wearer and the arm as the rehearsed node knows them; see `requests.inputs.Inputs`."""

    def __init__(self, world: World) -> None:
        """Look at a world."""
        self._world = world

    def at(
        self, now: float, parameters: RequestParameters, goal: PointingGoal | None = None
    ) -> InputSnapshot:
        """Return the inputs of a plan, or raise RequestError."""
        scene = self.scene_at(now, parameters)
        joints = self.joints_at(now, parameters.joint_timeout)
        if goal is None:
            raise RequestError(ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no target')
        return InputSnapshot(scene, goal, joints)

    def scene_at(self, now: float, parameters: RequestParameters) -> Scene:
        """Return the present wearer [s], or raise RequestError."""
        world = self._world
        if not world.scene.boxes:
            raise RequestError(ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no body yet')
        age, lost = self.body_age(now), world.lost_since(math.inf)
        if lost:
            names = ', '.join(lost)
            raise RequestError(ErrorCode.SENSOR_INFO_STALE, f'the body has lost parts: {names}')
        if 0.0 < parameters.body_timeout < age:
            raise RequestError(ErrorCode.SENSOR_INFO_STALE, f'the body is {age:.3f} s old')
        return world.scene

    def joints_at(self, now: float, timeout: float) -> JointReading:
        """Return the present joint positions [s], or raise RequestError."""
        reading = self.reading
        if reading is None:
            raise RequestError(ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA, 'no joint positions yet')
        if 0.0 < timeout < now - reading.taken:
            age = now - reading.taken
            raise RequestError(ErrorCode.ROBOT_STATE_STALE, f'the joints are {age:.3f} s old')
        return reading

    @property
    def reading(self) -> JointReading | None:
        """The last joint positions, however old."""
        return self._world.reading

    def body_age(self, now: float) -> float:
        """Return how old the wearer is that is known now [s]."""
        return max(0.0, now - self._world.measured)

    def expected_scene(self) -> Scene:
        """Return where moving parts of the wearer will be soon."""
        return self._world.expected()

    def is_wearer_moving(self) -> bool:
        """Return whether a box has moved lately by more than a tracker's noise."""
        return self._world.is_wearer_moving

    def time_until_known(self, steady: float) -> float:
        """Return 0: who is rehearsed comes as a stream of bodies."""
        return 0.0


class MonitorEnd:
    """The virtual monitor as requests see it; see `requests.ends.MotionMonitor`."""

    def __init__(self, world: World) -> None:
        """Execute motions in a world."""
        self._world, self.flight = world, world.monitor.flight

    @property
    def watch(self) -> Watch:
        """What is known of what the arm was given, and of what became of that."""
        return self._world.monitor.watch

    def check_clock(self) -> None:
        """Do nothing: virtual time never steps."""

    def begin(
        self,
        planned: ExecutingMotion,
        goal: PointingGoal,
        parameters: MonitorRules,
        n_stops: int,
        n_faults: int,
        publish: Callable[[], None] = lambda: None,
        joins: float | None = math.inf,
        planned_from: ExecutingMotion | None = None,
    ) -> None:
        """Have a motion executed, or raise RequestError."""
        world = self._world
        at, counts = world.moment(), (n_stops, n_faults)
        world.monitor.begin(Begin(at, planned, goal, parameters, joins, planned_from, *counts))

    def hold(self, until: float) -> ExecutingMotion | None:
        """Return what the arm is commanded, which does not change until a time [s]."""
        self._world.take(Hold(self._world.moment(), until))
        return self.watch.tracked.command

    def take_stops(self) -> list[Stop]:
        """Return the stops since the last call."""
        stops = list(self.watch.stops)
        if stops:
            self._world.take(StopsTaken(self._world.moment()))
        return stops

    def report_hold(self, why: str) -> None:
        """Take note of why the arm stays where it came to rest."""
        self._world.take(Rest(self._world.moment(), why))

    def close(self) -> None:
        """Do nothing: a rehearsal ends in mid-motion."""


class NoPublishers:
    """Nobody looks; see `requests.ends.Publishers`."""

    motion_topic = '/joint_trajectory'

    def has_listener(self) -> bool:
        """Return True: the virtual controller listens."""
        return True

    def prepared(
        self, trajectory: Trajectory, parameters: MonitorRules
    ) -> Callable[[float], None]:
        """Return what shows nothing."""
        return lambda begin: None

    def publish_answer(self, answer: Answer) -> None:
        """Show nothing."""

    def withdraw_whole(self) -> None:
        """Do nothing."""

    def is_view_subscribed(self) -> bool:
        """Return False."""
        return False

    def publish_view(
        self, trajectory: Trajectory, parameters: MonitorRules, scene: Scene, target: Array
    ) -> None:
        """Show nothing."""


class LastWord:
    """
    Keeps what was said last; see `requests.ends.Report`.

    Parameters
    ----------
    code, text : ErrorCode, str
        Of the last request that was reported, or of what became of its goal after a stop.

    """

    def __init__(self, parameters: RequestParameters) -> None:
        """Begin with nothing to say."""
        self.parameters = parameters
        self.code, self.text = ErrorCode.SUCCESS, ''

    def body_used(self, age: float) -> None:
        """Do nothing."""

    def pursued(self, request: int) -> None:
        """Do nothing."""

    def given_up(self, why: str) -> None:
        """Do nothing."""

    def ray_blocked_by(self, box: str) -> None:
        """Do nothing."""

    def nothing_runs(self) -> None:
        """Do nothing."""

    def incident(self, file: Path | None) -> None:
        """Do nothing."""

    def conclude(self, outcome: Outcome) -> None:
        """Keep how a request ended."""
        self.code, self.text = outcome.code, outcome.text

    def revise(self, code: ErrorCode, sentence: str) -> None:
        """Keep how it ended otherwise."""
        self.code, self.text = code, answer(code, sentence)
