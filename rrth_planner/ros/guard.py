# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""While the arm moves the wearer may move too: each new body is held against what is left."""

from collections.abc import Callable
from copy import copy
from enum import Enum
from threading import RLock
import time
import traceback

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rrth_planner.certificate import least_clearance
from rrth_planner.emergency import emergency_stop
from rrth_planner.goal import PointingGoal
from rrth_planner.ros.followed import Followed
from rrth_planner.ros.inputs import Inputs
from rrth_planner.ros.messages import scene_of
from rrth_planner.ros.parameters import PlannerParameters
from rrth_planner.ros.publishers import PlanPublishers
from rrth_planner.ros.reporter import Reporter
from rrth_planner.ros.sight import out_of_sight
from rrth_planner.running_motion import RunningMotion
from rrth_planner.scene import Scene
from rrth_planner.trajectory import Trajectory
from rrth_planner.underway import is_still_free, leads_away
from rrth_planner.world import arm_world

# How often the age of the body is looked at [s].
PERIOD = 0.02
ELSEWHERE = 'the arm is nowhere near the motion that it was told: nothing is guarded'
# By whether the arm was told last what it is seen to follow.
TURNED = {
    False: 'the arm did not take its new motion and goes on with the one before, which is watched',
    True: 'the arm is seen to follow what it was told last, which is watched again',
}


class Watch(Enum):
    """What the guard is doing."""

    IDLE = 'no motion'
    WATCHING = 'watches the motion'
    BRAKING = 'brakes'
    HOLDING = 'holds'


class Guard:
    """
    Stops the arm when what is left of its motion is no longer proven free of the wearer.

    Parameters
    ----------
    node : Node
    heard : Inputs
    reporter : Reporter
    publishers : PlanPublishers
    lock : RLock
        Held while a motion is published.

    """

    def __init__(
        self,
        node: Node,
        heard: Inputs,
        reporter: Reporter,
        publishers: PlanPublishers,
        lock: RLock,
    ) -> None:
        """Begin with no motion."""
        self._node, self._heard, self._reporter = node, heard, reporter
        self._publishers, self._lock = publishers, lock
        self._followed = Followed(heard.joints)
        self._goal: PointingGoal | None = None
        self._state = Watch.IDLE
        # Motions that were planned before a brake are of no use after it, nor is a plan for what
        # was stopped once another motion has begun.
        self.n_brakes, self.n_begun = 0, 0
        # Those of the plan: another margin since then says nothing against its motion.
        self._parameters = reporter.parameters
        # Plans again for a goal, once the arm rests; set by the owner.
        self.plan_again: Callable[[PointingGoal, float], None] = lambda goal, wait: None
        # Has a stop that was published as free judged once more; set by the owner.
        self.judge: Callable[[Trajectory, Scene, PointingGoal, PlannerParameters], None]
        self.judge = lambda *_: None
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(PERIOD, self._on_timer, clock=steady)

    @property
    def running(self) -> RunningMotion | None:
        """The motion that the arm follows, as far as that is known."""
        return self._followed.motion

    def begin(
        self,
        running: RunningMotion,
        goal: PointingGoal,
        parameters: PlannerParameters,
        tell: Callable[[], None],
    ) -> None:
        """Have a motion told, and watch it by the parameters of its plan; the lock is held."""
        before = copy(self._followed)
        self._followed.begin(running, self._now())
        try:
            tell()
        except Exception:
            self._followed = before
            raise
        self._parameters, self._goal = parameters, goal
        self.n_begun += 1
        self._say(Watch.WATCHING, '')
        # The body may have changed since the motion was last looked at.
        self._surely(lambda: self.on_body(time.time_ns()))

    def close(self) -> None:
        """Watch nothing any more."""
        self._followed.forget()

    def _stop_of(self, running: RunningMotion, phase: float) -> Trajectory:
        """Return the soonest stop that is found at once, from where the arm is."""
        return emergency_stop(running.trajectory, phase, self._parameters.limits)

    def on_body(self, arrived: int) -> None:
        """Hold the body, which came at a time [ns], against what is left of the motion."""
        begin = time.perf_counter()
        with self._lock:
            now, parameters = self._now(), self._parameters
            if self.running is None:
                return
            scene = scene_of(self._heard.body.value.at(now))
            phase = self._phase(now)
            if phase is None or self._state is not Watch.WATCHING:
                return
            assert self.running is not None
            if not scene.boxes:
                self._stop(phase, now, scene, 'the body is empty', arrived)
            elif not is_still_free(
                self.running,
                phase,
                parameters.arm,
                scene,
                margin=parameters.margin,
                ray_guard_length=parameters.ray_guard_length,
            ):
                self._stop(phase, now, scene, 'the wearer moved into the way', arrived)
            else:
                self._reporter.recertified(time.perf_counter() - begin)

    def _surely(self, look: Callable[[], None]) -> None:
        """Look at a motion that is under way: whatever is wrong, the next look comes."""
        try:
            look()
        except Exception:
            self._node.get_logger().error(traceback.format_exc())

    def _on_timer(self) -> None:
        if self._state is not Watch.IDLE:
            self._surely(self._look_round)

    def _look_round(self) -> None:
        """Stop an arm that nobody sees any more, or whose wearer, or that goes on for all that."""
        with self._lock:
            now = self._now()
            self._insist(now)
            self._look_back()
            phase = self._phase(now)
            if phase is None or self._state is not Watch.WATCHING:
                return
            why = out_of_sight(self._heard, self._reporter.parameters, now)
            if why:
                scene = scene_of(self._heard.body.value.at(now))
                self._stop(phase, now, scene, why, time.time_ns())

    def _insist(self, now: float) -> None:
        """Stop the arm again where it goes on along the motion that it was to stop."""
        found = self._followed.unstopped(now)
        if found is None:
            return
        before, phase = found
        stop = RunningMotion(trajectory=self._stop_of(before, phase), start_time=now)
        self._followed.motion = stop
        self._publishers.publish_motion(stop.trajectory, self._parameters, now)
        self._node.get_logger().error('the arm did not stop as it was told: it is told again')

    def _look_back(self) -> None:
        """Watch the motion before where the arm goes on with that: its controller refused one."""
        if self._state in (Watch.WATCHING, Watch.BRAKING) and self._followed.look_back():
            self._node.get_logger().error(TURNED[self._followed.is_told])
            self._say(Watch.WATCHING, TURNED[self._followed.is_told])
            self.on_body(time.time_ns())

    def _phase(self, now: float) -> float | None:
        """Return the time within the running motion; None where there is none any more."""
        if self._followed.is_over(now):
            self._followed.forget()
            if self._state is Watch.BRAKING and not self._reporter.parameters.replan:
                self._say(Watch.HOLDING, self._reporter.guard[1])
            elif self._state is not Watch.HOLDING:
                self._say(Watch.IDLE, '')
            return None
        phase = self._followed.phase(now)
        is_lost = phase is None and self._followed.is_lost(now)
        if is_lost and self._reporter.guard[1] != ELSEWHERE:
            self._node.get_logger().error(ELSEWHERE)
            self._say(self._state, ELSEWHERE)
        return phase

    def _stop(self, phase: float, then: float, scene: Scene, why: str, arrived: int) -> None:
        """Publish the braking trajectory of an arm that was so far then; the lock is held."""
        # What was looked at since then may have taken its time.
        now = self._now()
        phase += now - then
        running, parameters, goal = self.running, self._parameters, self._goal
        if running is None or phase >= running.trajectory.duration:
            return
        # Of a motion that takes over a little later the stop begins then.
        start = running.start_time if phase < 0.0 else now
        stopped = RunningMotion(trajectory=self._stop_of(running, phase), start_time=start)
        is_safe = not scene.boxes or is_still_free(
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
            sentence = f'{why}: braking would stay there, going on leads away: the arm goes on'
            if self._reporter.guard[1] != sentence:
                self._node.get_logger().error(sentence)
            self._say(Watch.WATCHING, sentence)
            return
        self._publishers.publish_motion(stopped.trajectory, parameters, start)
        took = 1e-9 * (time.time_ns() - arrived)
        self._followed.stop(stopped)
        self.n_brakes += 1
        warning = '' if is_safe else self._warning(stopped.trajectory, scene)
        sentence = (
            f'{why}: the arm brakes, at rest in {stopped.trajectory.duration:.2f} s{warning}'
        )
        self._say(Watch.BRAKING, sentence)
        self._reporter.braked(took)
        logged = f'{sentence}; published after {1e3 * took:.2f} ms'
        # A line each: rclpy raises where one and the same line logs at another severity.
        if warning:
            self._node.get_logger().error(logged)
        else:
            self._node.get_logger().warning(logged)
        if not warning and goal is not None and len(scene.boxes):
            self.judge(stopped.trajectory, scene, goal, parameters)
        if self._reporter.parameters.replan and goal is not None:
            self.plan_again(goal, stopped.trajectory.duration)

    def _warning(self, stop: Trajectory, scene: Scene) -> str:
        """Return what is to be said of a stop that is not proven free."""
        parameters = self._parameters
        world = arm_world(parameters.arm, scene, 0.0, parameters.ray_guard_length)
        clearance = least_clearance(stop, world)
        return f'; braking is not proven safe either, least clearance {clearance:.4f} m'

    def hold(self, why: str) -> None:
        """Stay where the arm came to rest, since it cannot go on."""
        with self._lock:
            if self._state is Watch.WATCHING:
                # Another motion has begun since then.
                return
            sentence = f'the arm holds where it is: {why}'
            self._say(Watch.HOLDING, sentence)
            self._node.get_logger().warning(sentence)

    def _say(self, state: Watch, sentence: str) -> None:
        self._state = state
        self._reporter.guard = (state.value, sentence)
        self._reporter.publish_soon()

    def _now(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
