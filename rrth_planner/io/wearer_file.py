# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer from a file: a body, or an example message read as plain YAML, without ROS."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rrth_planner.io.entries import mapping, sequence, text, whole
from rrth_planner.io.resources import resource_path
from rrth_planner.io.text_file import naming_file, parse_yaml, read_text
from rrth_planner.model.arrays import FARTHEST, frozen_array
from rrth_planner.model.errors import one_line, printable, SceneError, shown
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
# Shorter quaternions are none.
SHORTEST = 1e-6

# The frame of the example messages; there is no TF that knows another one.
BASE_FRAME = 'torso'
# Of visualization_msgs/msg/Marker: the types that are boxes, and what may be done with them.
CUBE, CUBE_LIST = 1, 6
ADD, DELETE, DELETEALL = 0, 2, 3
# A text that names a box is cut short beyond this [characters].
LONGEST_TEXT = 100


def marker_name(given: str, ns: str, index: int) -> str:
    """Return the name of a marker: its text, or `ns/id` where it has none."""
    # As it is shown in RViz, a text may have lines.
    return one_line(given or (f'{ns}/{index}' if ns else f'{index}'), LONGEST_TEXT)


def load_body(path: str | Path | None = None) -> Scene:
    """
    Return the wearer of a YAML file: laid out as `config/body.yaml`, the default, or a message.

    Raises
    ------
    ModelError, SceneError
        The file cannot be read, or describes no body; a marker that is no box, or is in a frame
        other than that of the examples.

    """
    file = Path(path) if path else resource_path('config/body.yaml')
    return body_from_text(read_text(file), file)


def body_from_text(content: str, file: str | Path) -> Scene:
    """Return the wearer that the text of a YAML file describes, as `load_body` does."""
    data = parse_yaml(content, f'file {file}')
    with naming_file(file, SceneError):
        if isinstance(data, dict) and 'markers' in data:
            data = {'boxes': _boxes_after(data['markers'])}
        return scene_from_mapping(data)


def _boxes_after(markers: Any) -> list[dict[str, Any]]:
    """Return the boxes left after applying all markers in order, as the nodes do."""
    parts: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for index, marker in enumerate(sequence(markers, 'markers', SceneError)):
        label = f'marker {index}'
        if not isinstance(marker, dict):
            raise SceneError(
                f'{label}: {shown(marker)}, expected markers as in msg_examples/body.yaml'
            )
        ns = text(marker.get('ns', ''), f'{label}: ns', SceneError)
        action = whole(marker.get('action', ADD), f'{label}: action', SceneError)
        key = (ns, whole(marker.get('id', 0), f'{label}: id', SceneError))
        if action == DELETEALL:
            parts = {k: boxes for k, boxes in parts.items() if ns not in ('', k[0])}
        elif action == DELETE:
            parts.pop(key, None)
        elif action == ADD:
            parts[key] = _boxes(label, marker)
        else:
            raise SceneError(
                f'{label}: action {action}, expected 0 (ADD), 2 (DELETE) or 3 (DELETEALL)'
            )
    return [box for boxes in parts.values() for box in boxes]


def _boxes(label: str, marker: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the box of a CUBE, or those of a CUBE_LIST, laid out as in `config/body.yaml`."""
    given = text(marker.get('text', ''), f'{label}: text', SceneError)
    name = marker_name(given, marker.get('ns', ''), marker.get('id', 0))
    label = f'{label} ("{name}")'
    kind = whole(marker.get('type'), f'{label}: type', SceneError)
    if kind not in (CUBE, CUBE_LIST):
        raise SceneError(
            f'{label}: type {kind}, expected {CUBE} (CUBE) or {CUBE_LIST} (CUBE_LIST)'
        )
    header = marker.get('header', {})
    given = header.get('frame_id', '') if isinstance(header, dict) else header
    frame = text(given, f'{label}: frame', SceneError)
    if frame not in ('', BASE_FRAME):
        raise SceneError(f'{label}: frame "{frame}", expected "{BASE_FRAME}" or an empty frame')
    pose = mapping(marker.get('pose'), f'{label}: pose', ('position', 'orientation'), SceneError)
    center = _vector(pose['position'], 'xyz', f'{label}: position', 'm')
    orientation = _vector(pose['orientation'], 'xyzw', f'{label}: orientation', '-')
    size = _vector(marker.get('scale'), 'xyz', f'{label}: scale', 'm')
    box = {'name': name, 'center': center, 'size': size, 'quaternion_xyzw': orientation}
    if kind == CUBE:
        return [box]
    points = [
        _vector(point, 'xyz', f'{label}: points[{k}]', 'm')
        for k, point in enumerate(sequence(marker.get('points'), f'{label}: points', SceneError))
    ]
    if not points or np.linalg.norm(orientation) < SHORTEST:
        raise SceneError(
            f'{label}: {len(points)} points, orientation {orientation}, expected at least one '
            '[m], and not all 0 [-]'
        )
    # The points are centres in the marker's own pose.
    centers = center + np.array(points) @ rotation_matrix(orientation).T
    return [
        {**box, 'name': f'{name}[{k}]', 'center': center}
        for k, center in enumerate(centers.tolist())
    ]


def _vector(data: Any, axes: str, label: str, unit: str) -> list[float]:
    """Return the components of a point, vector or quaternion of a message."""
    given = mapping(data, label, axes, SceneError)
    values = [given[axis] for axis in axes]
    return frozen_array(values, (len(axes),), label, unit, SceneError, FARTHEST).tolist()


def scene_from_mapping(data: Any) -> Scene:
    """
    Return the wearer that a mapping describes, laid out as `config/body.yaml`.

    Its `boxes` are a list of mappings with `name`, `center` and full `size` [m], and, where a box
    is turned, its `quaternion_xyzw`.

    Raises
    ------
    SceneError
        Anything else, or a box that is none.

    """
    boxes = data.get('boxes') if isinstance(data, Mapping) else None
    if not isinstance(boxes, list) or not boxes:
        raise SceneError(f'body: {shown(data)}, expected a mapping with a list of boxes')
    return Scene(tuple(_box(f'box {k}', box) for k, box in enumerate(boxes)))


def _box(label: str, data: Any) -> Box:
    wanted = ('name', 'center', 'size')
    given = mapping(data, label, wanted, SceneError, ('quaternion_xyzw',))
    turn, named = given.get('quaternion_xyzw', UPRIGHT), f'{label}: quaternion_xyzw'
    quaternion = frozen_array(turn, (4,), named, '-', SceneError, FARTHEST)
    if np.linalg.norm(quaternion) < SHORTEST:
        raise SceneError(
            f'{named} {quaternion.tolist()}, expected four numbers x, y, z, w, not all 0 [-]'
        )
    name = printable(given['name'], f'{label}: name', SceneError)
    return Box(name, given['center'], given['size'], rotation_matrix(quaternion))
