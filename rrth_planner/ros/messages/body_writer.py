# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer as a message: from the core's boxes, and from files of either layout."""

from collections.abc import Mapping
from pathlib import Path

from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.wearer_file import scene_from_mapping
from rrth_planner.model.errors import MessageError, SceneError
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.model.scene import Scene
from rrth_planner.ros.messages.message_file import message_from_mapping
from visualization_msgs.msg import Marker, MarkerArray

COLOR = (0.85, 0.65, 0.55, 0.8)


def body_to_msg(scene: Scene, frame: str) -> MarkerArray:
    """Return boxes, given in a frame, as markers that replace every box before."""
    markers = [Marker(action=Marker.DELETEALL)]
    for k, box in enumerate(scene.boxes):
        marker = Marker(ns=box.name, id=k, type=Marker.CUBE, action=Marker.ADD)
        p, o, s, c = marker.pose.position, marker.pose.orientation, marker.scale, marker.color
        p.x, p.y, p.z = box.center.tolist()
        o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
        s.x, s.y, s.z = box.size.tolist()
        c.r, c.g, c.b, c.a = COLOR
        markers.append(marker)
    for marker in markers:
        marker.header.frame_id = frame
    return MarkerArray(markers=markers)


def body_from_file(path: str | Path, frame: str) -> MarkerArray:
    """
    Return the body that a YAML file holds.

    Parameters
    ----------
    path : str or Path
        Boxes as in `config/body.yaml`, or a MarkerArray as in `msg_examples/body.yaml`.
    frame : str
        Of boxes; markers have their own.

    Raises
    ------
    RrthError
        The file cannot be read, or is neither.

    """
    data = load_yaml(path)
    is_message = isinstance(data, Mapping) and 'markers' in data
    if not is_message and not (isinstance(data, Mapping) and 'boxes' in data):
        raise MessageError(
            f'file {path}: no body, expected a list of boxes (as config/body.yaml) or of markers '
            '(as msg_examples/body.yaml)'
        )
    try:
        if is_message:
            return message_from_mapping(data, MarkerArray)
        return body_to_msg(scene_from_mapping(data), frame)
    except (MessageError, SceneError) as problem:
        raise type(problem)(f'file {path}: {problem}') from problem
