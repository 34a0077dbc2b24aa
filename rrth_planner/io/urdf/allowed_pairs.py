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
ALWAYS = 0.95
Pair = tuple[str, str]


def colliding_pairs(arm: ArmModel, n_samples: int = 2000) -> tuple[Pair, ...]:
    """
    Return the pairs of parts of an arm that always collide, by name, the inner one first.

    Those that collide in the middle of the joint ranges and in more than 95 % of so many random
    configurations. Parts of one link, or of links with one joint between them, are left out: the
    planner lets them collide anyway.
    """
    rng = np.random.default_rng(0)
    low, high = arm.bounds
    samples = rng.uniform(low, high, (n_samples, arm.dof))
    q = np.concatenate([arm.bounds.mean(axis=0)[None], samples])
    # So far the ray of an arm leads past itself, and hardly farther [m].
    length = float(np.abs(arm.dh[:, [1, 3]]).sum())
    bars, ends = (*bars_of(arm), *mount_bars(arm)), bar_ends_at(arm, q, length)
    pairs: dict[Pair, list[tuple[int, int]]] = {}
    for i in range(len(bars)):
        for j in range(len(bars)):
            if bars[j].body - bars[i].body > 1:
                pairs.setdefault((bars[i].name, bars[j].name), []).append((i, j))
    found = []
    for names, places in pairs.items():
        # Few collide in the middle, so that few are looked at in all configurations.
        if _collide(bars, ends[:1], places).all() and _collide(bars, ends, places).mean() > ALWAYS:
            found.append(names)
    return tuple(found)


def _collide(bars: tuple[Bar, ...], ends: Array, places: list[tuple[int, int]]) -> Array:
    """Return in which configurations any two bars of some pairs collide, (n,)."""
    gaps = [
        bar_distances(ends[:, i], ends[:, j]) - bars[i].radius - bars[j].radius for i, j in places
    ]
    result: Array = np.min(gaps, axis=0) <= 0.0
    return result


def disabled_pairs(file: Path, arm: ArmModel) -> tuple[Pair, ...]:
    """
    Return the pairs of an arm's parts that an SRDF lets collide: disable_collisions of two links.

    Raises
    ------
    ModelError
        No SRDF, or a pair without two names.

    """
    root = load_xml(file)
    if root.tag != 'robot':
        raise ModelError(f'file {file}: <{root.tag}>, expected an SRDF, which is a <robot>')
    body = {bar.name: bar.body for bar in (*bars_of(arm), *mount_bars(arm))}
    found = []
    for element in root.iter('disable_collisions'):
        names = element.get('link1'), element.get('link2')
        one, other = names
        if one is None or other is None:
            raise ModelError(
                f'file {file}: disable_collisions of {shown(names)}, expected link1 and link2'
            )
        if one in body and other in body and abs(body[one] - body[other]) > 1:
            found.append((one, other))
    return tuple(dict.fromkeys(found))
