# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The links of a URDF as capsules of the arm that its chain is."""

from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
import math
from typing import Any

import numpy as np
from rrth_planner.io.urdf.allowed_pairs import collision_shares
from rrth_planner.io.urdf.capsules import cost_of, enclosing_capsules, Fit, uncovered
from rrth_planner.io.urdf.chain import joint_limits, joint_motion, squared, UrdfChain
from rrth_planner.io.urdf.geometry import link_triangles, parts_of
from rrth_planner.io.urdf.import_chain import ImportedArm, with_capsules
from rrth_planner.model.arm import Capsule, forward_kinematics
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError

# How closely capsules fit a link, and what is tried for two links that often collide, perhaps only
# because their capsules are thicker than they are: more capsules, or thinner ones.
USUAL = Fit(slack=0.02, most=4)
CLOSER = (Fit(slack=0.01, most=8, worth=0.02), Fit(slack=0.02, most=4, power=8.0))
# Two links often collide where they do so in more than this share of random configurations. A
# closer fit is taken where it reduces that share to less than this part of it.
OFTEN_SHARE, CLOSER_SHARE = 0.25, 0.7
N_SAMPLES = 500
# Between two positions at which a joint beside the chain is looked at [rad].
BRANCH_STEP = 0.5
MOST_POSES = 200


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedLink:
    """
    A link of a URDF with all joints of the chain at 0.

    Parameters
    ----------
    body : int
        How many joints of the chain move it.
    is_moved : bool
        Whether a joint beside the chain moves it too.
    poses : ndarray, shape (n, 4, 4)
        In the chain's first link [m]; several where joints beside the chain are looked at.
    arc, pad : float
        Between these poses a point that is r from the link's origin is at most `arc * r + pad`
        away from the lines that join them [1 and m].

    """

    link: Any
    body: int
    is_moved: bool
    poses: Array
    arc: float
    pad: float


@dataclass(frozen=True, slots=True, eq=False)
class EnclosedLink:
    """
    A link and its capsules: none where those of another link enclose it too.

    Parameters
    ----------
    slack : float
        How far a capsule reaches beyond the convex hull of the part that it encloses [m].

    """

    name: str
    capsules: tuple[Capsule, ...]
    slack: float


@dataclass(frozen=True, slots=True, eq=False)
class Flesh:
    """
    What an arm's links are made of.

    Parameters
    ----------
    links : tuple of EnclosedLink
        Those with geometry.
    bare : tuple of str
        Links between base and tool that are only seen.
    left_out : tuple of str
        Links with geometry that joints beside the chain move.

    """

    links: tuple[EnclosedLink, ...]
    bare: tuple[str, ...]
    left_out: tuple[str, ...]

    @property
    def capsules(self) -> tuple[Capsule, ...]:
        """All capsules of the arm."""
        return tuple(capsule for link in self.links for capsule in link.capsules)


def _silent(_: str) -> None:
    """Report no link that is being enclosed."""


def enclose_links(
    found: ImportedArm,
    include_branches: bool = False,
    geometry: str = 'collision',
    on_link: Callable[[str], None] = _silent,
) -> Flesh:
    """
    Return capsules that enclose the geometry of an arm's links.

    Of the links from the chain's first one outwards: those of the chain and those fixed to them.
    Links that often collide with each other are enclosed more closely, where that helps.

    Parameters
    ----------
    include_branches : bool
        Whether links that joints beside the chain move, as fingers, are enclosed in all positions
        of these joints, or left out.
    geometry : str
        What is enclosed: collision or visual, as in `geometry.parts_of`.
    on_link : callable
        Called with the name of each link before it is enclosed.

    Raises
    ------
    ModelError, NotInstalledError
        Geometry that cannot be read or enclosed, a joint beside the chain that has no limits or
        moves otherwise; what reads it is missing.

    """

    def enclose(fits: Mapping[str, Fit], names: Container[str] | None = None) -> Flesh:
        return _enclose(found, include_branches, geometry, on_link, fits, names)

    usual = enclose({})
    closer = _closer_fits(found, usual, enclose)
    return enclose(closer) if closer else usual


def _closer_fits(
    found: ImportedArm, usual: Flesh, enclose: Callable[..., Flesh]
) -> dict[str, Fit]:
    """Return which links of an arm are to be enclosed more closely, and how."""
    if not usual.capsules:
        return {}
    shares = collision_shares(with_capsules(found, usual.capsules, 0.0).arm, N_SAMPLES)
    links = {capsule.name for capsule in usual.capsules}
    often = {
        pair: share
        for pair, share in shares.items()
        if share > OFTEN_SHARE and links.issuperset(pair)
    }
    names = {name for pair in often for name in pair}
    fits: dict[str, Fit] = {}
    if not names:
        return fits
    tried = {USUAL: usual} | {fit: enclose(dict.fromkeys(names, fit), names) for fit in CLOSER}
    for pair, share in sorted(often.items(), key=lambda item: -item[1]):
        if pair[0] in fits or pair[1] in fits:
            continue
        results = {}
        for both in product(tried, tried):
            capsules = tuple(
                capsule
                for name, fit in zip(pair, both, strict=True)
                for capsule in tried[fit].capsules
                if capsule.name == name
            )
            arm = with_capsules(found, capsules, 0.0).arm
            # A link that lies in the capsules of another one has none of its own.
            results[both] = collision_shares(arm, N_SAMPLES).get(pair, 1.0), len(capsules)
        best = min(results, key=lambda both: results[both])
        if results[best][0] < CLOSER_SHARE * share:
            fits |= zip(pair, best, strict=True)
    return fits


def _enclose(
    found: ImportedArm,
    include_branches: bool,
    geometry: str,
    on_link: Callable[[str], None],
    fits: Mapping[str, Fit],
    names: Container[str] | None,
) -> Flesh:
    """Return capsules around an arm's links, or those named; fits: of those that are not usual."""
    chain, arm = found.chain, found.arm
    frames = np.stack([arm.T_base_mount, *forward_kinematics(arm, np.zeros(arm.dof))])
    on_chain = {chain.base, *(joint.child for joint in chain.joints)}
    enclosed: list[EnclosedLink] = []
    bare, left_out = [], []
    for placed in _placed_links(chain, include_branches):
        name = placed.link.name
        if names is not None and name not in names:
            continue
        if not parts_of(placed.link, geometry):
            bare += [name] if name in on_chain and placed.link.visuals else []
            continue
        if placed.is_moved and not include_branches:
            left_out.append(name)
            continue
        on_link(name)
        surfaces = link_triangles(placed.link, chain.file, geometry)
        poses = np.linalg.inv(frames[placed.body]) @ found.T_base_link @ placed.poses
        beside = [
            capsule
            for other in enclosed
            for capsule in other.capsules
            if capsule.link == placed.body
        ]
        enclosed.append(_enclosed(placed, surfaces, poses, beside, fits.get(name, USUAL)))
    return Flesh(tuple(enclosed), tuple(bare), tuple(left_out))


def _enclosed(
    placed: PlacedLink,
    surfaces: tuple[Array, ...],
    poses: Array,
    beside: list[Capsule],
    fit: Fit,
) -> EnclosedLink:
    """Return a link with its surfaces enclosed, at poses in the frame of its body."""
    name = placed.link.name
    parts = [np.concatenate([part @ T[:3, :3].T + T[:3, 3] for T in poses]) for part in surfaces]
    triangles = np.concatenate(parts)
    if not placed.is_moved and not len(uncovered(triangles, beside)):
        return EnclosedLink(name, (), 0.0)
    # Only one is convex, and holds what is between the poses.
    found = enclosing_capsules(triangles, fit._replace(most=1) if placed.is_moved else fit)
    if not placed.is_moved and 1 < len(parts) <= fit.most:
        apart = [enclosing_capsules(part, fit._replace(most=1))[0] for part in parts]
        if sum(cost_of(one, fit.power) for one in apart) < sum(
            cost_of(one, fit.power) for one in found
        ):
            found = apart
    if len(lost := uncovered(triangles, found)):
        raise ModelError(
            f'link "{name}": {len(lost)} corners of its geometry not proven to be in its '
            f'capsules, the first at {lost[0].tolist()}, expected none [m]'
        )
    farthest = max(float(np.linalg.norm(part, axis=2).max()) for part in surfaces)
    more = placed.arc * farthest + placed.pad
    return EnclosedLink(
        name,
        tuple(
            Capsule(name=name, link=placed.body, ends=one.ends, radius=one.radius + more)
            for one in found
        ),
        max(one.slack for one in found) + more,
    )


def _placed_links(chain: UrdfChain, include_branches: bool) -> Iterator[PlacedLink]:
    """Yield the links of a URDF from the chain's first one outwards, depth first."""
    links = {link.name: link for link in chain.robot.links}
    on_chain = {joint.name for joint in chain.joints}
    first = PlacedLink(
        link=links[chain.base], body=0, is_moved=False, poses=np.eye(4)[None], arc=0.0, pad=0.0
    )
    waiting = [first]
    while waiting:
        here = waiting.pop()
        yield here
        after = [joint for joint in chain.robot.joints if joint.parent == here.link.name]
        for joint in reversed(after):
            is_beside = joint.type != 'fixed' and joint.name not in on_chain
            T = np.eye(4) if joint.origin is None else squared(joint.origin)
            poses, arc = here.poses @ T, here.arc
            pad = here.pad + here.arc * float(np.linalg.norm(T[:3, 3]))
            if is_beside and include_branches:
                motions, arc_more, stroke = _motions(joint, chain)
                pad, arc = pad + here.arc * stroke, here.arc + arc_more
                poses = (poses[:, None] @ motions).reshape(-1, 4, 4)
                if len(poses) > MOST_POSES:
                    raise ModelError(
                        f'joint "{joint.name}": {len(poses)} poses of the branch that it moves, '
                        f'expected at most {MOST_POSES}: leave branches out [-]'
                    )
            body = here.body + (joint.type != 'fixed' and not is_beside)
            waiting.append(
                PlacedLink(
                    link=links[joint.child],
                    body=body,
                    is_moved=here.is_moved or is_beside,
                    poses=poses,
                    arc=arc,
                    pad=pad,
                )
            )


def _motions(joint: Any, chain: UrdfChain) -> tuple[Array, float, float]:
    """
    Return what a joint beside the chain does, position by position over its range.

    Returns
    -------
    poses : ndarray, shape (n, 4, 4)
        Of what it moves, in its own frame [m].
    arc : float
        How far points at distance 1 are from the lines between their places at two neighbours.
    stroke : float
        How far it slides at most [m].

    """
    if joint.type not in ('revolute', 'continuous', 'prismatic'):
        raise ModelError(
            f'joint "{joint.name}": {joint.type}, expected revolute, continuous or prismatic ones '
            'in branches'
        )
    low, high = _range(joint, chain)
    is_sliding = joint.type == 'prismatic'
    n = 2 if is_sliding else max(2, math.ceil((high - low) / BRANCH_STEP) + 1)
    poses = np.array([joint_motion(joint, value) for value in np.linspace(low, high, n)])
    if is_sliding:
        return poses, 0.0, max(abs(low), abs(high))
    return poses, 1.0 - math.cos(0.5 * (high - low) / (n - 1)), 0.0


def _range(joint: Any, chain: UrdfChain) -> tuple[float, float]:
    """Return how far a joint beside the chain moves, by itself or with another [rad or m]."""
    if joint.mimic is None:
        return joint_limits(joint)
    leaders = [other for other in chain.robot.joints if other.name == joint.mimic.joint]
    if not leaders or leaders[0].mimic is not None:
        raise ModelError(
            f'joint "{joint.name}": moves with "{joint.mimic.joint}", expected a joint that moves '
            'by itself'
        )
    factor = 1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier
    ends = [factor * end + (joint.mimic.offset or 0.0) for end in joint_limits(leaders[0])]
    return min(ends), max(ends)
