# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A kinematic arm that is monitored: it stops before the wearer, and knows when to plan again."""

from dataclasses import dataclass, replace

from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.playback import Playback, standing, stop
from rrth_planner.execution.remaining_motion import (
    escapes_by_continuing,
    is_remaining_free,
)
from rrth_planner.model.arrays import Array
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import MotionLimits


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MonitoredArm:
    """
    What the arm does, and the motion that it was given for its present target.

    Parameters
    ----------
    motion : ExecutingMotion or None
        None: none for the present target.

    """

    required: RequiredClearance
    limits: MotionLimits
    playback: Playback
    motion: ExecutingMotion | None = None

    def positions_at(self, time: float) -> Array:
        """Return where the arm is at a time [s], (dof,) [rad]."""
        return self.playback.state_at(time)[0]

    def is_at_rest(self, time: float) -> bool:
        """Return whether the arm has ended its motion at a time [s]."""
        return time >= self.playback.end_time

    def needs_motion(self, scene: Scene, time: float) -> bool:
        """Return whether the arm rests, but not aimed at its target and free of the wearer."""
        if not self.is_at_rest(time):
            return False
        is_stopped = self.motion is None or self.playback.is_stopping
        return is_stopped or not _is_free(self, scene, time)


def arm_at_rest(required: RequiredClearance, q: Array, limits: MotionLimits) -> MonitoredArm:
    """Return an arm that stands still at q, (dof,) [rad], without a target."""
    return MonitoredArm(required=required, limits=limits, playback=standing(q))


def monitored(state: MonitoredArm, scene: Scene, time: float) -> MonitoredArm:
    """Return the arm after a new body: it stops where its remaining motion is not proven free."""
    if state.motion is None or state.playback.is_stopping or state.is_at_rest(time):
        return state
    if _is_free(state, scene, time) or escapes_by_continuing(
        state.motion, time - state.motion.start_time, state.required, scene
    ):
        return state
    return replace(state, playback=stop(state.playback, state.limits, time))


def retargeted(state: MonitoredArm, time: float) -> MonitoredArm:
    """Return the arm once it has another target: it stops, and has no motion for that yet."""
    return replace(state, playback=stop(state.playback, state.limits, time), motion=None)


def started(
    state: MonitoredArm, motion: ExecutingMotion, scene: Scene, time: float
) -> MonitoredArm:
    """Return the arm on a motion from its present place; as it is where that is not free now."""
    playback = Playback(trajectory=motion.trajectory, start_time=motion.start_time, time_scale=1.0)
    moving = replace(state, playback=playback, motion=motion)
    return moving if _is_free(moving, scene, time) else state


def _is_free(state: MonitoredArm, scene: Scene, time: float) -> bool:
    """Return whether the rest of the motion, and its end, are proven free of the wearer."""
    assert state.motion is not None
    phase = min(time - state.motion.start_time, state.motion.trajectory.duration)
    return is_remaining_free(state.motion, phase, state.required, scene)
