# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Paths of RRT-H made smooth: arcs of one radius, and lines, through their waypoints."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from rrth_planner.kernels.collision.map_validity import CONTACT
from rrth_planner.model.arrays import Array
from rrth_planner.model.path import Path
from rrth_planner.planning import rrt_h
from rrth_planner.planning.deadline import Deadline
from rrth_planner.planning.options import option, RRTHOptions
from rrth_planner.planning.problem import PlanningProblem
from rrth_planner.planning.result import PlanResult
from rrth_planner.reproduction.relatives.dubins_words import (
    enters,
    follow,
    FULL_TURN,
    word_pieces,
    WORDS,
)
from rrth_planner.reproduction.relatives.graph_search import Edge, one_path, shortest_route

# Waypoints within so many radii behind the next one may be reached instead of it: those of one
# corner lie closer together than a turn can follow.
SKIPPED = 4.0
# A word whose radius is halved counts as longer by this, once for each time: no path on a map is.
DETOUR = 1e6
# Of the waypoints along an arc that stand for it in results [rad].
FINEST_TURN = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class DubinsOptions(RRTHOptions):
    """RRT-H, its path then smoothed by the words of Dubins (after Zhou, as the paper cites it)."""

    radius: float = option(5.0, 0.01, 1000.0, 'map', 'of all turns, but for halvings')
    halvings: int = option(
        0, 0, 10, '-', 'how often the radius is halved at most, at a corner where it does not fit'
    )
    n_headings: int = option(8, 1, 360, '-', 'headings that are tried at each waypoint')


def search(
    problem: PlanningProblem, options: DubinsOptions, rng: np.random.Generator, deadline: Deadline
) -> PlanResult:
    """
    Return the smoothed path of RRT-H, as waypoints no further apart than 0.01 rad along arcs.

    Its `raw_path` is the path before smoothing. No path: RRT-H found none, or none through its
    waypoints is free with this radius.
    """
    found = rrt_h.search(problem, options, rng, deadline, ())
    path = found.path
    if path is not None and path.length > 0.0:
        pieces = smooth(path.waypoints, problem, options)
        path = Path(sampled(*pieces)) if len(pieces[0]) else None
    result = one_path(path, found.n_samples, deadline, found.trees)
    return replace(result, raw_path=found.path)


def smooth(
    waypoints: Array, problem: PlanningProblem, options: DubinsOptions
) -> tuple[Array, Array, Array]:
    """
    Return the shortest path of Dubins' words through waypoints that is free, in pieces.

    Its curvature is nowhere greater than 1 / radius, and its heading does not jump. Each word is
    proven free in closed form, and so are the chords that stand for it in results. Shortest: of
    those with the fewest `halvings`, over the headings that are tried, evenly spaced from the
    mean of both edges at the waypoint on; waypoints of one corner may be left out.

    Returns
    -------
    poses : ndarray, shape (k, 3)
        Where each piece begins; empty where no path is free [map units, rad].
    curvatures, lengths : ndarray, shape (k,)
        [1 / map units], [map units].

    """
    poses, walls = _poses(waypoints, options.n_headings), _walls(problem)
    n, last = options.n_headings, len(waypoints) - 1
    radii: Array = options.radius * 0.5 ** np.arange(options.halvings + 1, dtype=np.float64)
    extra = DETOUR * np.repeat(np.arange(len(radii)), len(WORDS))
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(waypoints, axis=0), axis=1)))
    # The waypoints from the next one to this one may be reached.
    ends = np.searchsorted(along, along[1:] + SKIPPED * options.radius, 'right')
    to_goal = np.zeros(last + 1)
    for i in range(last - 1, -1, -1):
        chords = np.linalg.norm(waypoints[i + 1 : ends[i]] - waypoints[i], axis=1)
        to_goal[i] = (chords + to_goal[i + 1 : ends[i]]).min()

    def edges(node: int) -> Iterable[Edge]:
        i = node // n
        others = np.arange((i + 1) * n, ends[i] * n)
        pieces = [word_pieces(poses[[node]], poses[others], radius) for radius in radii]
        totals = np.concatenate(pieces, axis=1).sum(axis=2) + extra
        rows, kinds = np.nonzero(np.isfinite(totals))
        lengths = totals[rows, kinds]
        return zip(others[rows].tolist(), lengths.tolist(), kinds.tolist(), strict=True)

    def is_free(node: int, other: int, kind: int) -> bool:
        pieces = _word(poses[node], poses[other], kind, radii)
        if enters(*pieces, walls).any():
            return False
        # Beside an arc that just clears a corner a chord may not: results are made of chords.
        points = sampled(*pieces)
        return all(map(problem.world.is_edge_valid, points[:-1], points[1:]))

    goals = set(range(last * n, len(poses)))
    bound = np.repeat(to_goal, n).tolist().__getitem__
    steps = shortest_route(range(n), goals, edges, is_free, bound).steps
    words = [
        _word(poses[node], poses[other], kind, radii)
        for (node, _), (other, kind) in zip(steps[:-1], steps[1:], strict=True)
    ]
    if not words:
        return np.empty((0, 3)), np.empty(0), np.empty(0)
    begins, curvatures, lengths = (np.concatenate(parts) for parts in zip(*words, strict=True))
    is_kept = lengths > 0.0
    return begins[is_kept], curvatures[is_kept], lengths[is_kept]


def sampled(poses: Array, curvatures: Array, lengths: Array) -> Array:
    """Return points of pieces, of arcs at most 0.01 rad apart, from first to last, (n, 2)."""
    points = []
    for pose, curvature, length in zip(poses, curvatures, lengths, strict=True):
        n = int(abs(curvature) * length / FINEST_TURN) + 2
        points.append(follow(pose, curvature, np.linspace(0.0, length, n))[:, :2])
    return np.concatenate([points[0][:1], *(part[1:] for part in points)])


def _poses(waypoints: Array, n: int) -> Array:
    """Return n headings at each waypoint, a row a pose, (n * len(waypoints), 3)."""
    steps = np.diff(waypoints, axis=0)
    units = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    means = np.vstack([units[:1], units[:-1] + units[1:], units[-1:]])
    headings = np.arctan2(means[:, 1], means[:, 0])[:, None] + FULL_TURN / n * np.arange(n)
    return np.column_stack([np.repeat(waypoints, n, axis=0), headings.reshape(-1)])


def _walls(problem: PlanningProblem) -> Array:
    """Return the walls of a map and what is beyond its bounds, less contact, (m, 2, 2)."""
    low, high = problem.world.bounds
    size = high - low
    beyond = np.array([[low - size, high + size]] * 4)
    for k in (0, 1):
        beyond[k, 1, k], beyond[2 + k, 0, k] = low[k], high[k]
    walls = np.concatenate([problem.world.obstacles.reshape(-1, 2, 2), beyond])
    return walls + np.array([[CONTACT], [-CONTACT]])


def _word(pose_from: Array, pose_to: Array, kind: int, radii: Array) -> tuple[Array, Array, Array]:
    """Return the pieces of a word, radius by radius: poses (3, 3), curvatures, lengths (3,)."""
    times, word = divmod(kind, len(WORDS))
    lengths = word_pieces(pose_from[None], pose_to[None], radii[times])[0, word]
    curvatures = WORDS[word] / radii[times]
    poses = [pose_from]
    for curvature, length in zip(curvatures[:2], lengths[:2], strict=True):
        poses.append(follow(poses[-1], curvature, length))
    return np.array(poses), curvatures, lengths
