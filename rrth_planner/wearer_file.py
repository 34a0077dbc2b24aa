# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer from a file: a body, or an example message read as plain YAML, without ROS."""

from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.body_file import load_body, scene_from_mapping
from rrth_planner.errors import SceneError
from rrth_planner.resources import load_yaml
from rrth_planner.rotation import rotation_matrix
from rrth_planner.scene import Scene

WEARER_HELP = 'the wearer, laid out as config/body.yaml, the default, or as msg_examples/body.yaml'
# The frame of the example messages; there is no TF that knows another one.
BASE_FRAME = 'torso'
# Of visualization_msgs/msg/Marker: the types that are boxes, and what may be done with them.
CUBE, CUBE_LIST = 1, 6
ADD, DELETE, DELETEALL = 0, 2, 3


def load_wearer(path: str | Path | None = None) -> Scene:
    """
    Return the wearer of a YAML file: laid out as `config/body.yaml`, or an example message.

    Parameters
    ----------
    path : str or Path, optional
        None: `config/body.yaml`.

    Raises
    ------
    ModelError, SceneError
        The file cannot be read, or describes no body; a marker that is no box, or is in a frame
        other than that of the examples.

    """
    data = None if path is None else load_yaml(path)
    if not isinstance(data, dict) or 'markers' not in data:
        return load_body(path)
    try:
        return scene_from_mapping({'boxes': _boxes_after(data['markers'])})
    except SceneError as problem:
        raise SceneError(f'file {path}: {problem}') from problem
    except (AttributeError, KeyError, TypeError, ValueError) as problem:
        raise SceneError(
            f'file {path}: {problem!r}; expected markers as in msg_examples/body.yaml'
        ) from problem


def _boxes_after(markers: Any) -> list[dict[str, Any]]:
    """Return the boxes that all markers leave, one after the other, as the nodes take them."""
    parts: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for index, marker in enumerate(markers):
        ns, action = marker.get('ns', ''), marker.get('action', ADD)
        key = (ns, marker.get('id', 0))
        if action == DELETEALL:
            parts = {k: boxes for k, boxes in parts.items() if ns not in ('', k[0])}
        elif action == DELETE:
            parts.pop(key, None)
        elif action == ADD:
            parts[key] = _boxes(index, marker)
        else:
            raise SceneError(
                f'marker {index}: action {action}, expected 0 (ADD), 2 (DELETE) or 3 (DELETEALL)'
            )
    return [box for boxes in parts.values() for box in boxes]


def _boxes(index: int, marker: Any) -> list[dict[str, Any]]:
    """Return the box of a CUBE, or those of a CUBE_LIST, laid out as in `config/body.yaml`."""
    name, kind = marker.get('text') or marker['ns'], marker.get('type')
    if kind not in (CUBE, CUBE_LIST):
        raise SceneError(
            f'marker {index} ("{name}"): type {kind}, expected {CUBE} (CUBE) or {CUBE_LIST} '
            '(CUBE_LIST)'
        )
    frame = marker.get('header', {}).get('frame_id', '')
    if frame not in ('', BASE_FRAME):
        raise SceneError(
            f'marker {index} ("{name}"): frame "{frame}", expected "{BASE_FRAME}" or an empty '
            'frame'
        )
    pose = marker['pose']
    box = {
        'name': name,
        'center': [pose['position'][axis] for axis in 'xyz'],
        'size': [marker['scale'][axis] for axis in 'xyz'],
        'quaternion_xyzw': [pose['orientation'][axis] for axis in 'xyzw'],
    }
    if kind == CUBE:
        return [box]
    points = np.array([[point[axis] for axis in 'xyz'] for point in marker['points']], np.float64)
    if len(points) == 0 or not any(box['quaternion_xyzw']):
        raise SceneError(
            f'marker {index} ("{name}"): {len(points)} points, orientation '
            f'{box["quaternion_xyzw"]}, expected at least one [m], and not all 0 [-]'
        )
    # The points are centres in the marker's own pose.
    centers = box['center'] + points @ rotation_matrix(box['quaternion_xyzw']).T
    return [
        {**box, 'name': f'{name}[{k}]', 'center': center}
        for k, center in enumerate(centers.tolist())
    ]
