# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
A planner and a controller in lock-step: latencies are true, and time is no more than a number.

A tracker shows a frame every `period`, each as the wearer was `age` ago. A little later the
planner extends its commitment by it, and that reaches the controller after a random latency. The
controller follows the newest commitment that it has by its stamp; the arm follows the controller
`lag` late.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from rrth_planner.execution.command import ahead, begin_of, continues, lead_in, led, rest_at
from rrth_planner.execution.commitment import (
    Commitment,
    extended,
    first_commitment,
    path_state,
    Separation,
)
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.model.arrays import Array
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import seen_body, SeenBody, SeparationRules
from rrth_planner.model.trajectory import sample, Trajectory

# A motion that has not arrived after so long, or that cannot begin for so long, is not reachable
# now [s].
PATIENCE, BLOCKED = 30.0, 0.5
# An arm so near to the end of its motion has arrived [rad].
NEAR = 1e-3
# Instants that are judged are so far apart [s].
INSTANT = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """
    Who is how late [s].

    Parameters
    ----------
    period : float
        Between two frames.
    age : float
        Of what a frame shows.
    thinking : float
        From a frame to the publication of the new commitment.
    latency : (float, float)
        From then until the controller has it, at random between the two.
    lag : float
        Of the arm behind the controller.

    """

    period: float = 1.0 / 120.0
    age: float = 0.03
    thinking: float = 1e-3
    latency: tuple[float, float] = (1e-3, 1e-2)
    lag: float = 0.01


@dataclass(slots=True, eq=False)
class Controller:
    """The trajectories that a controller got: when each came, and when each begins [s]."""

    place: Array
    came: list[float] = field(default_factory=list)
    begins: list[float] = field(default_factory=list)
    trajectories: list[Trajectory] = field(default_factory=list)

    def give(self, trajectory: Trajectory, begin: float, came: float) -> None:
        """Send it a newer one."""
        # What was sent before, and comes after it, is dropped.
        while self.came and self.came[-1] >= came:
            self.came.pop()
            self.begins.pop()
            self.trajectories.pop()
        self.came.append(came)
        self.begins.append(begin)
        self.trajectories.append(trajectory)

    def states(self, times: Array) -> tuple[Array, Array]:
        """Return what it commands at increasing times, (n, dof) each [rad, rad/s]."""
        q, v = np.repeat(self.place[None], len(times), axis=0), np.zeros((len(times), 4))
        borders = [*np.searchsorted(times, self.came), len(times)]
        for k, (first, last) in enumerate(zip(borders[:-1], borders[1:], strict=True)):
            if first < last:
                since = times[first:last] - self.begins[k]
                q[first:last], v[first:last], _ = sample(self.trajectories[k], since)
        return q, v

    def index_at(self, time: float) -> int:
        """Return which trajectory it follows at a time [s]; -1: none."""
        return int(np.searchsorted(self.came, time, side='right')) - 1


@dataclass(slots=True, eq=False)
class Eyes:
    """
    The wearer as the planner knows him: where each part was seen last, and when.

    Parameters
    ----------
    names : tuple of str
    rows : ndarray, shape (m, 15)
    taken : ndarray, shape (m,)
        When, as far as the planner knows [s].

    """

    names: tuple[str, ...]
    rows: Array
    taken: Array

    def see(self, rows: Array, taken: float, seen: NDArray[np.bool_] | None = None) -> None:
        """Have a frame; parts that are not seen stay where they were."""
        if seen is None:
            self.rows, self.taken = rows, np.full(len(rows), taken)
        else:
            self.rows = np.where(seen[:, None], rows, self.rows)
            self.taken = np.where(seen, taken, self.taken)

    def scene(self) -> Scene:
        """Return the parts as they were seen."""
        return scene_of_rows(self.names, self.rows)

    def body(self, time: float, rules: SeparationRules) -> SeenBody:
        """Return the body at a time [s]."""
        return seen_body(self.scene(), np.maximum(time - self.taken, 0.0).tolist(), rules)


def scene_of_rows(names: Sequence[str], rows: Array) -> Scene:
    """Return a scene of boxes by their names and numbers, (m, 15)."""
    return Scene(tuple(Box.of_row(name, row) for name, row in zip(names, rows, strict=True)))


@dataclass(slots=True, eq=False)
class Planner:
    """
    The planner's part: it gives the controller one commitment after the other.

    Parameters
    ----------
    commitments, messages : list of Commitment, list of Trajectory
        All that were issued, and what the controller got of each: its lead-in, too.
    bodies : list of SeenBody
        As it knew the wearer for each of them.
    message_begin : float
        When the last message begins [s].
    blocked_since : float or None
        Since when the motion cannot begin [s].

    """

    settings: Separation
    timing: Timing
    rng: np.random.Generator
    controller: Controller
    motion: Trajectory | None = None
    begun: float = 0.0
    commitments: list[Commitment] = field(default_factory=list)
    messages: list[Trajectory] = field(default_factory=list)
    bodies: list[SeenBody] = field(default_factory=list)
    is_under_way: bool = False
    message_begin: float = 0.0
    blocked_since: float | None = None

    def begin(self, motion: Trajectory, time: float) -> None:
        """Have a motion that begins where the arm is at rest."""
        self.motion, self.begun = motion, time
        self.is_under_way, self.blocked_since = False, None

    def frame(self, time: float, eyes: Eyes) -> None:
        """Extend the commitment for a frame that comes at a time [s]."""
        assert self.motion is not None
        at, delay = time + self.timing.thinking, self.settings.rules.controller_delay
        begin, start = begin_of(at, delay), at + ahead(delay)
        body = eyes.body(start, self.settings.rules)
        if self.is_under_way:
            found = extended(self.commitments[-1], start, body, self.settings)
        else:
            found = first_commitment(self.motion, start, body, self.settings)
            if not isinstance(found, Commitment) and self.blocked_since is None:
                self.blocked_since = at
        if not isinstance(found, Commitment):
            return
        if self.is_under_way:
            joins = start - self.message_begin
            lead = lead_in(self.messages[-1], joins - (start - begin), joins)
        else:
            lead = rest_at(found.trajectory, start - begin)
        if not continues(lead, found.trajectory):
            # Within a stop: from its end the next one goes on.
            return
        message = led(lead, ExecutingMotion(trajectory=found.trajectory, start_time=start))
        self.is_under_way, self.message_begin = True, message.start_time
        self.commitments.append(found)
        self.messages.append(message.trajectory)
        self.bodies.append(body)
        came = at + self.rng.uniform(*self.timing.latency)
        self.controller.give(message.trajectory, message.start_time, came)

    def is_at_rest(self, time: float) -> bool:
        """Return whether the arm is at rest from a time on if nothing more comes [s]."""
        if not self.is_under_way:
            return True
        end = self.commitments[-1].end_time
        return time > max(end, self.controller.came[-1]) + self.timing.lag

    def has_arrived(self, time: float) -> bool:
        """Return whether the arm is at rest at the end of its motion."""
        if not self.is_under_way or not self.is_at_rest(time):
            return False
        assert self.motion is not None
        last = self.commitments[-1].trajectory.positions[-1]
        return bool(np.abs(last - self.motion.positions[-1]).max() < NEAR)

    def cannot_begin(self, time: float) -> bool:
        """Return whether the motion could not begin for BLOCKED."""
        since = self.blocked_since
        return not self.is_under_way and since is not None and time - since >= BLOCKED

    def progress(self, time: float) -> float:
        """Return where within the motion the newest commitment is at a time [s]."""
        return float(path_state(self.commitments[-1], time)[0]) if self.is_under_way else 0.0

    def place(self) -> Array:
        """Return where the arm comes to rest if nothing more comes (dof,) [rad]."""
        last: Array = (
            self.controller.trajectories[-1].positions[-1]
            if self.controller.trajectories
            else self.controller.place
        )
        return last


def instants(begin: float, end: float) -> Array:
    """Return instants from one time to another [s]."""
    grid: Array = np.arange(begin, end, INSTANT)
    return grid
