# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""An arm and its wearer as a model of MuJoCo."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from rrth_planner.io.extras import require
from rrth_planner.model.arm import (
    ArmModel,
    Bar,
    bars_of,
    Capsule,
    is_called,
    link_poses,
    mount_bars,
    tool_in_last_link,
)
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.joint_range import start_bounds
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.simulation.body_shapes import BodyBox, BodyCapsule, capsules_within
from rrth_planner.simulation.mechanics import Mechanics
from rrth_planner.simulation.moving_body import MovingBody

# colcon does not install it; an error says so when a model is made.
with suppress(ImportError):
    import mujoco

Fill: TypeAlias = Callable[[Array], tuple[BodyCapsule | BodyBox, ...]]
# Physics and servos take so many steps per second [1/s].
RATE = 500
# A line has no thickness; MuJoCo wants one [m].
LEAST_RADIUS = 1e-6
# What is seen of a bar, and what its mass is spread over, is at least so thick [m].
SEEN_RADIUS = 0.015
# Length of the pointing ray that is seen [m].
SEEN_RAY = 0.3
# No force of the arm moves the wearer: he moves as he was recorded [kg].
UNMOVED = 1e5
# Which shapes may meet: those of the arm with those of the wearer.
OF_ARM, OF_WEARER = 1, 2
# Only seen.
UNSEEN_GROUP, SEEN_GROUP = 3, 1
ARM_COLOR, RAY_COLOR, WEARER_COLOR = (
    (0.15, 0.35, 0.75, 1.0),
    (0.9, 0.2, 0.1, 0.5),
    (0.85, 0.68, 0.55, 1.0),
)


@dataclass(frozen=True, slots=True, eq=False)
class PhysicsModel:
    """
    The model, and where in it the arm and the wearer are.

    The world is the base frame. The arm's joints come first, in their order.

    Parameters
    ----------
    model : mujoco.MjModel
    names : dict of int to str
        What messages call each shape that may meet another, by its number.
    tool : int
        The body at the origin of the tool.
    is_standing : bool
        Whether the wearer is part of the world; else each of his parts moves freely.
    sliding : tuple of (int, int, float)
        Shapes whose length changes: number, joint, and length where the joint is at 0 [m].

    """

    model: Any
    names: dict[int, str]
    tool: int
    is_standing: bool
    sliding: tuple[tuple[int, int, float], ...]


def physics_model(
    arm: ArmModel,
    mechanics: Mechanics,
    body: MovingBody | None = None,
    fill: Fill = capsules_within,
) -> PhysicsModel:
    """
    Return the model of an arm, beside a wearer where one is given.

    A bar of the arm is a capsule as it is, the pointing ray is none. A part of the wearer is
    filled by capsules; where it moves it has the velocity that it is given before each step, and
    too much mass for the arm to change that. Pairs that the arm is allowed to meet do not collide,
    and neither does the mount, which is worn on him, nor do parts of the arm with each other.

    Parameters
    ----------
    fill : callable
        Returns what fills a part of the wearer whose box has some size, (3,) [m].

    Raises
    ------
    NotInstalledError, OptionsError
        MuJoCo is missing; mechanics of another arm.

    """
    require('simulation', 'mujoco')
    if len(mechanics.link_mass) != arm.dof:
        raise OptionsError(
            f'mechanics of {len(mechanics.link_mass)} joints, expected {arm.dof}, those of the arm'
        )
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = 1.0 / RATE
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = 1920, 1080
    spec.add_texture(
        name='sky',
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.9, 0.93, 0.97],
        rgb2=[0.6, 0.68, 0.78],
        width=64,
        height=384,
    )
    owners = _add_arm(spec, arm, mechanics)
    if body is not None:
        _add_wearer(spec, body, fill)
        for bar, parent in owners:
            for name in body.names:
                if any(bar.name == a and is_called(name, b) for a, b in arm.allowed):
                    spec.add_exclude(bodyname1=parent, bodyname2=f'wearer/{name}')
    model = spec.compile()
    names = {}
    for k in range(model.ngeom):
        kind, _, name = model.geom(k).name.partition('/')
        if kind in ('bar', 'part'):
            names[k] = name.rpartition('/')[0]
    return PhysicsModel(
        model=model,
        names=names,
        tool=model.body('tool').id,
        is_standing=body is None or body.is_standing,
        sliding=tuple(_sliding(arm, model)),
    )


def _sliding(arm: ArmModel, model: Any) -> Iterator[tuple[int, int, float]]:
    """Give what `PhysicsModel.sliding` holds."""
    for k, bar in enumerate(bars_of(arm)[:-1]):
        if not isinstance(bar.source, Capsule):
            row, kind = bar.source
            if kind == 'd' and arm.is_prismatic[row]:
                for name in (f'bar/{bar.name}/{k}', f'seen {k}'):
                    yield model.geom(name).id, row, float(arm.dh[row, 3])


def _add_arm(spec: Any, arm: ArmModel, mechanics: Mechanics) -> list[tuple[Bar, str]]:
    """Add the arm; return its bars that may meet the wearer, and the body of each."""
    bodies = [_add_frame(spec.worldbody, 'mount', arm.T_base_mount)]
    poses = link_poses(arm, np.zeros(arm.dof))
    for i, name in enumerate(arm.joint_names):
        frame = _add_frame(bodies[-1], f'link {i + 1}', poses[i])
        slides = arm.is_prismatic[i]
        frame.add_joint(
            name=f'joint {i + 1}',
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=[0.0, 0.0, 1.0],
            limited=True,
            # A stop is further out than the limit that a controller keeps.
            range=start_bounds(arm)[:, i],
            armature=mechanics.armature[i],
            damping=np.full(3, mechanics.damping[i]),
            frictionloss=mechanics.friction[i],
        )
        motor = spec.add_actuator(
            name=name,
            target=f'joint {i + 1}',
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=True,
            forcerange=mechanics.max_effort[i] * np.array([-1.0, 1.0]),
        )
        motor.gainprm[0] = 1.0
        bodies.append(frame)
    tool = _add_frame(bodies[-1], 'tool', poses[-1])
    owners = _add_bars(spec, arm, mechanics, bodies)
    if mechanics.payload > 0.0:
        _add_sphere(tool, 'payload', mechanics.payload)
    tool.add_geom(
        name='ray',
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[0.0, 0.0, 0.0, 0.0, 0.0, SEEN_RAY],
        size=[0.2 * SEEN_RADIUS, 0.0, 0.0],
        rgba=RAY_COLOR,
        **_seen(0.0),
    )
    return owners


def _add_bars(
    spec: Any, arm: ArmModel, mechanics: Mechanics, bodies: list[Any]
) -> list[tuple[Bar, str]]:
    """Add shapes and masses of the links; return as `_add_arm`."""
    owners, lengths = [], np.zeros(arm.dof + 1)
    placed = [(bar, *_ends_of(arm, bar)) for bar in (*bars_of(arm)[:-1], *mount_bars(arm))]
    for bar, owner, ends in placed:
        lengths[owner] += np.linalg.norm(ends[1] - ends[0]) + 2.0 * max(bar.radius, SEEN_RADIUS)
    for k, (bar, owner, ends) in enumerate(placed):
        # A body of its own, so that pairs that may meet are left out one by one.
        name = f'bar {k}'
        own = bodies[owner].add_body(name=name)
        length = np.linalg.norm(ends[1] - ends[0]) + 2.0 * max(bar.radius, SEEN_RADIUS)
        is_weighed = owner > 0 and not mechanics.inertias
        mass = mechanics.link_mass[owner - 1] * length / lengths[owner] if is_weighed else 0.0
        meets = owner > 0
        _add_capsule(
            own,
            f'bar/{bar.name}/{k}' if meets else f'mount/{k}',
            ends,
            max(bar.radius, LEAST_RADIUS),
            mass=0.0,
            contype=OF_ARM if meets else 0,
            conaffinity=OF_WEARER if meets else 0,
            group=UNSEEN_GROUP,
        )
        _add_capsule(
            own, f'seen {k}', ends, max(bar.radius, SEEN_RADIUS), rgba=ARM_COLOR, **_seen(mass)
        )
        if meets:
            owners.append((bar, name))
    for i in range(arm.dof):
        frame = bodies[i + 1]
        if mechanics.inertias:
            inertia = mechanics.inertias[i]
            t = inertia.tensor
            frame.mass, frame.ipos = inertia.mass, inertia.center
            frame.fullinertia = [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]
            frame.explicitinertial = True
        elif not lengths[i + 1]:
            # Nothing but a joint: its motor.
            _add_sphere(frame, f'motor {i + 1}', mechanics.link_mass[i])
    return owners


def _add_wearer(spec: Any, body: MovingBody, fill: Fill) -> None:
    """Add the parts of the wearer at the first of their poses."""
    for k, name in enumerate(body.names):
        part = spec.worldbody.add_body(
            name=f'wearer/{name}',
            pos=body.positions[0, k],
            quat=np.roll(body.quaternions[0, k], 1),
        )
        if not body.is_standing:
            part.add_freejoint(name=f'motion of {name}')
            # Alike about all axes: it goes on turning as it does.
            part.mass, part.inertia = UNMOVED, np.full(3, UNMOVED)
            part.gravcomp, part.explicitinertial = 1.0, True
        options = {
            'mass': 0.0,
            'contype': OF_WEARER,
            'conaffinity': OF_ARM,
            'rgba': WEARER_COLOR,
            'group': SEEN_GROUP,
        }
        for j, shape in enumerate(fill(body.sizes[k])):
            label = f'part/{name}/{j}'
            if isinstance(shape, BodyCapsule):
                _add_capsule(part, label, shape.ends, shape.radius, **options)
            else:
                box = mujoco.mjtGeom.mjGEOM_BOX
                part.add_geom(name=label, type=box, size=0.5 * shape.size, **options)


def _ends_of(arm: ArmModel, bar: Bar) -> tuple[int, Array]:
    """Return the link that a bar is fixed to, 0 the mount, and its ends there, (2, 3) [m]."""
    if isinstance(bar.source, Capsule):
        link, ends = bar.source.link, np.array(bar.source.ends)
        return (arm.dof, tool_in_last_link(arm, ends)) if link > arm.dof else (link, ends)
    row, kind = bar.source
    alpha, a, _, d = arm.dh[row]
    if kind == 'a':
        return row, np.array([[0.0, 0.0, 0.0], [a, 0.0, 0.0]])
    if arm.is_prismatic[row]:
        # Of a length that `stretch` sets; here the greatest one.
        d = max(d + start_bounds(arm)[:, row], key=abs)
    return row + 1, np.array([[0.0, 0.0, -d], [0.0, 0.0, 0.0]])


def stretch(physics: PhysicsModel, q: Array) -> None:
    """Set the lengths of the bars that slide, for a configuration (dof,) [rad or m]."""
    model = physics.model
    for shape, joint, d in physics.sliding:
        half = 0.5 * (d + float(q[joint]))
        model.geom_pos[shape] = [0.0, 0.0, -half]
        model.geom_size[shape, 1] = abs(half)
        model.geom_rbound[shape] = model.geom_size[shape, 0] + abs(half)
        model.geom_aabb[shape, 5] = model.geom_rbound[shape]


def _add_frame(parent: Any, name: str, T: Array) -> Any:
    return parent.add_body(name=name, pos=T[:3, 3], quat=np.roll(quaternion_xyzw(T[:3, :3]), 1))


def _add_capsule(body: Any, name: str, ends: Array, radius: float, **options: Any) -> None:
    """Add a capsule, which is a sphere where its ends are one point."""
    if np.linalg.norm(ends[1] - ends[0]) > LEAST_RADIUS:
        shape = {'type': mujoco.mjtGeom.mjGEOM_CAPSULE, 'fromto': ends.ravel()}
    else:
        shape = {'type': mujoco.mjtGeom.mjGEOM_SPHERE, 'pos': ends[0]}
    body.add_geom(name=name, size=[radius, 0.0, 0.0], **shape, **options)


def _add_sphere(body: Any, name: str, mass: float) -> None:
    _add_capsule(body, name, np.zeros((2, 3)), 2.0 * SEEN_RADIUS, rgba=ARM_COLOR, **_seen(mass))


def _seen(mass: float) -> dict[str, Any]:
    """Return the options of a shape that is only seen."""
    return {'mass': mass, 'contype': 0, 'conaffinity': 0, 'group': SEEN_GROUP}
