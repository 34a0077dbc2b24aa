# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the planner still hears of an arm that moves and of its wearer."""

from rrth_planner.ros.inputs import Inputs
from rrth_planner.ros.parameters import PlannerParameters


def out_of_sight(heard: Inputs, parameters: PlannerParameters, now: float) -> str:
    """Return why nobody knows any more how arm and wearer are; empty: it is known."""
    if not heard.body.value.at(now).n_boxes:
        return 'the body is empty: the lifetime of its boxes has passed'
    age, most = heard.body.age(now), parameters.body_timeout
    if 0.0 < most < age:
        return f'the body is {age:.3f} s old, expected at most {most:g} s (body_timeout)'
    age, most = heard.joints.age(now), parameters.joint_timeout
    if 0.0 < most < age:
        return (
            f'the last joint positions are {age:.3f} s old, expected at most {most:g} s '
            '(joint_timeout)'
        )
    return ''
