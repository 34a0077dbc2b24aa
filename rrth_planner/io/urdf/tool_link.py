# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which link of a URDF is the tool of an arm: where it ends, but not in the jaw of a gripper."""

from collections.abc import Sequence
import re
from typing import Any

from rrth_planner.model.errors import ModelError, shown

# What jaws, and the joints that move them, are called.
JAW = re.compile(r'finger|thumb|jaw|claw|pincer|knuckle', re.IGNORECASE)
JAW_JOINT = re.compile(rf'{JAW.pattern}|gripp|clamp', re.IGNORECASE)
# A joint called so carries the gripper as a whole.
WRIST = re.compile(r'wrist|roll|pitch|yaw|rot|flex', re.IGNORECASE)
# A gripper is carried by at least so many joints, and a jaw is moved by at most so many.
FEWEST_BEFORE, MOST_OF_JAW = 2, 4
# So many links to choose from are named.
MOST_NAMED = 12


def only_tool(robot: Any, base: str, ends: Sequence[str], takes_jaw: bool) -> str:
    """
    Return the only link at which an arm from a link may end, or raise ModelError.

    Parameters
    ----------
    ends : sequence of str
        Links from which no joint leads on.
    takes_jaw : bool
        Whether it may be the jaw of a gripper.

    """
    choices: dict[str, int] = {}
    jaws, carriers = [], set()
    for end in ends:
        joints = _joints_to(robot, base, end)
        if not joints and end != base:
            continue
        jaw = None if takes_jaw else first_jaw_joint(robot, joints)
        if jaw is not None:
            jaws.append(end)
            joints, end = joints[: joints.index(jaw)], jaw.parent
            carriers.add(end)
        choices[end] = sum(joint.type != 'fixed' for joint in joints)
    moved = {link: n for link, n in choices.items() if n > 0}
    if len(moved or choices) == 1 and not jaws:
        return next(iter(moved or choices))
    ordered = sorted(moved or choices, key=lambda link: (link not in carriers, -choices[link]))
    named = ', '.join(f'{link} ({choices[link]} joints)' for link in ordered[:MOST_NAMED])
    more = f' and {len(ordered) - MOST_NAMED} more' if len(ordered) > MOST_NAMED else ''
    why = f'the URDF ends in {len(ends)} link{"s" * (len(ends) > 1)}'
    if jaws:
        why += f'; jaws of a gripper are no tools: {shown(jaws)}'
    raise ModelError(f'give --tool LINK, one of {named}{more}: {why}')


def reject_jaw(robot: Any, joints: Sequence[Any], tool: str) -> None:
    """Raise ModelError where joints that lead to a tool end in the jaw of a gripper."""
    jaw = first_jaw_joint(robot, joints)
    if jaw is not None:
        raise ModelError(
            f'give --tool {jaw.parent}, which carries the gripper, or --jaw: joint "{jaw.name}" '
            f'on the way to "{tool}" looks like that of a jaw, and would be a joint of the arm'
        )


def first_jaw_joint(robot: Any, joints: Sequence[Any]) -> Any | None:
    """
    Return the first of the joints between two links that moves a jaw of a gripper, or None.

    A jaw hangs at the end of an arm. It is known by names, by a joint beside its own that moves
    with it or slides as it does, or by a second jaw beside it.
    """
    moving = [joint for joint in joints if joint.type != 'fixed']
    # Where the first joints are called so, all of the robot is.
    named = {joint.name for joint in moving if _is_named_jaw(joint)}
    if named & {joint.name for joint in moving[:FEWEST_BEFORE]}:
        named = set()
    for k, joint in enumerate(moving):
        if k < FEWEST_BEFORE:
            continue
        if joint.name in named or (
            len(moving) - k <= MOST_OF_JAW and _has_second_jaw(robot, joint)
        ):
            return joint
    return None


def _is_named_jaw(joint: Any) -> bool:
    is_jaw_joint = JAW_JOINT.search(joint.name) and not WRIST.search(joint.name)
    return bool(is_jaw_joint or JAW.search(joint.child))


def _has_second_jaw(robot: Any, joint: Any) -> bool:
    """Return whether another joint of the same body moves what looks like the other jaw."""
    body = _rigid_body(robot, joint.parent)
    for other in robot.joints:
        if other.parent not in body or other.type == 'fixed' or other.name == joint.name:
            continue
        if (other.mimic is not None and other.mimic.joint == joint.name) or (
            joint.mimic is not None and joint.mimic.joint == other.name
        ):
            return True
        numbers = [_n_moving(robot, one.child) + 1 for one in (joint, other)]
        if numbers == [1, 1] or (joint.type == other.type == 'prismatic' and max(numbers) <= 2):
            return True
    return False


def _rigid_body(robot: Any, link: str) -> set[str]:
    """Return a link and those that are fixed to it."""
    body, n = {link}, 0
    while len(body) > n:
        n = len(body)
        for joint in robot.joints:
            if joint.type == 'fixed' and (joint.parent in body or joint.child in body):
                body |= {joint.parent, joint.child}
    return body


def _n_moving(robot: Any, link: str) -> int:
    """Return how many joints beyond a link move."""
    beyond, n = [link], 0
    # The tree has no circles: each link is the child of one joint.
    for one in beyond:
        after = [joint for joint in robot.joints if joint.parent == one]
        beyond += [joint.child for joint in after]
        n += sum(joint.type != 'fixed' for joint in after)
        if n > len(robot.joints):
            break
    return n


def _joints_to(robot: Any, base: str, end: str) -> list[Any]:
    """Return the joints that lead from one link to another, none where they do not."""
    above = {joint.child: joint for joint in robot.joints}
    joints: list[Any] = []
    while end != base and end in above and len(joints) <= len(above):
        joints.insert(0, above[end])
        end = joints[0].parent
    return joints if end == base else []
