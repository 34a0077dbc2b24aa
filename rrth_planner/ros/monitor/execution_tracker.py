# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which motion an arm follows, of those that it was told, and how far it has come."""

import numpy as np
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.localization import phase_of
from rrth_planner.execution.remaining_motion import taken_over
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import REST_SPEED, sample
from rrth_planner.ros.interface.inputs import Input
from rrth_planner.ros.messages.joint_state import JointReading

# An arm that stands still that long after the end of its motion is taken to have arrived; where it
# is nowhere on it for as long, it does something else [s].
GRACE = 0.5
# An arm stands still where it does not go further than at `REST_SPEED` for this time [s].
STILL = 0.1
# An arm that is further from its motion than this [rad], and nearer to another one by so great a
# share, follows that.
ASIDE, NEARER = 0.02, 0.25
# An arm may be so late [s].
LATE = 0.1
# Between two places of a stop that are looked at [s].
SPACING = 2e-3


class Pace:
    """Whether an arm moves, by what it says and by where it is: not every driver says."""

    def __init__(self) -> None:
        """Begin with nothing seen."""
        self._place: Array = np.zeros(0)
        self._then = 0.0

    def is_moving(self, reading: JointReading, now: float) -> bool:
        """Return whether the arm moves, as far as its last readings tell, at a time [s]."""
        q = reading.positions
        if self._place.shape != q.shape or np.abs(q - self._place).max() > REST_SPEED * STILL:
            self._place, self._then = q, now
            return True
        # A clock that was set back tells no time that passed, and NaN is no rest.
        is_fast = not (np.abs(reading.velocities) <= REST_SPEED).all()
        return is_fast or abs(now - self._then) < STILL


def goes_on(reading: JointReading, before: ExecutingMotion, stop: ExecutingMotion) -> bool:
    """
    Return whether an arm is seen to go on along a motion that it was told to stop.

    One that obeys is where the stop was at some time until now, however late it heard of it, and
    wherever the motion slows down by itself; or it is not there yet: an arm may lag, or have
    stopped before it was told to.
    """
    elapsed = reading.taken - stop.start_time
    if elapsed <= LATE:
        return False
    end = min(elapsed, stop.trajectory.duration)
    passed = sample(stop.trajectory, np.linspace(0.0, end, 2 + int(end / SPACING)))[0]
    if np.abs(passed - reading.positions).max(axis=1).min() <= ASIDE:
        return False
    here = phase_of(reading.positions, reading.velocities, before.trajectory)
    begin = phase_of(passed[0], stop.trajectory.velocities[0], before.trajectory)
    return here is not None and (begin is None or here[0] > begin[0])


def is_on_other(reading: JointReading, motion: ExecutingMotion, other: ExecutingMotion) -> bool:
    """Return whether an arm is far from its motion, and much nearer to the other one."""
    gap = motion.gap(reading.positions, reading.taken)
    return gap > ASIDE and other.gap(reading.positions, reading.taken) < NEARER * gap


class ExecutionTracker:
    """
    The motion that an arm was told last, or the one before, as its joint states bear out.

    Parameters
    ----------
    joints : Input
        Where the arm is.

    """

    def __init__(self, joints: Input[JointReading | None]) -> None:
        """Begin with no motion."""
        self.motion: ExecutingMotion | None = None
        # Whether that is what the arm was told last.
        self.is_told = True
        self._joints, self._pace = joints, Pace()
        # What the arm followed when it was told what it follows now: as the way that it stops on,
        # and as the motion that gave way to another one.
        self._stopped: ExecutingMotion | None = None
        self._replaced: ExecutingMotion | None = None
        # When the arm was last where its motion leads [s].
        self._seen = 0.0

    def begin(self, motion: ExecutingMotion, now: float) -> None:
        """Follow a motion from its beginning on, and the present one, if any, until then."""
        phase = None if self.is_over(now) else self.phase(now)
        self._replaced = None if phase is None else self.motion
        if self.motion is not None and phase is not None and now < motion.start_time:
            motion = taken_over(self.motion, phase, motion, now)
        self.motion, self.is_told, self._stopped, self._seen = motion, True, None, now

    def stop(self, stop: ExecutingMotion) -> None:
        """Follow a stop on the way of the present motion."""
        self.motion, self._stopped = stop, self.motion

    def forget(self) -> None:
        """Follow nothing any more."""
        self.motion = self._stopped = self._replaced = None

    def is_over(self, now: float) -> bool:
        """Return whether the motion, if there is one, has ended and the arm is at rest."""
        motion, reading = self.motion, self._joints.value
        if motion is None or reading is None:
            return False
        since = now - motion.start_time - motion.trajectory.duration
        if since <= GRACE - 2.0 * STILL:
            # Whether the arm stands still is not asked yet, and a brake may wait for the answer.
            return False
        is_moving = self._pace.is_moving(reading, now)
        return since > GRACE and not is_moving

    def phase(self, now: float) -> float | None:
        """Return the time within the motion; None where the arm is nowhere on it [s]."""
        motion, reading = self.motion, self._joints.value
        if motion is None or reading is None:
            return None
        phase = motion.phase(reading.positions, reading.taken, now)
        if phase is not None:
            self._seen = now
        return phase

    def is_lost(self, now: float) -> bool:
        """Return whether the arm has been nowhere on its motion for a while."""
        return self.motion is not None and abs(now - self._seen) > GRACE

    def look_back(self) -> bool:
        """Follow the motion before where the arm is seen to do so; return whether that is new."""
        motion, before, reading = self.motion, self._replaced, self._joints.value
        if motion is None or before is None or reading is None:
            return False
        if reading.taken - motion.start_time <= LATE or not is_on_other(reading, motion, before):
            return False
        # A stop may come by the motion before: then the arm must go its way, too.
        q, v = reading.positions, reading.velocities
        if self._stopped is not None and phase_of(q, v, before.trajectory) is None:
            return False
        self.motion, self._replaced, self._stopped = before, motion, None
        self.is_told = not self.is_told
        return True

    def unstopped(self, now: float) -> tuple[ExecutingMotion, float] | None:
        """Return the motion that the arm goes on with although it was stopped, and the time."""
        stop, before, reading = self.motion, self._stopped, self._joints.value
        if stop is None or before is None or reading is None or not goes_on(reading, before, stop):
            return None
        phase = before.phase(reading.positions, reading.taken, now)
        if phase is None or phase >= before.trajectory.duration:
            self._stopped = None
            return None
        return before, phase
