# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer's body from a YAML file."""

from collections.abc import Mapping
import math
from pathlib import Path
import reprlib
from typing import Any

from rrth_planner.errors import SceneError
from rrth_planner.resources import load_yaml, resource_path
from rrth_planner.rotation import rotation_matrix
from rrth_planner.scene import Box, Scene

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
ENTRIES = ('name', 'center', 'size', 'quaternion_xyzw')


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
        raise SceneError(f'body: {reprlib.repr(data)}, expected a mapping with a list of boxes')
    return Scene(tuple(_box(k, box) for k, box in enumerate(boxes)))


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


def _box(index: int, data: Any) -> Box:
    label = f'box {index}'
    if not isinstance(data, Mapping):
        raise SceneError(f'{label}: {data!r}, expected a mapping with {", ".join(ENTRIES)}')
    unknown = [str(key) for key in data if key not in ENTRIES]
    missing = [key for key in ENTRIES[:3] if key not in data]
    if unknown or missing:
        raise SceneError(
            f'{label}: {", ".join(unknown or missing)} {"unknown" if unknown else "missing"}, '
            f'expected {", ".join(ENTRIES)}'
        )
    quaternion = data.get('quaternion_xyzw', UPRIGHT)
    try:
        x, y, z, w = map(float, quaternion)
    except (TypeError, ValueError) as problem:
        raise SceneError(
            f'{label}: quaternion_xyzw {quaternion!r}, expected four numbers x, y, z, w [-]'
        ) from problem
    if not math.hypot(x, y, z, w) > 0.0:
        raise SceneError(
            f'{label}: quaternion_xyzw {quaternion!r}, expected four numbers, not all 0 [-]'
        )
    return Box(str(data['name']), data['center'], data['size'], rotation_matrix([x, y, z, w]))
