# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which commanded motion the arm executes, the last or the one before, and how far."""

from dataclasses import dataclass
import functools
from typing import Any

import numpy as np
from rrth_planner.execution.executing_motion import ExecutingMotion, LONGEST_LAG, phase_of
from rrth_planner.execution.joint_reading import JointReading
from rrth_planner.model.frozen import changed
from rrth_planner.model.trajectory import sample, Trajectory

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


@dataclass(frozen=True, slots=True, eq=False)
class TrackedMotion:
    """
    What the controller was given, and where on it the arm was found.

    Parameters
    ----------
    motion : ExecutingMotion or None
        What the arm executes, as far as known.
    command : ExecutingMotion or None
        What the controller was given last, also after its end; None: that is not known.
    is_latest : bool
        Whether the motion is the last commanded one.
    stopped, previous : ExecutingMotion or None
        The motion that the present stop ends, and the one that the last motion replaced.
    found : float
        When the arm was last found on its motion [s].
    off_since : float or None
        Since when the arm rests off what it is commanded, by a clock that is never set [s].
    delay : float
        How late the controller may be [s].

    """

    motion: ExecutingMotion | None = None
    command: ExecutingMotion | None = None
    is_latest: bool = True
    stopped: ExecutingMotion | None = None
    previous: ExecutingMotion | None = None
    found: float = 0.0
    off_since: float | None = None
    delay: float = 0.0


def track(
    tracked: TrackedMotion,
    motion: ExecutingMotion,
    reading: JointReading | None,
    now: float,
    delay: float = 0.0,
) -> TrackedMotion:
    """Track a motion of a controller that is at most `delay` late, from its beginning [s]."""
    is_left = is_over(tracked, reading, now)
    before = None if is_left or tracked_phase(tracked, reading, now) is None else tracked.motion
    return TrackedMotion(motion, motion, previous=before, found=now, delay=delay)


def track_next(tracked: TrackedMotion, motion: ExecutingMotion) -> TrackedMotion:
    """Track a motion that continues the present one."""
    return _commanded(tracked, motion, previous=None, stopped=None)


def track_stop(tracked: TrackedMotion, stop: ExecutingMotion) -> TrackedMotion:
    """Track a stop along the path of the present motion."""
    return _commanded(tracked, stop, stopped=tracked.motion)


def track_stop_again(tracked: TrackedMotion, stop: ExecutingMotion) -> TrackedMotion:
    """Track a stop that is published again, since the arm continues its motion."""
    return _commanded(tracked, stop)


def track_nothing(tracked: TrackedMotion) -> TrackedMotion:
    """Track nothing any more; the controller holds the end of what it was given last."""
    return changed(tracked, motion=None, stopped=None, previous=None)


def forget_command(tracked: TrackedMotion) -> TrackedMotion:
    """Take it that the controller holds the arm where that is."""
    return changed(tracked, command=None, off_since=None)


def check_command(
    tracked: TrackedMotion, reading: JointReading | None, now: float, steady: float
) -> TrackedMotion:
    """
    Forget the command where the arm has rested off it for a while, by its readings.

    steady: now by a clock that is never set, and does not stand still [s].
    """
    if tracked.command is None or reading is None:
        return tracked
    lag = LONGEST_LAG + tracked.delay
    # Joint states that do not come any more are those of an arm that stays.
    taken = max(reading.taken, now - lag)
    is_off = tracked.command.deviation(reading.positions, taken, lag) > OFF_COMMAND
    if not is_off or reading.is_moving(now):
        return tracked if tracked.off_since is None else changed(tracked, off_since=None)
    if tracked.off_since is None:
        return changed(tracked, off_since=steady)
    return forget_command(tracked) if steady - tracked.off_since > OFF_AFTER else tracked


def commands(
    tracked: TrackedMotion, motion: ExecutingMotion, reading: JointReading | None
) -> bool:
    """
    Return whether the controller follows a motion by its time, as far as is known.

    Not where the arm is elsewhere: it executes the motion more slowly, or not at all.
    """
    return reading is None or motion.follows(
        reading.positions, reading.velocities, reading.taken, LONGEST_LAG + tracked.delay
    )


def shifted(tracked: TrackedMotion, step: float) -> TrackedMotion:
    """Return it by a clock that was set forward by a step [s]."""
    motion = tracked.motion and tracked.motion.shifted(step)
    is_running = tracked.command is tracked.motion
    return changed(
        tracked,
        motion=motion,
        command=motion if is_running else tracked.command and tracked.command.shifted(step),
        stopped=tracked.stopped and tracked.stopped.shifted(step),
        previous=tracked.previous and tracked.previous.shifted(step),
        found=tracked.found + step,
    )


def is_over(
    tracked: TrackedMotion, reading: JointReading | None, now: float, grace: float = GRACE
) -> bool:
    """Return whether the motion, if there is one, ended so long ago [s] and the arm is at rest."""
    motion = tracked.motion
    if motion is None or reading is None:
        return False
    since = now - motion.start_time - motion.trajectory.duration
    return since > grace + tracked.delay and not reading.is_moving(now)


def tracked_phase(
    tracked: TrackedMotion, reading: JointReading | None, now: float
) -> float | None:
    """Return the time within the motion [s]; None where the arm is not on it."""
    if tracked.motion is None or reading is None:
        return None
    return tracked.motion.phase(reading.positions, reading.taken, now)


def find(tracked: TrackedMotion, now: float) -> TrackedMotion:
    """Take note that the arm was found on its motion."""
    return changed(tracked, found=now)


def is_lost(tracked: TrackedMotion, now: float) -> bool:
    """Return whether the arm has been off its motion for longer than `GRACE`."""
    return tracked.motion is not None and abs(now - tracked.found) > GRACE


def track_previous(tracked: TrackedMotion, reading: JointReading | None) -> TrackedMotion:
    """Track the previous motion where the arm follows that; the same where it does not."""
    motion, before = tracked.motion, tracked.previous
    if motion is None or before is None or reading is None:
        return tracked
    late = LONGEST_LAG + 2.0 * tracked.delay
    if reading.taken - motion.start_time <= late or not is_on_other(reading, motion, before):
        return tracked
    # A stop may pass near the previous motion: then the direction must match, too.
    q, v = reading.positions, reading.velocities
    if tracked.stopped is not None and phase_of(q, v, before.trajectory) is None:
        return tracked
    return _commanded(
        tracked, before, previous=motion, stopped=None, is_latest=not tracked.is_latest
    )


def missed_stop(
    tracked: TrackedMotion, reading: JointReading | None, now: float
) -> tuple[TrackedMotion, float | None]:
    """
    Return how far the arm is on the motion that it continues in spite of a stop [s].

    None: it does not. Where it was elsewhere once, it is not judged by that motion again.
    """
    stop, before = tracked.motion, tracked.stopped
    if stop is None or before is None or reading is None:
        return tracked, None
    if not has_missed_stop(reading, before, stop, tracked.delay):
        return tracked, None
    phase = before.phase(reading.positions, reading.taken, now)
    if phase is None or phase >= before.trajectory.duration:
        return changed(tracked, stopped=None), None
    return tracked, phase


def _commanded(tracked: TrackedMotion, motion: ExecutingMotion, **others: Any) -> TrackedMotion:
    return changed(tracked, motion=motion, command=motion, off_since=None, **others)
