# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where the wearer's parts will be soon, if they go on as they move."""

import numpy as np
from rrth_planner.execution.body_motion import places_of
from rrth_planner.execution.executing_motion import ExecutingMotion
from rrth_planner.execution.remaining_motion import is_remaining_free
from rrth_planner.kernels.layout import MAX_BOXES, SIZE
from rrth_planner.model.curves import part
from rrth_planner.model.frozen import changed
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Scene, scene_of_rows

# A part is looked for at these times, if it goes on: about as long as a stop takes [s].
AHEAD = (0.1, 0.2, 0.3)
# A slower part counts as at rest [m/s].
SLOW = 0.2


def expected_scene(before: Scene, present: Scene, elapsed: float) -> Scene:
    """
    Return the moving parts of a wearer at the times `AHEAD`, from two sights of him.

    elapsed: time from one to the other, > 0 [s]. The result has no box where nothing moves.
    """
    old = places_of(before, present)
    known = np.flatnonzero(old >= 0)
    boxes = present.numbers
    velocities = (boxes[known, :SIZE] - before.numbers[old[known], :SIZE]) / elapsed
    is_moving = np.linalg.norm(velocities, axis=1) > SLOW
    if not is_moving.any():
        return Scene(())
    # With very many parts there is room for the last times only.
    times = np.array(AHEAD[-max(1, MAX_BOXES // max(1, int(is_moving.sum()))) :])
    # Part by part, each at all times.
    places = np.repeat(known[is_moving], len(times))
    rows = boxes[places]
    rows[:, :SIZE] += (times[:, None] * velocities[is_moving][:, None]).reshape(-1, SIZE)
    return scene_of_rows(tuple([present.names[i] for i in places.tolist()]), rows)


def joined(present: Scene, expected: Scene) -> Scene:
    """Return a wearer as he is and as he will be soon; as he is where there is no room for it."""
    if not 0 < len(expected.boxes) <= MAX_BOXES - len(present.boxes):
        return present
    names, rows = present.names + expected.names, [present.numbers, expected.numbers]
    return scene_of_rows(names, np.concatenate(rows))


def is_expected_free(
    running: ExecutingMotion, phase: float, required: RequiredClearance, expected: Scene
) -> bool:
    """
    Return whether the next stretch of a motion is free of where the wearer is expected.

    An escape is not judged: it leaves where he is. The parameters are those of
    `is_remaining_free`.
    """
    if not expected.boxes or phase < running.escape_time:
        return True
    stretch = part(running.trajectory, phase, phase + AHEAD[-1])
    ahead = changed(running, trajectory=stretch, target_distance=0.0, escape_time=0.0)
    return is_remaining_free(ahead, 0.0, required, expected)
