# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A run as a GIF or an MP4, rendered without a window."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError, RrthError
from rrth_planner.model.scene import Scene
from rrth_planner.simulation.mechanics import usual_mechanics
from rrth_planner.simulation.moving_body import body_of_scenes
from rrth_planner.simulation.physics_model import physics_model, stretch

with suppress(ImportError):
    import imageio.v2 as imageio
    import mujoco

WIDTH, HEIGHT = 640, 480
FORMATS = ('.gif', '.mp4')
# Where the camera looks, from how far [m], and from which side: behind the right shoulder [deg].
CENTER, DISTANCE, AZIMUTH, ELEVATION = (0.15, 0.0, 0.15), 1.9, 35.0, -20.0
TARGET_RADIUS, TARGET_COLOR = 0.025, (0.9, 0.1, 0.1, 1.0)


class NoPicturesError(RrthError):
    """Nothing here can render."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """
    What is seen at an instant.

    Parameters
    ----------
    q : ndarray, shape (dof,)
        [rad or m].
    scene : Scene
        The wearer.
    target : ndarray, shape (3,), or None
        In the base frame [m].

    """

    q: Array
    scene: Scene
    target: Array | None = None


def check_film(file: Path) -> None:
    """Raise RrthError where a film cannot be written to a file."""
    if file.suffix.lower() not in FORMATS:
        raise OptionsError(f'file {file}: expected a name that ends in {" or ".join(FORMATS)}')
    if not file.absolute().parent.is_dir():
        raise OptionsError(f'file {file}: its folder does not exist')
    require('simulation', 'mujoco', 'imageio', 'imageio_ffmpeg')


def write_film(file: Path, arm: ArmModel, frames: Sequence[Frame], fps: float) -> None:
    """
    Write frames, at least one, at a rate [1/s]; parts of the wearer that come and go are left out.

    Raises
    ------
    RrthError
        Another ending than those of `FORMATS`, a missing library, or no OpenGL without a window.

    """
    check_film(file)
    is_gif = file.suffix.lower() == '.gif'
    options = {'duration': 1000.0 / fps, 'loop': 0} if is_gif else {'fps': fps}
    # Its options are those of the format.
    get_writer: Any = imageio.get_writer
    with get_writer(file, **options) as writer:
        for picture in pictures(arm, frames):
            writer.append_data(picture)


def pictures(arm: ArmModel, frames: Sequence[Frame]) -> Iterator[Any]:
    """Give the picture of each frame, (HEIGHT, WIDTH, 3) of 0 to 255; raises NoPicturesError."""
    names = set.intersection(*({box.name for box in frame.scene.boxes} for frame in frames))
    scenes = [
        Scene(tuple(box for box in frame.scene.boxes if box.name in names)) for frame in frames
    ]
    # The order of the first, in all of them.
    places = {box.name: k for k, box in enumerate(scenes[0].boxes)}
    scenes = [Scene(tuple(sorted(s.boxes, key=lambda box: places[box.name]))) for s in scenes]
    down = np.tile([0.0, 0.0, -1.0], (len(scenes), 1))
    body = body_of_scenes(scenes, 1.0, down)
    physics = physics_model(arm, usual_mechanics(arm.dof), body)
    data = mujoco.MjData(physics.model)
    try:
        renderer = mujoco.Renderer(physics.model, HEIGHT, WIDTH)
    except Exception as problem:
        # Of OpenGL, which is missing in many ways.
        raise NoPicturesError(
            f'no OpenGL without a window ({type(problem).__name__}: {problem}), expected a driver '
            'and MUJOCO_GL=egl'
        ) from problem
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = CENTER, DISTANCE
    camera.azimuth, camera.elevation = AZIMUTH, ELEVATION
    with renderer:
        for k, frame in enumerate(frames):
            data.qpos[: arm.dof] = frame.q
            if not physics.is_standing:
                poses = data.qpos[arm.dof :].reshape(-1, 7)
                poses[:, :3] = body.positions[k]
                poses[:, 3:] = np.roll(body.quaternions[k], 1, axis=1)
            stretch(physics, frame.q)
            mujoco.mj_forward(physics.model, data)
            renderer.update_scene(data, camera)
            if frame.target is not None:
                _add_target(renderer.scene, frame.target)
            yield renderer.render()


def _add_target(scene: Any, place: Array) -> None:
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom],
        mujoco.mjtGeom.mjGEOM_SPHERE,
        np.full(3, TARGET_RADIUS),
        np.asarray(place, dtype=np.float64),
        np.eye(3).ravel(),
        np.array(TARGET_COLOR, dtype=np.float32),
    )
    scene.ngeom += 1
