# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Pairs of parts of an arm that may meet: those that always do, and those that an SRDF names."""

from pathlib import Path

import numpy as np
from rrth_planner.collision.reference_checker import bar_distances, bar_ends_at
from rrth_planner.io.text_file import load_xml
from rrth_planner.model.arm import ArmModel, Bar, bars_of, mount_bars
from rrth_planner.model.arrays import Array
from rrth_planner.model.errors import ModelError, shown

# What collides in the middle of all joint ranges and in so many configurations always does.
ALWAYS_SHARE = 0.95
Pair = tuple[str, str]


def colliding_pairs(arm: ArmModel, n_samples: int = 2000) -> tuple[Pair, ...]:
    """
    Return the pairs of parts of an arm that always collide, by name, the inner one first.

    Those that collide in the middle of the joint ranges and in more than 95 % of so many random
    configurations. Parts of one link, or of links with one joint between them, are left out: the
    planner lets them collide anyway.
    """
    found = []
    bars, ends, places = _bars_at(arm, _samples(arm, n_samples))
    for names, pairs in places.items():
        # Few collide in the middle, so that few are looked at in all configurations.
        if (
            _collide(bars, ends[:1], pairs).all()
            and _collide(bars, ends, pairs).mean() > ALWAYS_SHARE
        ):
            found.append(names)
    return tuple(found)


def collision_shares(arm: ArmModel, n_samples: int) -> dict[Pair, float]:
    """
    Return in which share of random configurations each pair of parts collides [-].

    Of the pairs that `colliding_pairs` looks at, the inner part first.
    """
    bars, ends, places = _bars_at(arm, _samples(arm, n_samples))
    return {names: float(_collide(bars, ends, pairs).mean()) for names, pairs in places.items()}


def _samples(arm: ArmModel, n: int) -> Array:
    """Return the middle of the joint ranges and n random configurations, (n + 1, dof)."""
    low, high = arm.bounds
    samples = np.random.default_rng(0).uniform(low, high, (n, arm.dof))
    return np.concatenate([arm.bounds.mean(axis=0)[None], samples])


def _bars_at(
    arm: ArmModel, q: Array
) -> tuple[tuple[Bar, ...], Array, dict[Pair, list[tuple[int, int]]]]:
    """Return the bars of an arm, their ends, and which of them may make which parts collide."""
    # So far the ray of an arm leads past itself, and hardly farther [m].
    length = float(np.abs(arm.dh[:, [1, 3]]).sum())
    bars, ends = (*bars_of(arm), *mount_bars(arm)), bar_ends_at(arm, q, length)
    places: dict[Pair, list[tuple[int, int]]] = {}
    for i in range(len(bars)):
        for j in range(len(bars)):
            if bars[j].body - bars[i].body > 1:
                places.setdefault((bars[i].name, bars[j].name), []).append((i, j))
    return bars, ends, places


def _collide(bars: tuple[Bar, ...], ends: Array, places: list[tuple[int, int]]) -> Array:
    """Return in which configurations any two bars of some pairs collide, (n,)."""
    gaps = [
        bar_distances(ends[:, i], ends[:, j]) - bars[i].radius - bars[j].radius for i, j in places
    ]
    result: Array = np.min(gaps, axis=0) <= 0.0
    return result


def disabled_pairs(file: Path, arm: ArmModel, robot: str) -> tuple[tuple[Pair, ...], list[str]]:
    """
    Return the pairs of an arm's parts that an SRDF lets collide: disable_collisions of two links.

    Parameters
    ----------
    robot : str
        What the URDF calls the robot.

    Returns
    -------
    pairs : tuple of (str, str)
    strangers : list of str
        Links that it names and that are no parts of the arm.

    Raises
    ------
    ModelError
        No SRDF, that of another robot, or a pair without two names.

    """
    root = load_xml(file)
    if root.tag != 'robot':
        raise ModelError(f'file {file}: <{root.tag}>, expected an SRDF, which is a <robot>')
    if root.get('name') != robot:
        raise ModelError(
            f'give the SRDF of robot {shown(robot)}, as the URDF calls it: file {file} is that of '
            f'{shown(root.get("name"))}'
        )
    body = {bar.name: bar.body for bar in (*bars_of(arm), *mount_bars(arm))}
    found, strangers = [], []
    for element in root.iter('disable_collisions'):
        names = element.get('link1'), element.get('link2')
        one, other = names
        if one is None or other is None:
            raise ModelError(
                f'file {file}: disable_collisions of {shown(names)}, expected link1 and link2'
            )
        strangers += [name for name in (one, other) if name not in body]
        if one in body and other in body and abs(body[one] - body[other]) > 1:
            found.append((one, other))
    return tuple(dict.fromkeys(found)), list(dict.fromkeys(strangers))
