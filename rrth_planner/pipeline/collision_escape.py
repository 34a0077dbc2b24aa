# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The shortest escape of an arm that is in a box of the wearer."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import math

import numpy as np
from rrth_planner.collision.penetration import (
    box_depths,
    DEPTH_TOLERANCE,
    half_widths,
    leads_out,
    LEAST_HALF,
    may_escape,
    N_INTERVALS,
)
from rrth_planner.collision.world import grown, World
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.model.status import PlanStatus
from rrth_planner.model.trajectory import MotionLimits, Trajectory
from rrth_planner.pipeline.rejection import CANCELLED, depth_sentence, Rejection
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.timing.lead_in import LeadIn
from rrth_planner.timing.parameterization import parameterize

# The longest escape [rad or m], and the number of random directions tried.
LONGEST_ESCAPE, N_DIRECTIONS = 1.5, 48
# Spacing of the search for the end of an escape [rad], and how often it is then halved.
SPACING, HALVINGS = 0.03, 6
# Rounds of the sequential program, and sweeps of each solution.
N_ROUNDS, N_SWEEPS = 12, 200
# Pairs of a bar and a box that are further apart do not push [m].
PUSH_DISTANCE = 0.05
STEP = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Escape:
    """
    A straight motion of bars and pointing ray out of boxes grown by the margin.

    Parameters
    ----------
    trajectory : Trajectory
        From rest at the start to rest clear of the boxes.
    sentence : str
        The boxes that bars and ray are in at the start, and how deep the bars are.

    """

    trajectory: Trajectory
    sentence: str

    @property
    def q_end(self) -> Array:
        """The clear end, shape (dof,) [rad]."""
        q: Array = self.trajectory.positions[-1]
        return q

    def lead_in(self, limits: MotionLimits) -> LeadIn:
        """Return it as the lead-in of a path."""
        return LeadIn(trajectory=self.trajectory, speed=0.0, q_stop=self.q_end, allowed=limits)


def plan_escape(
    question: PlanQuestion,
    world: World,
    q_start: Array,
    spares: tuple[float, ...],
    should_stop: Callable[[], bool],
) -> Escape | Rejection:
    """
    Return the shortest straight escape found that is proven, or why there is none.

    Parameters
    ----------
    question : PlanQuestion
    world : World
        Its boxes grown by the margin, its limits those of a motion from q_start.
    q_start : ndarray, shape (dof,)
        Where the arm is, at rest, within those limits and in a box [rad].
    spares : tuple of float
        Clearance beyond the margin to end with; the next where there is no room for one [m].
    should_stop : callable
        Polled; True cancels.

    """
    escape_depth, limits = question.escape_depth, question.limits
    of_bars = box_depths(world, q_start[None], np.zeros(1))[0]
    depths = box_depths(world, q_start)
    deepest = float(of_bars.max())
    sentence = depth_sentence(world, of_bars if deepest > 0.0 else depths, question.margin)
    # The ray has no body: it may be in a box at any depth.
    if not max(0.0, deepest) < escape_depth:
        return Rejection(
            PlanStatus.START_IN_COLLISION,
            f'{sentence}, expected less than {escape_depth:g} m (escape_depth)',
        )
    stuck = np.flatnonzero(~may_escape(world, of_bars.max(axis=0)))
    if len(stuck):
        box = int(stuck[of_bars[:, stuck].max(axis=0).argmax()])
        only = np.where(np.arange(of_bars.shape[1]) == box, of_bars, -np.inf)
        most = max(0.0, float(half_widths(world)[box]) - LEAST_HALF)
        return Rejection(
            PlanStatus.START_IN_COLLISION,
            f'{depth_sentence(world, only, question.margin)}, expected less than {most:.4f} m: '
            'near the middle of a box, or beyond, no side is known to escape to',
        )
    for spare in spares:
        roomy, rng = grown(world, spare), np.random.default_rng(question.seed)
        best, least, longest = None, (True, LONGEST_ESCAPE), LONGEST_ESCAPE
        # The direct solution is mostly the shortest escape.
        for search in (_pushed, _scattered):
            tries = list(search(roomy, q_start, spare, longest, rng, should_stop))
            if should_stop():
                return CANCELLED
            # Preferred are those on which the ray gets nowhere deeper within the wearer either.
            keys = [(_rises(world, q_start, q), float(np.linalg.norm(q - q_start))) for q in tries]
            for i in sorted(range(len(tries)), key=keys.__getitem__):
                if should_stop():
                    return CANCELLED
                if best is not None and keys[i] >= least:
                    break
                trajectory = parameterize(Path(np.stack([q_start, tries[i]])), (), limits)
                if leads_out(trajectory, world, question.margin, trajectory.duration):
                    best, least = trajectory, keys[i]
                    longest = LONGEST_ESCAPE if least[0] else least[1]
                    break
        if best is not None:
            return Escape(
                trajectory=best, sentence=_escape_sentence(world, of_bars, depths[-1], spares[-1])
            )
    return Rejection(
        PlanStatus.START_IN_COLLISION,
        f'{sentence}, and no straight escape is proven free; expected a start clear of the wearer',
    )


def _rises(world: World, q_start: Array, q_end: Array) -> bool:
    """Return whether the depth of the ray in a box that it is in increases on an edge."""
    shares = np.linspace(0.0, 1.0, N_INTERVALS + 1)[:, None]
    deep = box_depths(world, q_start + shares * (q_end - q_start))[:, -1]
    # Where the depth is that of the centre it is greatest.
    deep = np.minimum(deep[:, deep[0] > 0.0], half_widths(world)[deep[0] > 0.0])
    return bool((np.diff(np.maximum(deep, 0.0), axis=0) > DEPTH_TOLERANCE).any())


def _escape_sentence(world: World, of_bars: Array, of_ray: Array, hair: float) -> str:
    """Return the boxes as a sentence, those of the bars with their depths, the deepest first."""
    parts, names = [], world.box_names
    for box in np.argsort(-of_bars.max(axis=0)).tolist():
        bar = int(np.argmax(of_bars[:, box]))
        depth = float(of_bars[bar, box])
        if depth > -hair:
            parts.append(
                f'from box "{names[box]}", penetration depth {max(0.0, depth):.4f} m at '
                f'{world.bar_names[bar]}'
            )
    entered = [f'box "{names[box]}"' for box in np.argsort(-of_ray) if of_ray[box] > -hair]
    if entered:
        parts.append(f'of the {world.bar_names[-1]} from {" and ".join(entered)}')
    return f'escape {" and ".join(parts)}'


def _pushed(
    roomy: World,
    q_start: Array,
    spare: float,
    longest: float,
    rng: np.random.Generator,
    should_stop: Callable[[], bool],
) -> Iterator[Array]:
    """
    Yield the nearest configurations that are free of all boxes.

    Sequential quadratic programming: the depths are taken as linear where the arm has come to, and
    of the configurations that are then free the one nearest to the start is next.
    """
    q = q_start.copy()
    for _ in range(N_ROUNDS):
        if should_stop():
            break
        depths, gradients = _gradients(roomy, q)
        is_near = depths > -PUSH_DISTANCE
        G, s = gradients[is_near], depths[is_near] + 1e-6 + 0.01 * spare
        # Rows g x <= b of the displacement x from the start: the depths, and the joint limits.
        rows = np.concatenate([G, np.eye(len(q)), -np.eye(len(q))])
        bounds = np.concatenate(
            [G @ (q - q_start) - s, roomy.bounds[1] - q_start, q_start - roomy.bounds[0]]
        )
        x = _least(rows, bounds)
        if not np.isfinite(x).all() or np.linalg.norm(x) > longest:
            break
        q = np.clip(q_start + x, *roomy.bounds)
        if roomy.is_valid(q):
            yield q


def _gradients(world: World, q: Array) -> tuple[Array, Array]:
    """Return the depths of all pairs, (n,) [m], and their gradients, (n, dof)."""
    steps = STEP * np.eye(len(q))
    depths = box_depths(world, np.concatenate([q[None], q + steps, q - steps]))
    flat = depths.reshape(len(depths), -1)
    n = len(q)
    return flat[0], ((flat[1 : n + 1] - flat[n + 1 :]) / (2.0 * STEP)).T


def _least(rows: Array, bounds: Array) -> Array:
    """Return the shortest x with rows x <= bounds, by Hildreth's method (1957) on the dual."""
    norms = (rows * rows).sum(axis=1)
    weights, x = np.zeros(len(rows)), np.zeros(rows.shape[1])
    for _ in range(N_SWEEPS):
        change = 0.0
        for i in np.flatnonzero(norms > 1e-12).tolist():
            step = max((rows[i] @ x - bounds[i]) / norms[i], -weights[i])
            weights[i] += step
            x = x - step * rows[i]
            change = max(change, abs(step) * norms[i])
        if change < 1e-9:
            break
    return x


def _scattered(
    roomy: World,
    q_start: Array,
    spare: float,
    longest: float,
    rng: np.random.Generator,
    should_stop: Callable[[], bool],
) -> Iterator[Array]:
    """Yield where the arm is first free along each joint and in random directions."""
    dof = len(q_start)
    random = rng.standard_normal((N_DIRECTIONS, dof))
    shares = np.arange(SPACING, longest, SPACING)
    for direction in np.concatenate([np.eye(dof), -np.eye(dof), random]):
        if should_stop():
            break
        u = direction / np.linalg.norm(direction)
        far = roomy.first_free(q_start, u, shares, HALVINGS)
        if not math.isnan(far):
            yield q_start + far * u
