# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer's body from a YAML file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.arrays import FARTHEST, frozen_array
from rrth_planner.entries import mapping, printable
from rrth_planner.errors import SceneError, shown
from rrth_planner.resources import resource_path
from rrth_planner.rotation import rotation_matrix
from rrth_planner.scene import Box, Scene
from rrth_planner.text_files import load_yaml

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
# Shorter quaternions are none.
SHORTEST = 1e-6


def scene_from_mapping(data: Any) -> Scene:
    """
    Return the wearer that a mapping describes, laid out as `config/body.yaml`.

    Parameters
    ----------
    data : mapping
        `boxes`: a list of mappings with `name`, `center` and full `size` [m], and, where a box is
        turned, its `quaternion_xyzw`.

    Raises
    ------
    SceneError
        Anything else, or a box that is none.

    """
    boxes = data.get('boxes') if isinstance(data, Mapping) else None
    if not isinstance(boxes, list) or not boxes:
        raise SceneError(f'body: {shown(data)}, expected a mapping with a list of boxes')
    return Scene(tuple(_box(f'box {k}', box) for k, box in enumerate(boxes)))


def load_body(path: str | Path | None = None) -> Scene:
    """
    Return the wearer that a YAML file describes; None: the packaged one, `config/body.yaml`.

    Raises
    ------
    ModelError, SceneError
        The file cannot be read, or describes no body.

    """
    file = Path(path) if path else resource_path('config/body.yaml')
    data = load_yaml(file)
    try:
        return scene_from_mapping(data)
    except SceneError as problem:
        raise SceneError(f'file {file}: {problem}') from problem


def _box(label: str, data: Any) -> Box:
    wanted = ('name', 'center', 'size')
    given = mapping(data, label, wanted, SceneError, ('quaternion_xyzw',))
    quaternion = frozen_array(
        given.get('quaternion_xyzw', UPRIGHT),
        (4,),
        f'{label}: quaternion_xyzw',
        '-',
        SceneError,
        FARTHEST,
    )
    if np.linalg.norm(quaternion) < SHORTEST:
        raise SceneError(
            f'{label}: quaternion_xyzw {quaternion.tolist()}, expected four numbers x, y, z, w, '
            'not all 0 [-]'
        )
    name = printable(given['name'], f'{label}: name', SceneError)
    return Box(name, given['center'], given['size'], rotation_matrix(quaternion))
