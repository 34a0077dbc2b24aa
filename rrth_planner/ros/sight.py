# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the planner still hears of an arm that moves and of its wearer."""

from rrth_planner.ros.inputs import Inputs
from rrth_planner.ros.parameters import PlannerParameters


def out_of_sight(heard: Inputs, parameters: PlannerParameters, now: float) -> str:
    """Return why nobody knows any more how arm and wearer are; empty: it is known."""
    if heard.body.is_last_refused:
        return f'the last body was refused, {heard.body.refusal}'
    if heard.joint_refusal is not None:
        return f'the last joint positions were refused, {heard.joint_refusal}'
    body = heard.body.value.at(now)
    if body.expired:
        return f'lost parts of the body, whose lifetime has passed: {body.expired_names}'
    if not body.n_boxes:
        return 'the body is empty'
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
