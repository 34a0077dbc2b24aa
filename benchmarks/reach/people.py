# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded people: who is in which recording, and how far his parts get."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.model.arrays import Array
from rrth_planner.model.separation import governing_reach, SeparationRules, speed_bound
from rrth_planner.wearer.body_boxes import rows_of_postures
from rrth_planner.wearer.joint_positions import joints_of
from rrth_planner.wearer.recorded_person import postures_at, RecordedPerson
from rrth_planner.wearer.skeleton import Skeleton

from benchmarks.reach.containment import reaches

# Frames a second of the tracker [1/s].
FRAMES = 60.0
# Recordings begin with a T-pose of so long [s].
T_POSE = 0.1
# Bones that do not change from one recording of a person to the next, up to so much [m].
RIGID = (
    *(('left elbow', 'left wrist'), ('right elbow', 'right wrist')),
    *(('left hip', 'left knee'), ('right hip', 'right knee')),
)
SAME = 1e-3
STATED = SeparationRules(body_reach=())


@dataclass(slots=True, eq=False)
class Take:
    """
    A recording at a rate, and how far parts get in it.

    Parameters
    ----------
    person : str
        Whose it is.
    out : dict of ndarray, shape (n_times, n_frames)
        By part, how far it got out of where it was that much earlier [m].
    n_pairs, n_faster : dict of int
        By part: pairs of frames, and those after which a corner had gone further than stated.
    is_faster : dict of ndarray, shape (n_frames,)
        By part, whether a frame is the later one of such a pair.

    """

    name: str
    person: str
    rate: float
    n_frames: int
    out: dict[str, Array] = field(default_factory=dict)
    n_pairs: dict[str, int] = field(default_factory=dict)
    n_faster: dict[str, int] = field(default_factory=dict)
    is_faster: dict[str, Array] = field(default_factory=dict)


def skeleton_name(file: Path) -> str:
    """Return what makes boxes of a recording, by its name."""
    return 'tum_bvh' if 'tum' in file.stem else 'cmu_bvh'


def kind_of(part: str) -> str:
    """Return the words of the stated speeds that fit a part best, as `hand` for a left one."""
    return governing_reach(STATED, part)[0]


def persons_of(files: Sequence[Path]) -> dict[Path, str]:
    """Return who is in which recording: bones of the same lengths are the same person's."""
    known: list[tuple[Array, str]] = []
    found: dict[Path, str] = {}
    for file in files:
        bones = _bones_of(load_person(file), load_skeleton(skeleton_name(file)))
        name = next(
            (
                name
                for other, name in known
                if len(other) == len(bones) and np.abs(other - bones).max() <= SAME
            ),
            None,
        )
        if name is None:
            name = f'person {len(known) + 1}'
            known.append((bones, name))
        found[file] = name
    return found


def _bones_of(person: RecordedPerson, skeleton: Skeleton) -> Array:
    """Return how long the bones of a person are that never change [m]."""
    times = np.array([T_POSE])
    joints = joints_of(skeleton, person.names, *postures_at(person, times))[0]
    place = {joint.name: at for joint, at in zip(skeleton.joints, joints, strict=True)}
    spans = [place[end] - place[start] for start, end in RIGID if {start, end} <= set(place)]
    return np.array([np.linalg.norm(span) for span in spans])


def rows_at_rate(file: Path, rate: float, skeleton: Skeleton) -> Array:
    """Return the boxes of a recording from frame to frame, (n_frames, n_parts, 15)."""
    person = load_person(file)
    n = int((person.duration - T_POSE) * FRAMES / rate)
    times = T_POSE + np.arange(n) * rate / FRAMES
    return rows_of_postures(skeleton, person.names, *postures_at(person, times))


def measured(item: tuple[Path, str, float, int, Skeleton]) -> Take:
    """Return how far the parts of a person get: file, person, rate, steps, skeleton."""
    file, person, rate, n_steps, skeleton = item
    rows = rows_at_rate(file, rate, skeleton)
    take = Take(file.stem, person, rate, len(rows))
    times = np.arange(1, n_steps + 1)[:, None] / FRAMES
    for k, part in enumerate(skeleton.parts):
        out, gone = reaches(rows[:, k], n_steps)
        speed = speed_bound(STATED, part.name)
        take.out[part.name] = out
        take.n_pairs[part.name] = int(np.isfinite(out).sum())
        with np.errstate(invalid='ignore'):
            is_faster = gone > speed * times + STATED.body_error
        take.n_faster[part.name] = int(is_faster.sum())
        take.is_faster[part.name] = is_faster.any(axis=0)
    return take
