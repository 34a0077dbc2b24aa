# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The report of the reproduction: what the paper says, what we measure, why they differ."""

from collections.abc import Mapping

from rrth_planner.io.arm_file import load_arm
from rrth_planner.kernels.collision.arm_sampled import POINTS_PER_BAR
from rrth_planner.reproduction.claims.arm import (
    arm_table,
    mode_table,
    table_1,
    table_1_claim,
    target_table,
)
from rrth_planner.reproduction.claims.path_club import escape_claim, escape_table, ways_claim
from rrth_planner.reproduction.claims.plane import (
    goal_bias_table,
    long_table,
    plane_claims,
    plane_table,
)
from rrth_planner.reproduction.claims.relatives import relatives_table, relatives_words
from rrth_planner.reproduction.experiments import ARM_STEP, DENSE, Extent, SPARSE, STEPS, TWO_WAYS
from rrth_planner.reproduction.problems import MARGIN, RAY
from rrth_planner.reproduction.statistics import markdown_table, Rows


def report(
    rows: Rows, extent: Extent, command: str, machine: str, pictures: Mapping[str, str]
) -> str:
    """
    Return the report in Markdown.

    Parameters
    ----------
    rows : Rows
        Of one campaign.
    command, machine : str
        What wrote it, on what.
    pictures : mapping
        By caption, where each picture is, relative to the report.

    """
    row, arm = rows.rows[0], load_arm()
    commit = f', commit {row["commit"]}' if row['commit'] else ''
    claims = markdown_table(
        (
            'the paper says',
            'map',
            f'we measure, {extent.few} runs',
            f'we measure, {extent.many} runs',
            'why they differ, or why not',
        ),
        plane_claims(rows, extent),
    )
    gallery = '\n\n'.join(
        f'### {caption}\n\n![{caption}]({path})' for caption, path in pictures.items()
    )
    versions = (
        f'Python {row["python_version"]}, numpy {row["numpy_version"]}, '
        f'numba {row["numba_version"]}, sources {row["source_digest"]}{commit}'
    )
    return f"""# What the paper says, and what we measure

Zou et al. 2024, "Obstacle Avoidance Path Planning of a 4-DOF Weapon Arm Based on Improved RRT
(RRT-H) Algorithm". Only its motion planning is considered here.

Written by `{command}`; do not edit.
{len(rows)} runs on {machine}; {versions}.

Times come from runs done one after another, those of the arm and shares over many seeds from runs
side by side. The paper gives no coordinates, step sizes or spacings: maps, targets and options are
ours (`config/maps`, `rrth_planner/reproduction/experiments.py`). Where it names none, the planners
have one tree, uniform draws and a step of 10 on maps of 100 by 100. "RRT-H" is the method's three
steps as corrected, without what the planner adds to them (`near_bias`, `corner_moves`), "as
printed" the same steps word for word. Every path is checked by code that shares nothing with the
planners.
Numbers are medians, with quartiles in brackets.

## The claims of section 3

RRT and RRT-H stop at the first path; the others run {STEPS} steps.

{claims}

## All planners, {extent.few} runs

{plane_table(rows, extent, extent.few)}

## All planners, {extent.many} runs

{plane_table(rows, extent, extent.many)}

The first cost of RRT*-Smart is that of its first path as it shortened it at once; all others are
of paths as they were grown.

RRT* and Informed RRT* approach the exact shortest path as theory says:

{long_table(rows, extent)}

Draws of the goal itself, which the paper names beside the work that it builds on, and without
which all runs above are made: growth of RRT, the first {extent.seeds} seeds.

{goal_bias_table(rows, extent)}

## Relatives that the paper names, and references

Growth guided by a potential field and smoothing by Dubins' words are named in the paper; A* and
PRM stand for searches that grow no tree at random. All are references in the plane: neither the
planner nor its nodes offer them. Their paths are checked by the same code as all others, arcs as
chords of 0.01 rad. There are no times: these are interpreted Python, the others are compiled. In
the last column a path that was not found counts as longer than any.

{relatives_table(rows, extent)}

{relatives_words(rows, extent)}

## The escape from local traps (section 4)

The paper says that the path club makes new growths explore other ways round, and that the best of
several paths wins (Figure 14; it gives no number). Measured on `{TWO_WAYS}`, whose ways differ by
a third.

{ways_claim(rows, extent)}

{escape_claim(rows)} ({extent.seeds} seeds.) Why the last two hardly differ: from this start a
growth seldom takes the worse way, so that one more growth mostly mends it, with a club or without.

{escape_table(rows)}

## The arm (section 5, Table 1)

{table_1_claim(arm)} The tool's row stands for L5, the ray.

{table_1(arm)}

## The arm's motions (section 6.2)

Accumulated change of the four joint angles from the folded state to {len(extent.targets)} targets,
each by the nearest free goal configuration; none is reached by a straight edge. RRT and RRT-H
come from the same growth (one tree, step {ARM_STEP} rad), mean over the targets and seeds.

{arm_table(rows, extent)}

Why they differ: the wearer, the mount, the targets and the goal configurations are ours; the paper
gives none. RRT's travel depends on its step, and so do the reductions; joint by joint
they depend on which joints the targets require to move. After shortening only the travel that the
goal configuration and the detour round the body require is left, so joint 2, which hardly has to
move, loses most.

{target_table(rows, extent)}

## The collision tests (section 6.1)

{POINTS_PER_BAR} check points lie on the first {RAY:g} m of the ray, every
{100 * RAY / POINTS_PER_BAR:g} cm, as the paper has them, and as many on each bar of the arm, where
it gives no number.

RRT-H with its edges checked in three ways, its paths verified every 0.002 rad by exact clipping
against the boxes grown by the same {100 * MARGIN:.0f} cm, and again without that margin. A
shortcut path is in contact with the boxes, so it collides where a sampled check has a gap. On maps
the verification is exact, and RRT-H as printed is shown with check points every {SPARSE:g} and
every {DENSE:g} map units.

{mode_table(rows, extent)}

## Pictures

{gallery}
"""
