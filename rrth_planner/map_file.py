# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A map from a YAML file."""

from pathlib import Path

from rrth_planner.box_map import BoxMap, map_from_mapping
from rrth_planner.errors import SceneError
from rrth_planner.resources import resource_path
from rrth_planner.text_files import load_yaml


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
    try:
        return map_from_mapping(data, path.stem)
    except SceneError as problem:
        raise SceneError(f'file {path}: {problem}') from problem
