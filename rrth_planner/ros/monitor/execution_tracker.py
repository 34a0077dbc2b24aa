# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Localization of the arm on the commanded motion, or on the one before."""

import functools

import numpy as np
from rrth_planner.execution.executing_motion import ExecutingMotion, LONGEST_LAG, phase_of
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.model.trajectory import REST_SPEED, sample, Trajectory
from rrth_planner.ros.interface.inputs import Input

# An arm at rest so long after the end of its motion has arrived; one that is off its motion for so
# long is lost [s].
GRACE = 0.5
# An arm that is further from its motion than this [rad] executes another one where the distance to
# that is less than this share.
ASIDE, NEARER = 0.02, 0.25
# An arm at rest is off what it is commanded where it is further from that than this [rad]. After
# so long its controller holds it, or was started anew: what it commands is where the arm is [s].
OFF_COMMAND, OFF_AFTER = 0.01, 0.3
# Spacing of the samples of a stop [s].
SPACING = 2e-3


def has_missed_stop(
    reading: JointReading, before: ExecutingMotion, stop: ExecutingMotion, delay: float = 0.0
) -> bool:
    """
    Return whether an arm continues a motion in spite of a commanded stop.

    One that executes the stop, however late, is where the stop was at some time until now, even
    where the motion slows down by itself; or not there yet: an arm may lag, or have stopped
    before. delay: the greatest of the controller [s].
    """
    elapsed = reading.taken - stop.start_time
    if elapsed <= LONGEST_LAG + 2.0 * delay:
        return False
    end = min(elapsed, stop.trajectory.duration)
    passed = sample(stop.trajectory, np.linspace(0.0, end, 2 + int(end / SPACING)))[0]
    if np.abs(passed - reading.positions).max(axis=1).min() <= ASIDE:
        return False
    here = phase_of(reading.positions, reading.velocities, before.trajectory)
    begin = _begin_of_stop(before.trajectory, stop.trajectory)
    return here is not None and (begin is None or here[0] > begin)


@functools.lru_cache(maxsize=4)
def _begin_of_stop(before: Trajectory, stop: Trajectory) -> float | None:
    """Return when the motion before a stop passes the begin of that [s]; None: never."""
    begin = phase_of(stop.positions[0], stop.velocities[0], before)
    return None if begin is None else begin[0]


def is_on_other(reading: JointReading, motion: ExecutingMotion, other: ExecutingMotion) -> bool:
    """Return whether an arm is far from its motion, and much nearer to the other one."""
    gap = motion.gap(reading.positions, reading.taken)
    return gap > ASIDE and other.gap(reading.positions, reading.taken) < NEARER * gap


class ExecutionTracker:
    """
    Tracks which commanded motion the arm executes, the last or the previous one, and how far.

    Parameters
    ----------
    joints : Input
        Where the arm is.

    """

    def __init__(self, joints: Input[JointReading | None]) -> None:
        """Begin with no motion."""
        self.motion: ExecutingMotion | None = None
        # What the controller was given last, also after its end; None: that is not known. Since
        # when the arm rests off it [s], how late the controller may be [s], and at which speed
        # the arm rests [rad/s].
        self.command: ExecutingMotion | None = None
        self._off_since: float | None = None
        self._delay, self._rest_speed = 0.0, REST_SPEED
        # Whether that is the last commanded one.
        self.is_latest = True
        self._joints = joints
        # The motion that the present stop ends, and the one that the last motion replaced.
        self._stopped: ExecutingMotion | None = None
        self._previous: ExecutingMotion | None = None
        # When the arm was last found on its motion [s].
        self._last_on_motion = 0.0

    def begin(
        self,
        motion: ExecutingMotion,
        now: float,
        delay: float = 0.0,
        rest_speed: float = REST_SPEED,
    ) -> None:
        """
        Track a motion of a controller that is at most `delay` late, from its beginning [s].

        An arm rests where no joint is faster than a speed [rad/s].
        """
        phase = None if self.is_over(now, rest_speed) else self.phase(now)
        self._previous = None if phase is None else self.motion
        self._command(motion)
        self._stopped, self._delay, self._rest_speed = None, delay, rest_speed
        self.is_latest, self._last_on_motion = True, now

    def replace(self, motion: ExecutingMotion) -> None:
        """Track a motion that continues the present one."""
        self._command(motion)
        self._previous = self._stopped = None

    def stop(self, stop: ExecutingMotion) -> None:
        """Track a stop along the path of the present motion."""
        self._stopped = self.motion
        self._command(stop)

    def repeat_stop(self, stop: ExecutingMotion) -> None:
        """Track a stop that is published again, since the arm continues its motion."""
        self._command(stop)

    def forget(self) -> None:
        """Track nothing any more; the controller holds the end of what it was given last."""
        self.motion = self._stopped = self._previous = None

    def forget_command(self) -> None:
        """Take it that the controller holds the arm where that is."""
        self.command = self._off_since = None

    def check_command(self, now: float, steady: float) -> None:
        """
        Forget the command where the arm has rested off it for a while, by its readings.

        steady: now by a clock that is never set, and does not stand still [s].
        """
        command, reading = self.command, self._joints.value
        if command is None or reading is None:
            return
        lag = LONGEST_LAG + self._delay
        # Joint states that do not come any more are those of an arm that stays.
        taken = max(reading.taken, now - lag)
        is_off = command.deviation(reading.positions, taken, lag) > OFF_COMMAND
        if not is_off or reading.is_moving(now, self._rest_speed):
            self._off_since = None
        elif self._off_since is None:
            self._off_since = steady
        elif steady - self._off_since > OFF_AFTER:
            self.forget_command()

    def commands(self, motion: ExecutingMotion) -> bool:
        """
        Return whether the controller follows a motion by its time, as far as is known.

        Not where the arm is elsewhere: it executes the motion more slowly, or not at all.
        """
        reading = self._joints.value
        return reading is None or motion.follows(
            reading.positions, reading.velocities, reading.taken, LONGEST_LAG + self._delay
        )

    def _command(self, motion: ExecutingMotion) -> None:
        self.motion = self.command = motion
        self._off_since = None

    def shift(self, step: float) -> None:
        """Take all times by a clock that was set forward by a step [s]."""
        is_running = self.command is self.motion
        motions = self.motion, self._stopped, self._previous
        self.motion, self._stopped, self._previous = (m and m.shifted(step) for m in motions)
        self.command = self.motion if is_running else self.command and self.command.shifted(step)
        self._last_on_motion += step

    def is_over(self, now: float, rest_speed: float = REST_SPEED) -> bool:
        """
        Return whether the motion, if there is one, has ended and the arm is at rest.

        There no joint is faster than a speed [rad/s].
        """
        motion, reading = self.motion, self._joints.value
        if motion is None or reading is None:
            return False
        since = now - motion.start_time - motion.trajectory.duration
        return since > GRACE + self._delay and not reading.is_moving(now, rest_speed)

    def phase(self, now: float) -> float | None:
        """Return the time within the motion [s]; None where the arm is not on it."""
        motion, reading = self.motion, self._joints.value
        if motion is None or reading is None:
            return None
        phase = motion.phase(reading.positions, reading.taken, now)
        if phase is not None:
            self._last_on_motion = now
        return phase

    def is_lost(self, now: float) -> bool:
        """Return whether the arm has been off its motion for longer than `GRACE`."""
        return self.motion is not None and abs(now - self._last_on_motion) > GRACE

    def follow_previous(self) -> bool:
        """Track the previous motion where the arm follows that; return whether that is new."""
        motion, before, reading = self.motion, self._previous, self._joints.value
        if motion is None or before is None or reading is None:
            return False
        late = LONGEST_LAG + 2.0 * self._delay
        if reading.taken - motion.start_time <= late or not is_on_other(reading, motion, before):
            return False
        # A stop may pass near the previous motion: then the direction must match, too.
        q, v = reading.positions, reading.velocities
        if self._stopped is not None and phase_of(q, v, before.trajectory) is None:
            return False
        self._command(before)
        self._previous, self._stopped = motion, None
        self.is_latest = not self.is_latest
        return True

    def missed_stop(self, now: float) -> tuple[ExecutingMotion, float] | None:
        """Return the motion that the arm continues in spite of a stop, and the time within it."""
        stop, before, reading = self.motion, self._stopped, self._joints.value
        if stop is None or before is None or reading is None:
            return None
        if not has_missed_stop(reading, before, stop, self._delay):
            return None
        phase = before.phase(reading.positions, reading.taken, now)
        if phase is None or phase >= before.trajectory.duration:
            self._stopped = None
            return None
        return before, phase
