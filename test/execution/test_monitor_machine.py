# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Events in any order: what holds of the monitor's memory, and of its commands, after each."""

from dataclasses import replace

from decisions import ARM, BEGIN, DELAY, FAR, GOAL, hand, idle, RULES as AT_ONCE, SEPARATION, turn
from hypothesis import settings, strategies as st
from hypothesis.stateful import initialize, invariant, rule, RuleBasedStateMachine
import numpy as np
from rrth_planner.execution import event as events
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.event import Look, Moment, Sight
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.fail_safe_stop import pending
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.execution.step import following, step_of
from rrth_planner.execution.watch import MonitorState
from rrth_planner.model.errors import RequestError
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import sample, Trajectory

RULES = [
    replace(AT_ONCE, execution=ExecutionRules(None, DELAY, False)),
    replace(AT_ONCE, execution=ExecutionRules(SEPARATION, DELAY, False)),
    replace(AT_ONCE, execution=ExecutionRules(SEPARATION, DELAY, True)),
]
MOTION = turn()
STALE = 'the body is 1.000 s old'
# A message is compared with what it continues where it begins, and a little later [s].
LATER = (0.0, 2e-3, 5e-3)
# So many tenths of a second after whatever happened a motion can begin again.
WAITS = 60
SECONDS = st.floats(0.001, 0.1)


class Monitor(RuleBasedStateMachine):
    """A monitor, and an arm that executes what it is given, or does not."""

    def __init__(self):
        """Begin with no motion."""
        super().__init__()
        self.now, self.scene, self.measured = BEGIN, FAR, BEGIN
        self.q, self.v = MOTION.positions[0], np.zeros(ARM.dof)
        # What the arm executes.
        self.motion, self.follows = None, True
        self.is_stale = False

    @initialize(rules=st.sampled_from(RULES))
    def start(self, rules):
        """Choose the rules, and see the wearer."""
        self.rules, self.watch = rules, idle(rules)
        self.see(FAR)

    def state_at(self, motion, time):
        """Return where a motion is at a time [s]."""
        phase = min(max(time - motion.start_time, 0.0), motion.trajectory.duration)
        return [row[0] for row in sample(motion.trajectory, [phase])[:2]]

    def at(self):
        """Return the present."""
        if self.motion is not None and self.follows:
            self.q, self.v = self.state_at(self.motion, self.now)
        reading = JointReading(self.q, self.v, self.now, self.now, float('inf'))
        overdue = STALE if self.is_stale and self.watch.running is not None else ''
        return Moment(
            now=self.now, steady=self.now, reading=reading, rules=self.rules, overdue=overdue
        )

    def take(self, event, is_published=True):
        """Take an event, and all that follows at once."""
        before, sent = self.watch, []

        def publish(command):
            if not is_published:
                raise ConnectionError('no middleware')
            sent.append(command)

        try:
            step = step_of(before, event, lambda: 0.0, publish)
        except RequestError:
            raise
        except Exception:
            # As the node does after any error.
            self.watch = pending(before, events.Fail(event.at, 'an error', False, True))
            return
        self.watch = step.decision.watch
        for command in sent:
            self.publish(command)
        for happens in following(step, self.at, self.look, lambda: 0.0):
            self.take(happens(), is_published)

    def look(self, at):
        """Return the wearer beside the running motion."""
        return Look(self.scene, Scene(()), 0.0)

    def publish(self, command):
        """Have the arm take a command, which continues the one before where it follows that."""
        curve = command.motion.trajectory
        assert not curve.velocities[-1].any()
        assert not curve.accelerations[-1].any()
        assert np.isfinite(curve.positions).all()
        if self.motion is not None and self.follows and command.begin > 0.0:
            for later in LATER:
                # Until it leaves what was commanded.
                time = command.begin + later
                if time > self.now + DELAY:
                    continue
                q, v = self.state_at(command.motion, time)
                q_before, v_before = self.state_at(self.motion, time)
                assert np.abs(q - q_before).max() <= 1e-6
                assert np.abs(v - v_before).max() <= 2e-4
        self.motion = command.motion

    def is_over(self):
        """Return whether the motion has come to its end."""
        running = self.watch.running
        return self.now >= running.start_time + running.trajectory.duration

    def see(self, scene):
        """Have a body come now."""
        self.scene = scene
        sight = Sight(scene, np.full(len(scene.boxes), self.now))
        look = Look(scene, Scene(()), 0.0) if self.watch.running is not None else None
        self.take(events.BodyCame(self.at(), sight, look))

    def begin(self):
        """Begin the way there, or back, at rest; return whether it does."""
        command = self.watch.tracked.command
        # From where it is commanded to be, as far as that is known.
        q = self.q if command is None else command.trajectory.positions[-1]
        gaps = np.abs(MOTION.positions - q).max(axis=1)
        positions = np.array([q, MOTION.positions[int(gaps.argmax())]])
        still = np.zeros_like(positions)
        curve = Trajectory(MOTION.times, positions, still, still)
        planned = ExecutingMotion(trajectory=curve, start_time=self.now + DELAY + 0.0025)
        counts = self.watch.n_stops, self.watch.n_faults
        event = events.Begin(self.at(), planned, GOAL, self.rules, float('inf'), None, *counts)
        before = self.motion
        try:
            self.motion = None
            self.take(event)
        except RequestError:
            self.motion = before
            return False
        self.follows = True
        return True

    @rule(seconds=SECONDS)
    def tick(self, seconds):
        """Have time pass, and the inputs checked."""
        self.now += seconds
        self.take(events.Tick(self.at()))

    @rule(seconds=SECONDS, is_near=st.booleans(), phase=st.floats(0.2, 1.3))
    def body(self, seconds, is_near, phase):
        """Have a body come, with a hand in the way or not."""
        self.now += seconds
        self.see(hand(MOTION, phase) if is_near else FAR)

    @rule()
    def begins(self):
        """Begin a motion, where the arm rests."""
        at = self.at()
        if not self.v.any() and not self.watch.is_active(at.now):
            self.begin()

    @rule(is_fault=st.booleans(), is_published=st.booleans())
    def fail(self, is_fault, is_published):
        """Have something fail; maybe the middleware does, too."""
        event = events.Fail(self.at(), 'of the test', not is_fault, is_fault)
        self.take(event, is_published)

    @rule(step=st.sampled_from([0.0, 0.5]))
    def clock(self, step):
        """Set the clock forward; a controller by the same clock jumps along its motion."""
        self.now += step
        before, self.motion = self.motion, None
        self.take(events.ClockStepped(self.at(), step, 'the clock was set'))
        if self.motion is None:
            self.motion = before and before.shifted(step)

    @rule(is_stale=st.booleans())
    def inputs(self, is_stale):
        """Have inputs that are too old, or new again."""
        self.is_stale = is_stale

    @rule()
    def ignores(self):
        """Have the arm stay where it is, whatever it is given, until a motion begins."""
        self.follows, self.v = False, np.zeros(ARM.dof)

    @rule(took=st.floats(0.0, 0.05))
    def took(self, took):
        """Have a commitment take its time."""
        self.take(events.CommitmentTook(self.at(), took))

    @rule(seconds=SECONDS)
    def hold(self, seconds):
        """Have a handover be planned."""
        self.take(events.Hold(self.at(), self.now + seconds))

    @rule(name=st.sampled_from(['Reset', 'StopsTaken', 'NobodyListens']))
    def other(self, name):
        """Have something else happen."""
        self.take(getattr(events, name)(self.at()))

    @rule()
    def rest(self):
        """Have the arm stay where it came to rest."""
        self.take(events.Rest(self.at(), 'of the test'))

    @invariant()
    def is_consistent(self):
        """Look whether the memory is one value, and says one thing."""
        watch = getattr(self, 'watch', None)
        if watch is None:
            return
        if watch.state is MonitorState.MONITORING:
            assert watch.running is not None
        if watch.state is MonitorState.IDLE:
            assert watch.running is None
        if watch.commitments.is_active:
            assert watch.running is not None
            assert watch.rules.execution.separation is not None
        if watch.pending is not None:
            assert watch.is_monitoring

    def teardown(self):
        """From everywhere a reset, and rest, lead to a motion again."""
        if getattr(self, 'watch', None) is None:
            return
        self.is_stale = False
        self.take(events.Fail(self.at(), 'of the test', False, False))
        assert not self.watch.is_monitoring or self.is_over()
        self.take(events.Reset(self.at()))
        for _ in range(WAITS):
            self.now += 0.1
            self.take(events.Tick(self.at()))
            self.see(FAR)
            if not self.watch.is_active(self.now) and self.begin():
                break
        assert self.watch.is_monitoring


TestMonitor = Monitor.TestCase
TestMonitor.settings = settings(max_examples=100, stateful_step_count=40, derandomize=True)
