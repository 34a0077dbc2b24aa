# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the planner still knows of an arm that moves and of its wearer."""

import numpy as np
from rrth_planner.arrays import Array
from rrth_planner.ros.inputs import Inputs
from rrth_planner.ros.joints import JointReading
from rrth_planner.ros.parameters import PlannerParameters
from rrth_planner.running_motion import RunningMotion
from rrth_planner.takeover import phase_of, REST_SPEED, SAME_POSITION
from rrth_planner.trajectory import positions_at, sample

# An arm stands still where it does not go further than at `REST_SPEED` for this time [s].
STILL = 0.1
# An arm may be so late [s]. It did not hear of a stop where it still has so great a share of its
# motion's pace, when it should have no more than so little.
LATE, FULL, LITTLE = 0.1, 0.9, 0.5


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


def goes_on(reading: JointReading, before: RunningMotion, stop: RunningMotion) -> bool:
    """Return whether an arm is seen to go on along a motion that it was told to stop."""
    elapsed = reading.taken - stop.start_time - LATE
    if elapsed <= 0.0:
        return False
    pace = np.linalg.norm(sample(stop.trajectory, [0.0, elapsed])[1], axis=1)
    if pace[1] > LITTLE * pace[0]:
        return False
    found = phase_of(reading.positions, reading.velocities, before.trajectory)
    return found is not None and found[1] >= FULL


def did_not_take(reading: JointReading, before: RunningMotion, told: RunningMotion) -> bool:
    """Return whether an arm is seen to go on with the motion before, not with what it was told."""
    if reading.taken - told.start_time <= LATE:
        return False
    found = phase_of(reading.positions, reading.velocities, before.trajectory)
    if found is None or (np.abs(reading.velocities) <= REST_SPEED).all():
        return False
    at = told.phase(reading.positions, reading.taken, reading.taken)
    if at is None:
        return True
    gap = np.abs(positions_at(told.trajectory, [at])[0] - reading.positions).max()
    return bool(gap > SAME_POSITION)


def out_of_sight(heard: Inputs, parameters: PlannerParameters, now: float) -> str:
    """Return why nobody knows any more how arm and wearer are; empty: it is known."""
    if not heard.body.value.at(now).n_boxes:
        return 'the body is empty: the lifetime of its boxes has passed'
    age, most = heard.body.age(now), parameters.body_timeout
    if 0.0 < most < age:
        return f'the body is {age:.3f} s old, expected at most {most:g} s (body_timeout)'
    age, most = heard.joints.age(now), parameters.joint_timeout
    if 0.0 < most < age:
        return (
            f'the last joint positions are {age:.3f} s old, expected at most {most:g} s '
            '(joint_timeout)'
        )
    return ''
