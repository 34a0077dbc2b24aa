# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What python-fcl says of a stop, once it is on its way: a moving arm does not wait for that."""

from collections.abc import Callable

from rrth_planner.collision.fcl_checker import first_violation
from rrth_planner.collision.violation import Disagreement
from rrth_planner.io.incident import disagreement_incident, Incident
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.ros.interface.parameters import PlannerParameters


def incident_of_stop(
    stop: Trajectory,
    scene: Scene,
    goal: PointingGoal,
    parameters: PlannerParameters,
    pause: Callable[[], None],
) -> Incident | None:
    """
    Return the record of a stop that is proven free and touches for python-fcl, or None.

    Parameters
    ----------
    stop : Trajectory
        Published.
    scene : Scene
        The wearer that it was proven free of.
    goal : PointingGoal
        Of the motion that it ends.
    parameters : PlannerParameters
    pause : callable
        As in `fcl_checker.first_violation`.

    """
    arm, margin, ray = parameters.arm, parameters.margin, parameters.ray_guard_length
    touch = first_violation(arm, scene, stop, margin, ray, ray, pause)
    if touch is None:
        return None
    question = PlanQuestion(
        arm=arm,
        scene=scene,
        q_start=stop.positions[0],
        goal=goal,
        limits=parameters.limits,
        options=parameters.options,
        margin=margin,
        ray_guard_length=ray,
        seed=max(0, parameters.seed),
        escape_depth=parameters.escape_depth,
    )
    return disagreement_incident(question, Disagreement(stop, touch))
