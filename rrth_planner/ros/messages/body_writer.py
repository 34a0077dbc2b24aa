# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A wearer as a message: from the core's boxes, and from files of either layout."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from rrth_planner.io.text_file import load_yaml
from rrth_planner.io.wearer_file import scene_from_mapping
from rrth_planner.model.errors import MessageError, SceneError
from rrth_planner.model.scene import Scene
from rrth_planner.ros.messages.message_file import message_from_mapping
from rrth_planner.ros.messages.plan_markers import box_marker
from visualization_msgs.msg import Marker, MarkerArray

COLOR = (0.85, 0.65, 0.55, 0.8)


def body_to_msg(scene: Scene, frame: str) -> MarkerArray:
    """
    Return boxes, given in a frame, as the markers of a whole wearer, without a stamp.

    A box has the same ns and id in each body, so that it replaces itself.
    """
    markers = [Marker(action=Marker.DELETEALL)]
    n_called = Counter[str]()
    for box in scene.boxes:
        marker = box_marker(box.name, n_called[box.name], box, COLOR)
        marker.text = box.name
        markers.append(marker)
        n_called[box.name] += 1
    for marker in markers:
        marker.header.frame_id = frame
    return MarkerArray(markers=markers)


def body_from_file(path: str | Path, frame: str) -> MarkerArray:
    """
    Return the body that a YAML file holds: markers, or boxes in a frame.

    Raises
    ------
    RrthError
        The file cannot be read, or is neither.

    """
    data = load_yaml(path)
    fields = data if isinstance(data, Mapping) else {}
    try:
        if 'markers' in fields:
            return message_from_mapping(data, MarkerArray)
        if 'boxes' in fields:
            return body_to_msg(scene_from_mapping(data), frame)
    except (MessageError, SceneError) as problem:
        raise type(problem)(f'file {path}: {problem}') from problem
    raise MessageError(
        f'file {path}: no body, expected a list of boxes (as config/body.yaml) or of markers '
        '(as msg_examples/body.yaml)'
    )
