# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts of the arm with the wearer: where, how strong, how fast."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rrth_planner.model.arrays import Array
from rrth_planner.simulation.physics_model import PhysicsModel

with suppress(ImportError):
    import mujoco

# Parts that part for a shorter time are still in the same contact [s].
BOUNCE = 0.1


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyContact:
    """
    A part of the arm in contact with a part of the wearer.

    Parameters
    ----------
    bar, part : str
        Of the arm, and of the wearer.
    place : ndarray, shape (3,)
        In the base frame [m].
    force : float
        Of the arm on the wearer [N].
    speed, approach : float
        Of the two bodies to each other there, and the part of it along the normal [m/s].
    arm_speed : float
        Of the arm there [m/s].
    depth : float
        How far their shapes are in each other [m].

    """

    bar: str
    part: str
    place: Array
    force: float
    speed: float
    approach: float
    arm_speed: float
    depth: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactEvent:
    """
    A contact from its begin on.

    Parameters
    ----------
    begin, last : float
        When it was first and last seen [s].
    first : BodyContact
        When it began: its speed is that of the impact.
    now : BodyContact
        When it was last seen.
    greatest_force, greatest_speed, greatest_arm_speed, greatest_depth : float
        Until now [N, m/s, m/s, m].

    """

    begin: float
    last: float
    first: BodyContact
    now: BodyContact
    greatest_force: float
    greatest_speed: float
    greatest_arm_speed: float
    greatest_depth: float


def contacts_of(physics: PhysicsModel, data: Any, velocities: Array) -> list[BodyContact]:
    """
    Return the contacts of the last step, the strongest of each pair.

    Parameters
    ----------
    data : mujoco.MjData
        After a step.
    velocities : ndarray, shape (nv,)
        Of all bodies before that step, when the contacts were looked for.

    """
    found: dict[tuple[str, str], BodyContact] = {}
    if not data.ncon:
        return []
    model = physics.model
    wrench, jacobian = np.zeros(6), np.zeros((3, model.nv))
    for k in range(data.ncon):
        contact = data.contact[k]
        shapes = contact.geom.tolist()
        if contact.dist > 0.0 or any(shape not in physics.names for shape in shapes):
            continue
        is_arm_first = model.geom_contype[shapes[0]] < model.geom_contype[shapes[1]]
        moving, arm_speed = np.zeros(3), 0.0
        for shape, sign in zip(shapes, (-1.0, 1.0), strict=True):
            body = model.geom_bodyid[shape]
            mujoco.mj_jac(model, data, jacobian, None, contact.pos, body)
            there = jacobian @ velocities
            moving += sign * there
            if (shape == shapes[0]) == is_arm_first:
                arm_speed = float(np.linalg.norm(there))
        mujoco.mj_contactForce(model, data, k, wrench)
        # The normal leads from the first shape to the second.
        approach = -float(contact.frame[:3] @ moving)
        bar, part = (physics.names[s] for s in (shapes if is_arm_first else shapes[::-1]))
        one = BodyContact(
            bar=bar,
            part=part,
            place=np.array(contact.pos),
            force=float(np.linalg.norm(wrench[:3])),
            speed=float(np.linalg.norm(moving)),
            approach=approach,
            arm_speed=arm_speed,
            depth=-float(contact.dist),
        )
        other = found.get((bar, part))
        if other is None or one.force > other.force:
            found[bar, part] = one
    return list(found.values())


def followed(
    events: Iterable[ContactEvent], contacts: Iterable[BodyContact], time: float
) -> tuple[list[ContactEvent], list[ContactEvent]]:
    """Return the contacts that go on or begin at a time [s], and those that have ended."""
    here = {(contact.bar, contact.part): contact for contact in contacts}
    going, ended = [], []
    for event in events:
        contact = here.pop((event.first.bar, event.first.part), None)
        if contact is not None:
            going.append(
                replace(
                    event,
                    last=time,
                    now=contact,
                    greatest_force=max(event.greatest_force, contact.force),
                    greatest_speed=max(event.greatest_speed, contact.speed),
                    greatest_arm_speed=max(event.greatest_arm_speed, contact.arm_speed),
                    greatest_depth=max(event.greatest_depth, contact.depth),
                )
            )
        elif time - event.last < BOUNCE:
            going.append(event)
        else:
            ended.append(event)
    for contact in here.values():
        going.append(
            ContactEvent(
                begin=time,
                last=time,
                first=contact,
                now=contact,
                greatest_force=contact.force,
                greatest_speed=contact.speed,
                greatest_arm_speed=contact.arm_speed,
                greatest_depth=contact.depth,
            )
        )
    return going, ended
