# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
While the arm moves the wearer may move too: each new body is held against what is left.

It fails closed: whatever goes wrong while a body is judged ends in a stop.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from enum import Enum
from threading import RLock
import time
import traceback

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.collision.certificate import least_clearance
from rrth_planner.collision.world import arm_world
from rrth_planner.execution.executing_motion import ExecutingMotion, FARTHEST_OFF
from rrth_planner.execution.remaining_motion import is_still_free, leads_away
from rrth_planner.model.errors import one_line
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.ros.interface.inputs import Inputs, out_of_sight, RequestError
from rrth_planner.ros.interface.parameters import PlannerParameters
from rrth_planner.ros.interface.publishers import PlanPublishers
from rrth_planner.ros.interface.reporter import Reporter
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.error_codes import ErrorCode
from rrth_planner.ros.monitor.execution_tracker import ExecutionTracker
from rrth_planner.timing.fast_stop import fast_stop

# How often the age of the body is looked at [s].
PERIOD = 0.02
# A body that is judged later than this after it came ends in a stop [s].
LONGEST_WAIT = 0.05
OFF_TRAJECTORY = (
    f'arm is > {FARTHEST_OFF:g} rad from the commanded trajectory: monitoring suspended'
)
# By whether the arm was told last what it is seen to follow.
TURNED = {
    False: 'arm ignored the last commanded motion: monitoring the previous one, which it follows',
    True: 'arm follows the last commanded motion again: monitoring it',
}


class Watch(Enum):
    """What the guard is doing."""

    IDLE = 'no motion'
    WATCHING = 'monitoring'
    BRAKING = 'stopping'
    HOLDING = 'holding'


@dataclass(frozen=True, slots=True, eq=False)
class Stop:
    """
    A stop that was published, for whoever follows it up.

    Parameters
    ----------
    trajectory : Trajectory
    goal : PointingGoal or None
        Of the motion that it ends.
    parameters : PlannerParameters
        Of that motion.
    scene : Scene or None
        The wearer that the stop was proven free of.
    is_again : bool
        Whether to plan for the goal again once the arm rests.
    n_begun : int
        How many motions had begun until then.

    """

    trajectory: Trajectory
    goal: PointingGoal | None
    parameters: PlannerParameters
    scene: Scene | None
    is_again: bool
    n_begun: int


class ExecutionMonitor:
    """
    Stops the arm when what is left of its motion is no longer proven free of the wearer.

    So does any error on the way to that proof, a body that is refused, and one that is judged too
    late. While a stop that is due could not be published it is tried again, and the planner no
    longer counts as alive: an arm that watches over its planner's liveliness then stops by itself.

    Parameters
    ----------
    node : Node
    heard : Inputs
    reporter : Reporter
    publishers : PlanPublishers

    """

    def __init__(
        self, node: Node, heard: Inputs, reporter: Reporter, publishers: PlanPublishers
    ) -> None:
        """Begin with no motion."""
        self._node, self._heard, self._reporter = node, heard, reporter
        self._publishers = publishers
        # The node's own thread does everything but the end, which may come from another one.
        self._lock, self._is_closed = RLock(), False
        self._followed = ExecutionTracker(heard.joints)
        self._goal: PointingGoal | None = None
        self._state = Watch.IDLE
        # Motions that were planned before a brake are of no use after it, nor is a plan for what
        # was stopped once another motion has begun.
        self.n_brakes, self.n_begun = 0, 0
        # Why the arm was stopped last, and why it is to be stopped while no stop is published;
        # since when [s], and whether it may plan again then.
        self.cause = self.due = ''
        self._since, self._is_again = 0.0, True
        # Those of the plan: another margin since then says nothing against its motion.
        self._parameters = reporter.parameters
        self._stops: deque[Stop] = deque(maxlen=10)
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._on_timer, clock=steady)

    @property
    def running(self) -> ExecutingMotion | None:
        """The motion that the arm follows, as far as that is known."""
        return self._followed.motion

    def begin(
        self,
        running: ExecutingMotion,
        goal: PointingGoal,
        parameters: PlannerParameters,
        tell: Callable[[], None],
    ) -> None:
        """Have a motion told, and watch it by the parameters of its plan."""
        with self._lock:
            self._begin(running, goal, parameters, tell)

    def _begin(
        self,
        running: ExecutingMotion,
        goal: PointingGoal,
        parameters: PlannerParameters,
        tell: Callable[[], None],
    ) -> None:
        if self._is_closed:
            raise RequestError(ErrorCode.PREEMPTED, 'the planner is shutting down')
        before = copy(self._followed), self._parameters, self._goal, self._state
        self._followed.begin(running, self._now())
        self._parameters, self._goal, self._state = parameters, goal, Watch.WATCHING
        try:
            tell()
        except Exception:
            self._followed, self._parameters, self._goal, self._state = before
            raise
        self.n_begun += 1

        def look() -> None:
            self._say(Watch.WATCHING, '')
            # The body may have changed since the motion was last looked at.
            self._judge(self._heard.body.value, time.time_ns())

        # From here on the arm moves, whatever is wrong.
        self._supervise(look)

    def close(self) -> None:
        """Stop the arm, since nobody is going to watch it, and watch nothing any more."""
        with self._lock:
            self._is_closed = True
            if self._node.context.ok():
                self.fail('the planner is shutting down', is_again=False)
                if self._state is Watch.BRAKING:
                    self._publishers.flush()
            self._followed.forget()
            self._state = Watch.IDLE

    def _stop_of(self, running: ExecutingMotion, phase: float, now: float) -> ExecutingMotion:
        """Return the soonest stop that is found at once, from where the arm is."""
        # Of a motion that takes over a little later the stop begins then.
        start = running.start_time if phase < 0.0 else now
        stop = fast_stop(running.trajectory, phase, self._parameters.limits)
        return ExecutingMotion(trajectory=stop, start_time=start)

    def on_body(self, body: WearerBody, arrived: int) -> None:
        """Hold a body, which came at a time [ns], against what is left of the motion."""
        self._supervise(lambda: self._judge(body, arrived))

    def take_stops(self) -> list[Stop]:
        """Return the stops that were published since this was asked last."""
        with self._lock:
            stops = list(self._stops)
            self._stops.clear()
        return stops

    def fail(self, why: str, is_again: bool = True) -> None:
        """
        Stop the arm, if it moves, for something that went wrong.

        Parameters
        ----------
        why : str
        is_again : bool
            Whether it may plan again once the arm rests: not after an error, which would come
            again.

        """
        with self._lock:
            if self.running is not None and self._state is Watch.WATCHING:
                self.due, self._is_again, self._since = why, is_again, time.perf_counter()
                self._stop_for_failure()

    def _supervise(self, look: Callable[[], None]) -> None:
        """Have the monitor look; an error of it ends in a stop."""
        try:
            with self._lock:
                look()
        except Exception as problem:
            with suppress(Exception):
                self._node.get_logger().error(traceback.format_exc())
            self.fail(f'the monitor failed, {_named(problem)}', is_again=False)

    def _judge(self, body: WearerBody, arrived: int) -> None:
        """Stop the arm where the rest of its motion is not proven free; the lock is held."""
        begin = time.perf_counter()
        if self.running is None:
            return
        now, parameters = self._now(), self._parameters
        phase = self._phase(now)
        if phase is None or self._state is not Watch.WATCHING:
            return
        why = out_of_sight(self._heard, self._reporter.parameters, now)
        if why:
            self.fail(why)
            return
        scene = scene_of(body.at(now))
        if is_still_free(
            self.running,
            phase,
            parameters.arm,
            scene,
            margin=parameters.margin,
            ray_guard_length=parameters.ray_guard_length,
        ):
            self._reporter.recertified(time.perf_counter() - begin)
        else:
            self._stop(phase, now, scene, arrived)
        waited = self._waited(arrived)
        if waited > LONGEST_WAIT:
            self.fail(
                f'a body was checked {waited:.3f} s after its arrival, expected at most '
                f'{LONGEST_WAIT:g} s'
            )

    def _on_timer(self) -> None:
        """Look after a motion, and say that somebody does."""
        self._supervise(self._look_after)

    def _look_after(self) -> None:
        if self._state is not Watch.IDLE:
            self._look_round()
        if self.due:
            self._stop_for_failure()
        if not self.due:
            self._publishers.assert_liveliness()

    def _look_round(self) -> None:
        """Stop an arm that nobody sees any more, or whose wearer, or that goes on for all that."""
        now = self._now()
        self._insist(now)
        self._look_back()
        phase = self._phase(now)
        if phase is None or self._state is not Watch.WATCHING:
            return
        why = out_of_sight(self._heard, self._reporter.parameters, now)
        if why:
            self.fail(why)

    def _insist(self, now: float) -> None:
        """Stop the arm again where it goes on along the motion that it was to stop."""
        found = self._followed.unstopped(now)
        if found is None:
            return
        before, phase = found
        stop = replace(self._stop_of(before, phase, now), start_time=now)
        self._followed.motion = stop
        self._publishers.publish_motion(stop.trajectory, self._parameters, now)
        self._node.get_logger().error(
            'arm did not follow the commanded stop: stop published again'
        )

    def _look_back(self) -> None:
        """Watch the motion before where the arm goes on with that: its controller refused one."""
        if self._state in (Watch.WATCHING, Watch.BRAKING) and self._followed.look_back():
            self._node.get_logger().error(TURNED[self._followed.is_told])
            self._say(Watch.WATCHING, TURNED[self._followed.is_told])
            self._judge(self._heard.body.value, time.time_ns())

    def _phase(self, now: float) -> float | None:
        """Return the time within the running motion; None where there is none any more."""
        if self._followed.is_over(now):
            self._followed.forget()
            self.due = ''
            if self._state is Watch.BRAKING and not self._reporter.parameters.replan:
                self._say(Watch.HOLDING, self._reporter.guard[1])
            elif self._state is not Watch.HOLDING:
                self._say(Watch.IDLE, '')
            return None
        phase = self._followed.phase(now)
        is_lost = phase is None and self._followed.is_lost(now)
        if is_lost and self._reporter.guard[1] != OFF_TRAJECTORY:
            self._node.get_logger().error(OFF_TRAJECTORY)
            self._say(self._state, OFF_TRAJECTORY)
        return phase

    def _stop(self, phase: float, then: float, scene: Scene, arrived: int) -> None:
        """Stop an arm, that was so far then, for a body in its way; the lock is held."""
        why = 'the remaining motion is not proven free of the wearer'
        # What was looked at since then may have taken its time.
        now = self._now()
        phase += now - then
        running, parameters = self.running, self._parameters
        if running is None or phase >= running.trajectory.duration:
            return
        stopped = self._stop_of(running, phase, now)
        is_safe = is_still_free(
            stopped,
            0.0,
            parameters.arm,
            scene,
            margin=parameters.margin,
            ray_guard_length=parameters.ray_guard_length,
        )
        if not is_safe and leads_away(
            running,
            phase,
            parameters.arm,
            scene,
            margin=parameters.margin,
            ray_guard_length=parameters.ray_guard_length,
        ):
            sentence = f'{why}, but it escapes and a stop would not: motion continues'
            if self._reporter.guard[1] != sentence:
                self._node.get_logger().error(sentence)
            self._say(Watch.WATCHING, sentence)
            return
        self._publish_stop(stopped, why)
        took = self._waited(arrived)
        warning = '' if is_safe else self._warning(stopped.trajectory, scene)
        self._reporter.braked(took)
        self._tell_of_stop(stopped.trajectory, warning, f'; published after {1e3 * took:.2f} ms')
        self._keep(stopped.trajectory, None if warning else scene)

    def _stop_for_failure(self) -> None:
        """Publish the stop that is due, by as little as can be; the lock is held."""
        running = self.running
        if running is None:
            self.due = ''
            return
        try:
            now = self._now()
            phase = self._phase_for_certain(running, now)
            if phase is None:
                return
            if phase >= running.trajectory.duration:
                # It has come to its end.
                self.due = ''
                return
            stopped = self._stop_of(running, phase, now)
            self._publish_stop(stopped, self.due)
        except Exception:
            # It is tried again at the next look, and nobody says that the planner is alive.
            with suppress(Exception):
                self._node.get_logger().error(traceback.format_exc())
            return
        took = time.perf_counter() - self._since
        # What is said of it must not undo it.
        with suppress(Exception):
            self._reporter.braked(took)
            self._tell_of_stop(stopped.trajectory)
            self._keep(stopped.trajectory, None, self._is_again)

    def _keep(self, stop: Trajectory, scene: Scene | None, is_again: bool = True) -> None:
        """Keep a stop for whoever follows it up, and the wearer that it was proven free of."""
        is_again = is_again and self._reporter.parameters.replan
        goal, n_begun = self._goal, self.n_begun
        self._stops.append(Stop(stop, goal, self._parameters, scene, is_again, n_begun))

    def _phase_for_certain(self, running: ExecutingMotion, now: float) -> float | None:
        """Return the time within a motion, whatever is wrong; None where the arm is not on it."""
        try:
            return self._followed.phase(now)
        except Exception:
            # What is told of where the arm is may be what is wrong; it was told to be here.
            return now - running.start_time

    def _publish_stop(self, stop: ExecutingMotion, why: str) -> None:
        """Publish a stop, and follow the arm on that."""
        before = copy(self._followed)
        self._followed.stop(stop)
        try:
            self._publishers.publish_motion(stop.trajectory, self._parameters, stop.start_time)
        except Exception:
            self._followed = before
            raise
        # From here on nothing may fail: the same stop would be published again.
        self._state, self.cause, self.due = Watch.BRAKING, why, ''
        self.n_brakes += 1

    def _tell_of_stop(self, stop: Trajectory, warning: str = '', note: str = '') -> None:
        """Say in log and diagnostics why the arm brakes."""
        sentence = f'{self.cause}: fail-safe stop, at rest in {stop.duration:.2f} s{warning}'
        self._say(Watch.BRAKING, sentence)
        # A line each: rclpy raises where one and the same line logs at another severity.
        if warning:
            self._node.get_logger().error(f'{sentence}{note}')
        else:
            self._node.get_logger().warning(f'{sentence}{note}')

    def _warning(self, stop: Trajectory, scene: Scene) -> str:
        """Return what is to be said of a stop that is not proven free."""
        parameters = self._parameters
        world = arm_world(parameters.arm, scene, 0.0, parameters.ray_guard_length)
        clearance = least_clearance(stop, world)
        return f'; the stop is not proven free either, least clearance {clearance:.4f} m'

    def hold(self, why: str) -> None:
        """Stay where the arm came to rest, since it cannot go on."""
        with self._lock:
            if self._state is Watch.WATCHING:
                # Another motion has begun since then.
                return
            sentence = f'arm holds its position: {why}'
            self._say(Watch.HOLDING, sentence)
            self._node.get_logger().warning(sentence)

    def _say(self, state: Watch, sentence: str) -> None:
        self._state = state
        self._reporter.guard = (state.value, sentence)
        self._reporter.publish_soon()

    def _waited(self, arrived: int) -> float:
        """Return how long ago a body came [ns -> s]."""
        return 1e-9 * (time.time_ns() - arrived)

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9


def _named(problem: Exception) -> str:
    return one_line(f'{type(problem).__name__}: {problem}')
