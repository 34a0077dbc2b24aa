# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Second check of a stop, after it is published: a moving arm does not wait for it."""

from rrth_planner.collision.violation import Disagreement
from rrth_planner.io.incident import disagreement_incident, Incident
from rrth_planner.pipeline.planning_process import Planner
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.ros.monitor.execution_monitor import Stop


def incident_of_stop(stop: Stop, planner: Planner) -> Incident | None:
    """Return the record of a stop that is proven free but violates for python-fcl, or None."""
    if stop.scene is None or stop.goal is None:
        return None
    parameters, trajectory = stop.parameters, stop.trajectory
    arm, margin, ray = parameters.arm, parameters.margin, parameters.ray_guard_length
    violation = planner.violation_seen(arm, stop.scene, trajectory, margin, ray, ray)
    if violation is None:
        return None
    question = PlanQuestion(
        arm=arm,
        scene=stop.scene,
        q_start=trajectory.positions[0],
        goal=stop.goal,
        limits=parameters.limits,
        options=parameters.options,
        margin=margin,
        ray_guard_length=ray,
        seed=max(0, parameters.seed),
        escape_depth=parameters.escape_depth,
    )
    return disagreement_incident(question, Disagreement(trajectory, violation))
