# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Plan as the planner would, with its parameters and inputs, and publish nothing."""

from geometry_msgs.msg import PointStamped
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.errors import MessageError
from rrth_planner.model.status import ErrorCode
from rrth_planner.pipeline.host import BlockingHost, completed
from rrth_planner.pipeline.in_process_planner import InProcessPlanner
from rrth_planner.requests.answer import Answer
from rrth_planner.requests.outcome import Outcome
from rrth_planner.requests.plan_request import plan_request
from rrth_planner.requests.revalidation import Revalidation
from rrth_planner.ros.client.planner_client import PlannerClient
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import in_effect, PlannerParameters
from rrth_planner.ros.interface.scene_monitor import SceneMonitor
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.error_codes import code_of_rejection
from visualization_msgs.msg import MarkerArray


def plan_without_moving(
    client: PlannerClient,
    parameters: PlannerParameters,
    target: PointStamped,
    body: MarkerArray | None,
) -> tuple[Answer, float | None]:
    """
    Return what the planner would answer, and by how much the motion would miss the target [m].

    Without a body the one on `body_boxes` counts. Raises NotInTimeError where there are no joint
    positions, or no body.
    """
    inputs = Inputs(
        *(client.resolve_topic_name(name) for name in ('body_boxes', 'target', 'joint_states'))
    )
    scene_monitor = SceneMonitor(client, parameters, inputs)
    client.wait_for(lambda: inputs.joints.measured is not None, inputs.joints.topic)
    if body is None:
        client.wait_for(
            lambda: inputs.body.measured is not None or inputs.body.rejection is not None,
            f'a body on {inputs.body.topic} (none was given with --body)',
        )
    planner = InProcessPlanner()
    planner.warm_up(parameters.arm, parameters.options)
    # Compiling or loading may have taken a while; the arm may have moved.
    client.wait_for_state(parameters.arm.joint_names)
    try:
        goal = scene_monitor.goal(target)
    except MessageError as problem:
        code = code_of_rejection(problem, ErrorCode.INVALID_GOAL_CONSTRAINTS)
        return Answer(code, str(problem)), None

    def now() -> float:
        return client.get_clock().now().nanoseconds * 1e-9

    if body is not None:
        inputs.body.accept(lambda: WearerBody().apply(body, now(), parameters.base_frame), now())

    # Not published, a motion counts as long as it could be.
    async def in_time(outcome: Outcome, revalidation: Revalidation) -> Outcome | None:
        return None if revalidation.is_late() else outcome

    host, present = BlockingHost(planner, now), in_effect(parameters, inputs.source)
    outcome = completed(plan_request(host, inputs, present, lambda: False, in_time, goal))
    error = None
    if outcome.trajectory is not None:
        error = pointing_error(parameters.arm, outcome.trajectory.positions[-1], goal.target)
    return outcome.answer, error
