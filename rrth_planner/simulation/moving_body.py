# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the parts of the wearer are at any time, and how fast they move."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import SceneError
from rrth_planner.model.rotation import quaternion_xyzw, rotation_matrices
from rrth_planner.model.scene import Box, Scene
from rrth_planner.wearer.body_boxes import base_pose, body_boxes
from rrth_planner.wearer.recorded_person import posture_at, RecordedPerson, resampled
from rrth_planner.wearer.skeleton import Skeleton

# Acceleration of gravity [m/s^2].
GRAVITY = 9.81
# A person is interpolated between postures so often [1/s].
MOST_FRAMES = 120.0
# Slower turns have no axis [rad].
NO_TURN = 1e-12


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MovingBody:
    """
    Parts of the wearer, each a box of constant size, and frames of their poses.

    Between two frames each part moves and turns at a constant velocity. Past the last one they go
    back the same way, and then forwards again, as `recorded_person.posture_at` has it.

    Parameters
    ----------
    names : tuple of str
        Of the parts.
    sizes : ndarray, shape (n, 3)
        Full edge lengths of the boxes [m].
    rate : float
        Frames per second [1/s].
    positions : ndarray, shape (n_frames, n, 3)
        Centres in the base frame [m].
    quaternions : ndarray, shape (n_frames, n, 4)
        Of the boxes in the base frame (x, y, z, w).
    down : ndarray, shape (n_frames, 3)
        Where gravity points in the base frame, of length 1.
    turns : ndarray, shape (n_frames - 1, n, 3)
        From each frame to the next, about an axis that is fixed in both: in the box's own axes,
        times the angle [rad].

    """

    names: tuple[str, ...]
    sizes: Array
    rate: float
    positions: Array
    quaternions: Array
    down: Array
    turns: Array

    @property
    def is_standing(self) -> bool:
        """Whether it never moves."""
        return len(self.positions) == 1


@dataclass(frozen=True, slots=True, eq=False)
class BodyState:
    """
    The parts at an instant, in the base frame.

    Parameters
    ----------
    positions, velocities : ndarray, shape (n, 3)
        Of the centres [m, m/s].
    quaternions : ndarray, shape (n, 4)
        (x, y, z, w).
    spins : ndarray, shape (n, 3)
        Angular velocities, in the boxes' own axes [rad/s].
    gravity : ndarray, shape (3,)
        [m/s^2].

    """

    positions: Array
    velocities: Array
    quaternions: Array
    spins: Array
    gravity: Array


def standing_body(scene: Scene) -> MovingBody:
    """Return a wearer who stands still and upright."""
    return MovingBody(
        names=tuple(box.name for box in scene.boxes),
        sizes=np.array([box.size for box in scene.boxes]).reshape(-1, 3),
        rate=1.0,
        positions=np.array([box.center for box in scene.boxes]).reshape(1, -1, 3),
        quaternions=_quaternions(scene)[None],
        down=np.array([[0.0, 0.0, -1.0]]),
        turns=np.zeros((0, len(scene.boxes), 3)),
    )


def recorded_body(person: RecordedPerson, skeleton: Skeleton) -> MovingBody:
    """
    Return a recorded person as a skeleton makes boxes of him; they keep their least sizes.

    A recording does not say which way is up: it is the axis of its frame that is nearest to what
    is up of him on average. Parts that are lost in a frame are left out.

    Raises
    ------
    SceneError
        The base is lost in a frame, or no part is seen in all of them.

    """
    if person.rate > MOST_FRAMES:
        person = resampled(person, MOST_FRAMES)
    postures = [posture_at(person, k / person.rate) for k in range(len(person.positions))]
    scenes = [body_boxes(skeleton, posture)[0] for posture in postures]
    names = [box.name for box in scenes[0].boxes]
    for scene in scenes[1:]:
        here = {box.name for box in scene.boxes}
        names = [name for name in names if name in here]
    if not names:
        raise SceneError('recording: no part is seen in all of its frames, expected at least one')
    scenes = [Scene(tuple(box for box in s.boxes if box.name in names)) for s in scenes]
    tops = np.array([base_pose(skeleton, posture)[:3, :3] for posture in postures])
    mean = tops[:, :, 2].mean(axis=0)
    axis = int(np.abs(mean).argmax())
    return body_of_scenes(scenes, person.rate, -np.sign(mean[axis]) * tops[:, axis])


def body_of_scenes(scenes: list[Scene], rate: float, down: Array) -> MovingBody:
    """Return a body of its boxes at a rate [1/s], the same ones in each, and where down is."""
    quaternions = np.array([_quaternions(scene) for scene in scenes])
    # From one frame to the next the shorter way round.
    for before, after in zip(quaternions[:-1], quaternions[1:], strict=True):
        after[(before * after).sum(axis=1) < 0.0] *= -1.0
    first = scenes[0].boxes
    return MovingBody(
        names=tuple(box.name for box in first),
        sizes=np.min([[box.size for box in scene.boxes] for scene in scenes], axis=0),
        rate=rate,
        positions=np.array([[box.center for box in scene.boxes] for scene in scenes]),
        quaternions=quaternions,
        down=down,
        turns=_turns(quaternions),
    )


def state_at(body: MovingBody, time: float) -> BodyState:
    """Return where the parts are at a time [s] from the first frame on, and their velocities."""
    if body.is_standing:
        still = np.zeros_like(body.positions[0])
        gravity = GRAVITY * body.down[0]
        return BodyState(body.positions[0], still, body.quaternions[0], still, gravity)
    duration = (len(body.positions) - 1) / body.rate
    folded = time % (2.0 * duration)
    sign = 1.0 if folded < duration else -1.0
    place = min(folded, 2.0 * duration - folded) * body.rate
    i = min(int(place), len(body.positions) - 2)
    share = place - i
    step = body.positions[i + 1] - body.positions[i]
    turn = body.turns[i]
    down = body.down[i] + share * (body.down[i + 1] - body.down[i])
    return BodyState(
        body.positions[i] + share * step,
        sign * body.rate * step,
        _turned(body.quaternions[i], share * turn),
        sign * body.rate * turn,
        GRAVITY * down / np.linalg.norm(down),
    )


def scene_at(body: MovingBody, time: float) -> Scene:
    """Return the boxes of the parts at a time [s], of constant sizes."""
    state = state_at(body, time)
    rotations = rotation_matrices(state.quaternions).reshape(-1, 9)
    rows = np.concatenate([state.positions, body.sizes, rotations], axis=1)
    rows.setflags(write=False)
    return Scene(tuple(Box.of_row(n, row) for n, row in zip(body.names, rows, strict=True)))


def _quaternions(scene: Scene) -> Array:
    rotations = np.array([box.rotation for box in scene.boxes]).reshape(-1, 3, 3)
    return quaternion_xyzw(rotations)


def _turns(quaternions: Array) -> Array:
    """Return the turns that lead from each frame to the next, as axes times angles."""
    between = _product(quaternions[:-1] * [-1.0, -1.0, -1.0, 1.0], quaternions[1:])
    sine = np.linalg.norm(between[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, between[..., 3:])
    slow = sine < NO_TURN
    turns: Array = between[..., :3] * np.where(slow, 2.0, angle / np.where(slow, 1.0, sine))
    return turns


def _turned(quaternions: Array, turns: Array) -> Array:
    """Return quaternions, (n, 4), after turns about their own axes, (n, 3) [rad]."""
    half = 0.5 * np.sqrt((turns * turns).sum(axis=1, keepdims=True))
    # sin(x) / x, which is 1 at 0.
    return _product(
        quaternions,
        np.concatenate([0.5 * np.sinc(half / np.pi) * turns, np.cos(half)], axis=1),
    )


def _product(one: Array, other: Array) -> Array:
    """Return products of quaternions (x, y, z, w), (..., 4)."""
    x, y, z, w = np.moveaxis(one, -1, 0)
    a, b, c, d = np.moveaxis(other, -1, 0)
    # Written out: `np.cross` takes several times as long.
    found = np.empty(one.shape)
    found[..., 0] = w * a + x * d + y * c - z * b
    found[..., 1] = w * b - x * c + y * d + z * a
    found[..., 2] = w * c + x * b - y * a + z * d
    found[..., 3] = w * d - x * a - y * b - z * c
    return found
