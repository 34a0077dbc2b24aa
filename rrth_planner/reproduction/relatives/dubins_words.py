# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
The six words of Dubins (1957): three arcs or lines from one pose in the plane to another.

A pose is (x, y, heading) [map units, rad], a piece has a curvature, > 0 to the left, and a length.
"""

import math

import numpy as np
from numpy.typing import NDArray
from rrth_planner.model.arrays import Array

# LSL, RSR, LSR, RSL, LRL, RLR: the turns of the three pieces, 1 to the left, 0 straight on.
WORDS = np.array(
    [[1, 0, 1], [-1, 0, -1], [1, 0, -1], [-1, 0, 1], [1, -1, 1], [-1, 1, -1]], dtype=np.float64
)
FULL_TURN = 2.0 * math.pi
# A turn that lacks no more than this of a full one is none [rad].
ROUNDING = 1e-9


def word_pieces(poses_from: Array, poses_to: Array, radius: float) -> Array:
    """
    Return the lengths of the pieces of all words, shape (n, 6, 3); infinite where one is not.

    Parameters
    ----------
    poses_from, poses_to : ndarray, shape (n, 3)
        Where each path begins and ends.
    radius : float
        Of all turns [map units].

    """
    result = np.full((len(poses_to), len(WORDS), 3), np.inf)
    heading_from, heading_to = poses_from[:, 2], poses_to[:, 2]
    for k, (first, middle, last) in enumerate(WORDS):
        centre_from = _centre(poses_from, first * radius)
        between = _centre(poses_to, last * radius) - centre_from
        distance, direction = np.abs(between), np.angle(between)
        if middle == 0.0:
            # The line is a tangent of both circles: on the same side, or across.
            offset = (first - last) * radius
            is_one = distance >= abs(offset)
            straight = np.sqrt(np.maximum(distance**2 - offset**2, 0.0))
            leave = enter = direction + np.arctan2(offset, straight)
            length = straight
        else:
            # The centres are corners of a triangle, two of whose sides are two radii long.
            is_one = distance <= 4.0 * radius
            side = direction + first * np.arccos(np.minimum(distance / (4.0 * radius), 1.0))
            back = np.angle(2.0 * radius * np.exp(1j * side) - between)
            leave, enter = side + first * FULL_TURN / 4, back + first * FULL_TURN / 4
            length = radius * _turn(middle * (enter - leave))
        arcs = [_turn(first * (leave - heading_from)), _turn(last * (heading_to - enter))]
        pieces = np.stack([radius * arcs[0], length, radius * arcs[1]], axis=1)
        result[is_one, k] = pieces[is_one]
    return result


def follow(poses: Array, curvatures: Array, lengths: Array) -> Array:
    """Return the poses at some lengths along pieces, arrays that broadcast: (..., 3)."""
    turns = curvatures * lengths
    chords = lengths * np.sinc(turns / FULL_TURN)
    middle = poses[..., 2] + 0.5 * turns
    x, y = poses[..., 0] + chords * np.cos(middle), poses[..., 1] + chords * np.sin(middle)
    return np.stack([x, y, poses[..., 2] + turns], axis=-1)


def enters(poses: Array, curvatures: Array, lengths: Array, boxes: Array) -> NDArray[np.bool_]:
    """
    Return which pieces enter the inside of a box: exact.

    Between two crossings of lines through the faces a piece is in a box all the way or nowhere,
    so its middle there decides.

    Parameters
    ----------
    poses : ndarray, shape (n, 3)
        Where the pieces begin.
    curvatures, lengths : ndarray, shape (n,)
        [1 / map units], [map units]; an arc is shorter than a full turn.
    boxes : ndarray, shape (m, 2, 2)
        Lower and upper corners [map units].

    """
    places = _crossings(poses[:, None, None], curvatures[:, None, None], boxes)
    ends = lengths[:, None, None]
    places = np.clip(np.where(np.isfinite(places), places, 0.0), 0.0, ends)
    nothing = np.zeros_like(places[..., :1])
    places = np.sort(np.concatenate([nothing, places, nothing + ends], axis=2), axis=2)
    middles = 0.5 * (places[..., 1:] + places[..., :-1])
    points = follow(poses[:, None, None], curvatures[:, None, None], middles)[..., :2]
    lower, upper = boxes[:, None, 0], boxes[:, None, 1]
    is_inside = np.all((points > lower) & (points < upper), axis=-1)
    result: NDArray[np.bool_] = np.any(is_inside, axis=(1, 2))
    return result


def _crossings(poses: Array, curvatures: Array, boxes: Array) -> Array:
    """Return where pieces cross the lines through the faces, (n, m, 8); not finite: nowhere."""
    heading = poses[..., 2]
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = boxes[:, :, 0] - poses[..., 0], boxes[:, :, 1] - poses[..., 1]
    with np.errstate(divide='ignore', invalid='ignore'):
        straight = np.concatenate([x / cos, x / cos, y / sin, y / sin], axis=2)
        # Of an arc the sine of its heading is linear in x, the cosine in y.
        by_x, by_y = np.arcsin(sin + curvatures * x), np.arccos(cos - curvatures * y)
        at = np.concatenate([by_x, 0.5 * FULL_TURN - by_x, by_y, -by_y], axis=2)
        arcs = np.mod(np.sign(curvatures) * (at - heading), FULL_TURN) / np.abs(curvatures)
    return np.where(curvatures == 0.0, straight, arcs)


def _centre(poses: Array, radius: float) -> NDArray[np.complex128]:
    """Return the centres of the circles that turn so, > 0 to the left, as complex numbers."""
    result: NDArray[np.complex128] = (
        poses[:, 0] + 1j * poses[:, 1] + 1j * radius * np.exp(1j * poses[:, 2])
    )
    return result


def _turn(angles: Array) -> Array:
    """Return angles from 0 to a full turn, excluded [rad]."""
    result: Array = np.mod(angles, FULL_TURN)
    return np.where(result > FULL_TURN - ROUNDING, 0.0, result)
