# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What an arm weighs, and what its joints resist and can do."""

from dataclasses import dataclass

import numpy as np
from rrth_planner.model.arrays import Array, frozen_array
from rrth_planner.model.errors import OptionsError

# Of a joint that turns; of one that slides N, N s/m and kg.
UNITS = {
    'link_mass': 'kg',
    'max_effort': 'N m',
    'friction': 'N m',
    'damping': 'N m s/rad',
    'armature': 'kg m^2',
}
# What may be 0.
MAY_BE_0 = ('friction', 'damping', 'armature')


@dataclass(frozen=True, slots=True, eq=False)
class Inertia:
    """
    Mass of the part that a joint moves, up to the next joint.

    Parameters
    ----------
    mass : float
        > 0 [kg].
    center : array_like, shape (3,)
        Centre of mass in Craig's frame of the joint [m].
    tensor : array_like, shape (3, 3)
        About the centre of mass, along the axes of that frame [kg m^2].

    Raises
    ------
    OptionsError
        A mass that is not positive, a tensor that no body has.

    """

    mass: float
    center: Array
    tensor: Array

    def __post_init__(self) -> None:
        """Validate and freeze."""
        if not 0.0 < self.mass < np.inf:
            raise OptionsError(f'mass: {self.mass}, expected > 0 [kg]')
        for name, shape, unit in (('center', (3,), 'm'), ('tensor', (3, 3), 'kg m^2')):
            value = frozen_array(getattr(self, name), shape, name, unit, OptionsError)
            object.__setattr__(self, name, value)
        moments = np.linalg.eigvalsh(self.tensor)
        if not moments[0] > 0.0 or moments[2] > moments[0] + moments[1] + 1e-9 * moments[2]:
            raise OptionsError(
                f'tensor: principal moments {moments.tolist()}, expected all > 0, none greater '
                'than the sum of the others [kg m^2]'
            )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Mechanics:
    """
    Masses, resistance and strength of the joints of an arm, array_like of shape (dof,) each.

    Parameters
    ----------
    link_mass : array_like
        Of the part that each joint moves, up to the next joint, spread over its bars [kg].
    max_effort : array_like
        Of each servo [N m, of a joint that slides N].
    friction : array_like
        Dry friction [N m or N].
    damping : array_like
        Viscous friction [N m s/rad or N s/m].
    armature : array_like
        What the rotor of the motor adds behind its gear [kg m^2 or kg].
    payload : float
        Mass at the origin of the tool [kg].
    inertias : tuple of Inertia
        One a joint, in place of `link_mass`; none: those of `link_mass`.

    Raises
    ------
    OptionsError
        A value out of its range, arrays of different lengths.

    """

    link_mass: Array
    max_effort: Array
    friction: Array
    damping: Array
    armature: Array
    payload: float = 0.0
    inertias: tuple[Inertia, ...] = ()

    def __post_init__(self) -> None:
        """Validate and freeze."""
        dof: int | None = None
        for name, unit in UNITS.items():
            value = frozen_array(getattr(self, name), (dof,), name, unit, OptionsError)
            dof = len(value)
            if not (value >= 0.0).all() or (name not in MAY_BE_0 and not value.all()):
                least = '>= 0' if name in MAY_BE_0 else '> 0'
                raise OptionsError(
                    f'{name}: {value.tolist()}, expected a value {least} for every joint [{unit}]'
                )
            object.__setattr__(self, name, value)
        if not 0.0 <= self.payload < np.inf:
            raise OptionsError(f'payload: {self.payload}, expected a mass >= 0 [kg]')
        if len(self.inertias) not in (0, dof):
            raise OptionsError(f'inertias: {len(self.inertias)}, expected none or {dof}')


def usual_mechanics(dof: int) -> Mechanics:
    """Return those of a light arm with geared motors, as config/simulation.yaml says."""
    return Mechanics(
        link_mass=np.full(dof, 1.0),
        max_effort=np.full(dof, 20.0),
        friction=np.full(dof, 0.1),
        damping=np.full(dof, 0.5),
        armature=np.full(dof, 0.1),
        payload=0.2,
    )
