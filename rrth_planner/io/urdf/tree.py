# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The links of a person whom a URDF describes, as ROS4HRI publishes it (REP 155)."""

from os.path import commonprefix
from typing import Any

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.io.text_file import parse_xml
from rrth_planner.io.urdf.chain import joint_axis, TOOLS, urdf_model
from rrth_planner.model.errors import ModelError
from rrth_planner.wearer.link_tree import Link, LinkTree

# Kinds of joints that a person may have.
KINDS = ('revolute', 'continuous', 'prismatic', 'fixed')


def link_tree_from_urdf(text: str, name: str) -> LinkTree:
    """
    Return the links of a URDF; name: what sentences call it.

    The `_<id>` at the end of the names of all links, which says whose they are, is left out;
    joints keep it, since messages have it.

    Raises
    ------
    ModelError, NotInstalledError
        No URDF, no tree of links, a joint of another kind or one that moves with another; what
        reads it is missing.

    """
    require('tools', *TOOLS)
    model = urdf_model(parse_xml(text.encode(), name), name)
    above = {joint.child: joint for joint in model.robot.joints}
    links = [link.name for link in model.robot.links]
    if len(above) < len(model.robot.joints) or not set(above) <= set(links):
        raise ModelError(f'{name}: expected a tree of links, one joint to each but the root')
    end = len(_common_id(links))
    return LinkTree(tuple(_link(link, above.get(link), end) for link in links))


def _link(name: str, joint: Any, end: int) -> Link:
    """Return a link without so many characters at the end of its name."""

    def short(name: str) -> str:
        return name[: len(name) - end]

    if joint is None:
        return Link(name=short(name), parent='', joint='', origin=np.eye(4), axis=np.zeros(3))
    if joint.type not in KINDS:
        raise ModelError(f'joint "{joint.name}": {joint.type}, expected one of {", ".join(KINDS)}')
    if joint.mimic is not None:
        raise ModelError(
            f'joint "{joint.name}": moves with "{joint.mimic.joint}", expected joints that '
            'move by themselves'
        )
    is_fixed = joint.type == 'fixed'
    return Link(
        name=short(name),
        parent=short(joint.parent),
        joint='' if is_fixed else joint.name,
        origin=np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=np.float64),
        axis=np.zeros(3) if is_fixed else joint_axis(joint),
        is_prismatic=joint.type == 'prismatic',
    )


def _common_id(links: list[str]) -> str:
    """Return the `_<id>` that all names end in, or ''."""
    if len(links) < 2:
        return ''
    common = commonprefix([link[::-1] for link in links])[::-1]
    return common[common.find('_') :] if '_' in common else ''
