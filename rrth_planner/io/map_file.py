# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A map from a YAML file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import load_yaml, naming_file
from rrth_planner.model.arrays import frozen_array
from rrth_planner.model.errors import printable, SceneError, shown
from rrth_planner.planning.box_map import BoxMap

# Keys of a mapping that describes a map.
ENTRIES = ('name', 'bounds', 'rectangles', 'boxes', 'start', 'goal')
EXPECTED = 'bounds, rectangles or boxes, start and goal, and a name or none'


def load_map(name: str | Path) -> BoxMap:
    """
    Return a map of `config/maps` by its name, or that of a file whose name ends in `.yaml`.

    Raises
    ------
    ModelError, SceneError
        There is no such map, the file cannot be read, or it describes no map.

    """
    is_file = str(name).endswith('.yaml')
    path = Path(name) if is_file else resource_path(f'config/maps/{name}.yaml')
    data = load_yaml(path)
    with naming_file(path, SceneError):
        return map_from_mapping(data, path.stem)


def map_from_mapping(data: Mapping[str, Any], name: str) -> BoxMap:
    """
    Return the map that a mapping describes, laid out as the files in `config/maps`.

    In the plane a row of `rectangles` is xmin, ymin, xmax, ymax; in general a row of `boxes` is
    the lower corner, then the upper one, and `bounds` alike. A map has the one or the other.

    Raises
    ------
    SceneError
        Something is missing, has another name, is there twice or describes no map.

    """
    label = f'map "{printable(name, "name of a map", SceneError)}"'
    if not isinstance(data, Mapping):
        raise SceneError(f'{label}: {shown(data)}, expected a mapping with {EXPECTED}')
    # A wall under an unknown key must not be ignored silently.
    unknown = [str(key) for key in data if key not in ENTRIES]
    if unknown:
        raise SceneError(f'{label}: {", ".join(unknown)} unknown, expected only {EXPECTED}')
    if 'rectangles' in data and 'boxes' in data:
        raise SceneError(f'{label}: rectangles and boxes, expected one of them')
    rows = 'rectangles' if 'rectangles' in data else 'boxes'
    for key in ('bounds', rows, 'start', 'goal'):
        if key not in data:
            raise SceneError(f'{label}: no {key!r}, expected {EXPECTED}')
    start = frozen_array(data['start'], (None,), f'{label}: start', 'map', SceneError)
    dof = len(start)
    bounds = frozen_array(data['bounds'], (2 * dof,), f'{label}: bounds', 'map', SceneError)
    obstacles = data[rows]
    if obstacles != []:
        obstacles = frozen_array(obstacles, (None, 2 * dof), f'{label}: {rows}', 'map', SceneError)
    return BoxMap(
        name=data.get('name', name),
        bounds=bounds.reshape(2, dof),
        obstacles=np.reshape(obstacles, (-1, 2, dof)),
        start=start,
        goal=data['goal'],
    )
