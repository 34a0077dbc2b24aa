# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The exact shortest path on a map of rectangles, a reference for the planners.

It shares nothing with their kernels: a visibility graph of the corners and Dijkstra's
algorithm (Lozano-Perez and Wesley 1979).
"""

import heapq
import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.planning.box_map import BoxMap

# Penetration of a rectangle by a line that still counts as contact, as a share of the map.
CONTACT = 1e-9


def shortest_path(box_map: BoxMap) -> tuple[float, Array]:
    """
    Return the length of the shortest path from start to goal, and its waypoints.

    Contact with a rectangle is allowed, entering it is not; one at the border of the map extends
    beyond it.

    Parameters
    ----------
    box_map : BoxMap
        A map in the plane.

    Returns
    -------
    length : float
        [map units]; infinite where there is no path.
    waypoints : ndarray, shape (n, 2)
        From start to goal; empty where there is no path [map units].

    Raises
    ------
    SceneError
        A map that is not in the plane.

    """
    if box_map.bounds.shape[1] != 2:
        raise SceneError(f'map "{box_map.name}": {box_map.bounds.shape[1]} dimensions, expected 2')
    boxes = extended_obstacles(box_map)
    corners = boxes[:, [[0, 0], [0, 1], [1, 0], [1, 1]], [0, 1]].reshape(-1, 2)
    low, high = box_map.bounds
    corners = corners[((corners >= low) & (corners <= high)).all(axis=1)]
    nodes = np.vstack([box_map.start, box_map.goal, corners])
    first, second = np.triu_indices(len(nodes), k=1)
    is_free = ~enters(nodes[first], nodes[second], boxes)
    distances = np.full((len(nodes), len(nodes)), math.inf)
    lengths = np.linalg.norm(nodes[first] - nodes[second], axis=1)
    distances[first[is_free], second[is_free]] = lengths[is_free]
    distances = np.minimum(distances, distances.T)
    length, route = _dijkstra(distances, 0, 1)
    return length, nodes[route]


def extended_obstacles(box_map: BoxMap) -> Array:
    """Return the boxes of a map, those at its border continued beyond it, shape (m, 2, dof)."""
    boxes, (low, high) = np.array(box_map.obstacles), box_map.bounds
    size = high - low
    boxes[:, 0] -= np.where(boxes[:, 0] <= low, size, 0.0)
    boxes[:, 1] += np.where(boxes[:, 1] >= high, size, 0.0)
    return boxes


def enters(q_from: Array, q_to: Array, boxes: Array) -> NDArray[np.bool_]:
    """
    Return which segments enter the inside of a box, by clipping them against its slabs.

    Parameters
    ----------
    q_from, q_to : ndarray, shape (n, dof)
        Ends of the segments [map units].
    boxes : ndarray, shape (m, 2, dof)
        Lower and upper corners [map units].

    """
    slack = CONTACT * max(1.0, float(np.ptp(boxes)) if boxes.size else 1.0)
    lower, upper = boxes[None, :, 0] + slack, boxes[None, :, 1] - slack
    at, step = q_from[:, None, :], (q_to - q_from)[:, None, :]
    with np.errstate(divide='ignore', invalid='ignore'):
        t0, t1 = (lower - at) / step, (upper - at) / step
    is_still = step == 0.0
    is_between = (at > lower) & (at < upper)
    enter = np.where(is_still, np.where(is_between, -np.inf, np.inf), np.minimum(t0, t1))
    leave = np.where(is_still, np.where(is_between, np.inf, -np.inf), np.maximum(t0, t1))
    first = np.maximum(enter.max(axis=2), 0.0)
    last = np.minimum(leave.min(axis=2), 1.0)
    is_inside: NDArray[np.bool_] = (first <= last).any(axis=1)
    return is_inside


def _dijkstra(distances: Array, source: int, target: int) -> tuple[float, list[int]]:
    """Return the least sum of distances from source to target, and the nodes of that path."""
    best = np.full(len(distances), math.inf)
    best[source] = 0.0
    previous: dict[int, int] = {}
    queue = [(0.0, source)]
    while queue:
        cost, node = heapq.heappop(queue)
        if node == target:
            route = [target]
            while route[-1] != source:
                route.append(previous[route[-1]])
            return float(cost), route[::-1]
        if cost > best[node]:
            continue
        for other in np.flatnonzero(cost + distances[node] < best):
            best[other] = cost + distances[node, other]
            previous[int(other)] = node
            heapq.heappush(queue, (float(best[other]), int(other)))
    return math.inf, []
