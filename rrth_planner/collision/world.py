# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The world of the planners: rows of the arm and the boxes, and the edge check between them."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
import functools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rrth_planner.collision.bar_pairs import pair_names, pairs_of
from rrth_planner.collision.box_tree import grown_groups, pack_boxes
from rrth_planner.kernels import jit, layout
from rrth_planner.kernels.collision import arm_clearance, arm_validity, edge_contacts as contacts
from rrth_planner.kernels.collision.bar_bar import colliding_pair
from rrth_planner.kernels.collision.boxes import rows_of
from rrth_planner.kernels.kinematics import generated_fk as chain
from rrth_planner.kernels.vectors import is_within
from rrth_planner.model.arm import (
    ArmModel,
    bar_names,
    bars_of,
    Capsule,
    is_called,
    mount_bars,
)
from rrth_planner.model.arrays import Array, FARTHEST, float_array, float_number
from rrth_planner.model.errors import check_type, OptionsError, RrthError
from rrth_planner.model.frozen import Frozen, read_only
from rrth_planner.model.joint_range import bounds_from
from rrth_planner.model.reach import reach_table
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene

# Rounding of kinematics and of the separating axes, with room: coordinates up to 1e4 m carry
# errors of about 1e-11 m.
SLACK = 1e-9
EDGE_CHECK = jit.first_class(arm_validity.is_edge_free)
CONTACTS = jit.first_class(contacts.edge_contacts)
FREE_RADIUS = jit.first_class(arm_clearance.free_radius)
# Shortest interval that the edge check bisects to before it gives up [rad].
RESOLUTION = 2e-5
# A finer resolution would overflow the number of checks along an edge.
FINEST = 1e-9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class World(Frozen):
    """
    What planners and certificates need, packed for the kernels.

    Its methods take configurations as numpy does, array_like: lists, single precision, strided;
    numbers that are not finite, and other shapes, raise an RrthError.

    Parameters
    ----------
    bounds : ndarray, shape (2, dof)
        Lowest and highest configuration [rad or m].
    chain : compiled function
        The arm's forward kinematics, `kernels.jit.CHAIN`.
    robot : ndarray, shape (n_rows, 9 + 2 dof)
        The arm as numbers, rows and columns as in `kernels.layout`.
    obstacles : ndarray, shape (n_groups, 8 * 18)
        Boxes grown by the margin, in the arm's base frame, groups as in `kernels.layout` [m]. On a
        map: lower and upper corners, shape (m, 2 dof).
    edge_check, free_radius, contacts : compiled function
        The seams `kernels.jit.EDGE_CHECK`, `FREE_RADIUS` and `CONTACTS`.
    resolution : float
        Third argument of the edge check [rad], at least `FINEST`.
    bar_names, box_names : tuple of str
        Names of the arm's bars and the boxes in messages.
    lanes : ndarray, shape (m,)
        Which lane of the last level of groups holds box i.
    pair_names : tuple of (str, str)
        Names of the bars of the arm that must not collide.

    Attributes
    ----------
    functions : ndarray, shape (4,)
        Addresses of the compiled seams, entries as in `kernels.jit`.
    space : Space
        What searches are handed: functions, resolution, robot, obstacles, bounds.

    Raises
    ------
    OptionsError
        A resolution that is too fine.

    """

    bounds: Array
    chain: Callable[..., int]
    robot: Array
    obstacles: Array
    edge_check: Callable[..., bool]
    free_radius: Callable[..., float]
    contacts: Callable[..., int]
    resolution: float
    bar_names: tuple[str, ...]
    box_names: tuple[str, ...]
    lanes: Any = ()
    pair_names: tuple[tuple[str, str], ...] = ()

    functions: Any = field(init=False)
    space: jit.Space = field(init=False)

    def __post_init__(self) -> None:
        """Validate, freeze, and look up the seams' addresses, entries as in `kernels.jit`."""
        resolution = float_number(
            self.resolution, 'resolution', 'rad', FINEST, FARTHEST, OptionsError
        )
        object.__setattr__(self, 'resolution', resolution)
        object.__setattr__(self, 'lanes', read_only(np.asarray(self.lanes, dtype=np.int64)))
        # Kernels take arrays of one type only: those of a copy are to be like these.
        for name in ('robot', 'obstacles', 'bounds'):
            array = np.asarray(getattr(self, name), dtype=np.float64, order='C')
            object.__setattr__(self, name, read_only(array))
        found = jit.addresses(self.edge_check, self.chain, self.free_radius, self.contacts)
        object.__setattr__(self, 'functions', found)
        space = jit.Space(found, resolution, self.robot, self.obstacles, self.bounds)
        object.__setattr__(self, 'space', space)

    @property
    def ray_length(self) -> float:
        """Length of the pointing ray that must stay clear in motion [m]."""
        return float(self.robot[self.bounds.shape[1], layout.D])

    @property
    def stride(self) -> int:
        """How many numbers the chain writes of a configuration."""
        return int(self.robot[self.bounds.shape[1] + 1, layout.STRIDE])

    def is_in_bounds(self, q: ArrayLike) -> bool:
        """Return whether a configuration, shape (dof,), respects the joints' limits."""
        return bool(is_within(self._configuration(q), self.bounds))

    def is_valid(self, q: ArrayLike, ray_length: float | None = None) -> bool:
        """
        Return whether q, shape (dof,), is within limits and free, with a ray that long [m].

        A point on a map has no ray.
        """
        q = self._configuration(q)
        return bool(is_within(q, self.bounds)) and self._is_free(q, ray_length)

    def is_free(self, q: ArrayLike, ray_length: float | None = None) -> bool:
        """Return whether q, shape (dof,), is free, be it within the joints' limits or not."""
        return self._is_free(self._configuration(q), ray_length)

    def _is_free(self, q: Array, ray_length: float | None) -> bool:
        if self.chain is chain.NO_CHAIN:
            place = self.resolution, self.chain, self.robot, self.obstacles
            return bool(self.edge_check(q, q, *place))
        ray = self._ray(ray_length)
        return bool(
            arm_validity.is_configuration_free(q, ray, self.chain, self.robot, self.obstacles)
        )

    def first_free(
        self, q: ArrayLike, way: ArrayLike, shares: ArrayLike, n_halvings: int
    ) -> float:
        """
        Return the first share of a way from q, (dof,) each, at which the arm is valid, else NaN.

        shares (m,): tried one after the other while the arm is within the joints' limits, as far
        apart as the first is from 0; what is between the last two is halved so often.
        """
        q, way = self._configuration(q), self._configuration(way, 'way')
        shares = float_array(shares, (None,), 'shares', '-')
        address = jit.address(self.chain)
        place = self.ray_length, address, self.robot, self.obstacles, self.bounds
        return float(arm_validity.first_free(q, way, shares, n_halvings, *place))

    def is_edge_valid(self, q_from: ArrayLike, q_to: ArrayLike) -> bool:
        """Return whether the straight motion between two configurations is proven free."""
        q_from, q_to = self._configuration(q_from, 'q_from'), self._configuration(q_to, 'q_to')
        return bool(
            is_within(q_from, self.bounds)
            and is_within(q_to, self.bounds)
            and self.edge_check(
                q_from, q_to, self.resolution, self.chain, self.robot, self.obstacles
            )
        )

    def colliding_bars(
        self, q: ArrayLike, ray_length: float | None = None
    ) -> tuple[str, str] | None:
        """Return the names of two bars that collide at q, shape (dof,), and must not; or None."""
        q = self._configuration(q)
        if not self.pair_names:
            return None
        points = np.empty(self.stride)
        self.chain(q, self._ray(ray_length), points, 0)
        pair = colliding_pair(points, 0, self.bounds.shape[1], self.robot)
        return self.pair_names[pair] if pair >= 0 else None

    def clearances(self, q: ArrayLike, ray_length: float | None = None) -> Array:
        """
        Return the least signed distances of the bars from the grown boxes, (n_bars, m) [m].

        < 0: contact, minus the penetration depth. q has the shape (dof,), or (..., dof) for the
        least over all those configurations [rad or m].
        """
        dof = self.bounds.shape[1]
        q = float_array(q, (..., dof), 'q', 'rad or m')
        if self.chain is chain.NO_CHAIN:
            raise RrthError('clearances: of a point on a map, expected the world of an arm')
        distances = np.empty((len(self.bar_names), layout.LANES * len(self.obstacles)))
        arm_clearance.clearances(
            q.reshape(-1, dof),
            self._ray(ray_length),
            self.chain,
            self.robot,
            self.obstacles,
            distances,
        )
        chosen: Array = distances.take(self.lanes, axis=1)
        return chosen

    def _configuration(self, q: ArrayLike, name: str = 'q') -> Array:
        """Return a configuration as kernels take it, (dof,) [rad or m]."""
        return float_array(q, (self.bounds.shape[1],), name, 'rad or m')

    def _ray(self, length: float | None) -> float:
        """Return a length of the pointing ray, by default the one that must stay clear [m]."""
        if length is None:
            return self.ray_length
        return float_number(length, 'ray_length', 'm', 0.0)


def arm_world(arm: ArmModel, scene: Scene, margin: float, ray_guard_length: float) -> World:
    """
    Return the world of an arm round its wearer.

    The scene is in the base frame; every box is grown by the margin on every side [m], >= 0.
    ray_guard_length: how much of the pointing ray must stay clear in motion [m], >= 0.

    Raises
    ------
    OptionsError
        A margin or a ray_guard_length that is negative, not a number or beyond 1e4 m.

    """
    return world_of(RequiredClearance(arm, margin, ray_guard_length), scene)


def world_of(required: RequiredClearance, scene: Scene) -> World:
    """Return the `arm_world` of what has to stay clear of the boxes of a scene."""
    check_type(scene, Scene, 'scene')
    arm, margin = required.arm, required.margin + SLACK
    robot, compiled_chain = arm_rows(arm, required.ray_guard_length)
    rows = np.empty((layout.BOX_ROWS, len(scene.boxes)))
    rows_of(scene.numbers, allowed_bars(arm, scene), mount_inverse(arm), margin, rows)
    obstacles, lanes = pack_boxes(rows)
    return World(
        bounds=arm.bounds,
        chain=compiled_chain,
        robot=robot,
        obstacles=obstacles,
        edge_check=EDGE_CHECK,
        free_radius=FREE_RADIUS,
        contacts=CONTACTS,
        resolution=RESOLUTION,
        bar_names=tuple(bar_names(arm)),
        box_names=scene.names,
        lanes=lanes,
        pair_names=tuple(pair_names(arm, pair) for pair in pairs_of(arm)),
    )


# While the wearer does not move, plans share the same worlds.
@functools.lru_cache(maxsize=32)
def grown(world: World, by: float) -> World:
    """Return the same world with every box grown by that much more on every side [m]."""
    return replace(world, obstacles=grown_groups(world.obstacles, by))


def with_start(world: World, arm: ArmModel, q_start: Array) -> World:
    """
    Return the same world with limits that reach as far as a start beyond them, shape (dof,) [rad].

    For straight edges from there: on one that ends within the limits no joint moves further out.
    """
    if world.is_in_bounds(q_start):
        return world
    return replace(world, bounds=bounds_from(arm, q_start))


@functools.lru_cache(maxsize=32)
def without_ray(world: World) -> World:
    """Return the same world with an arm whose pointing ray ends where it begins, at the tool."""
    robot = world.robot.copy()
    # The reaches stay those of the ray's end, which are upper bounds.
    robot[world.bounds.shape[1], layout.D] = 0.0
    return replace(world, robot=robot)


@functools.lru_cache(maxsize=16)
def arm_rows(arm: ArmModel, ray_length: float) -> tuple[Array, Any]:
    """Return the rows of an arm, and its compiled chain."""
    rows = robot_rows(arm, ray_length)
    rows.setflags(write=False)
    return rows, chain.chain_of(rows)


def robot_rows(arm: ArmModel, ray_length: float) -> Array:
    """Return an arm as numbers, as in `kernels.layout`, with a ray of that length [m]."""
    dof, bars, pairs = arm.dof, (*bars_of(arm), *mount_bars(arm)), pairs_of(arm)
    first_bar = dof + 2
    first_pair = first_bar + len(bars)
    rows: Any = np.zeros((first_pair + len(pairs), layout.REACH + 2 * dof))
    alpha, a, offset, d = arm.dh.T
    dh = rows[: dof + 1]
    dh[:, layout.COS_ALPHA], dh[:, layout.SIN_ALPHA] = np.cos(alpha), np.sin(alpha)
    dh[:, layout.A], dh[:, layout.OFFSET], dh[:, layout.D] = a, offset, d
    dh[-1, layout.D] = ray_length
    dh[:, layout.KIND] = [layout.PRISMATIC if p else layout.REVOLUTE for p in arm.is_prismatic] + [
        layout.FIXED
    ]
    dh[:, layout.RADIUS_A] = dh[:, layout.RADIUS_D] = layout.NO_BAR
    frames = sorted({pair.body for pair in pairs if pair.body > 0})
    sizes = rows[dof + 1]
    sizes[layout.N_BARS], sizes[layout.FRAMES] = len(bars_of(arm)), layout.BAR_SIZE * len(bars)
    sizes[layout.STRIDE] = sizes[layout.FRAMES] + layout.FRAME_SIZE * len(frames)
    sizes[layout.FIRST_PAIR] = first_pair
    for k, (bar, reach) in enumerate(zip(bars, reach_table(arm, ray_length), strict=True)):
        row = rows[first_bar + k]
        row[layout.REACH :] = reach.reshape(-1)
        if isinstance(bar.source, Capsule):
            row[layout.LINK], row[layout.RADIUS] = bar.source.link, bar.radius
            row[layout.ENDS : layout.ENDS + 6] = bar.source.ends.reshape(-1)
        else:
            row[layout.LINK] = layout.NO_BAR
            i, end = bar.source
            dh[i, layout.RADIUS_A if end == 'a' else layout.RADIUS_D] = bar.radius
    for k, pair in enumerate(pairs):
        slot = frames.index(pair.body) if pair.body > 0 else -1
        rows[first_pair + k, :4] = pair.inner, pair.outer, slot, pair.body
    return np.asarray(rows)


def allowed_bars(arm: ArmModel, scene: Scene) -> NDArray[np.int64]:
    """Return which bars may meet each box, (m,), read-only: bit k for bar k."""
    return _allowed_bars(arm, scene.names)


# The same parts come with every body.
@functools.lru_cache(maxsize=64)
def _allowed_bars(arm: ArmModel, names: tuple[str, ...]) -> NDArray[np.int64]:
    allowed = np.zeros(len(names), np.int64)
    for name, bars in _bars_by_name(arm).items():
        allowed[[is_called(one, name) for one in names]] |= bars
    allowed.setflags(write=False)
    return allowed


@functools.lru_cache(maxsize=16)
def _bars_by_name(arm: ArmModel) -> dict[str, int]:
    """Return which bars may meet the boxes of each name, bit k for bar k."""
    bars = [bar.name for bar in (*bars_of(arm), *mount_bars(arm))]
    found: dict[str, int] = {}
    for part, name in arm.allowed:
        # Names of two bars: `pairs_of` leaves them out.
        if name not in bars:
            met = sum(1 << k for k, bar in enumerate(bars) if bar == part)
            found[name] = found.get(name, 0) | met
    return found


@functools.lru_cache(maxsize=16)
def mount_inverse(arm: ArmModel) -> Array:
    """Return the pose of the base frame in that of the arm, (4, 4) [m]."""
    inverse: Array = np.linalg.inv(arm.T_base_mount).astype(np.float64)
    inverse.setflags(write=False)
    return inverse
