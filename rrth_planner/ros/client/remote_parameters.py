# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of a running planner node."""

from collections.abc import Sequence
from typing import Any

from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.errors import RrthError
from rrth_planner.ros.client.planner_client import PlannerClient
from rrth_planner.ros.interface.parameters import (
    declared,
    parameters_from_values,
    PlannerParameters,
)
from rrth_planner.ros.middleware.parameter_declaration import ARM

NODE = 'rrth_planner'


def parameters_of_planner(client: PlannerClient) -> PlannerParameters:
    """
    Return the present parameters of the planner.

    Raises
    ------
    NotInTimeError
        No planner answers.
    RrthError
        It has other parameters, or its arm is described by a file that is not here.

    """
    asking = AsyncParameterClient(client, NODE)
    node = client.resolve_service_name(NODE)
    client.wait_for(asking.services_are_ready, f'the parameter services of {node}')

    def values_of(names: Sequence[str]) -> dict[str, Any]:
        future = asking.get_parameters(list(names))
        client.wait_for(future.done, f'the parameters of {node}')
        found = [parameter_value_to_python(value) for value in future.result().values]
        values = dict(zip(names, found, strict=False))
        missing = [name for name in names if values.get(name) is None]
        if missing:
            raise RrthError(
                f'{node}: no parameter {missing[0]}, expected a planner of this version'
            )
        return values

    arm = load_arm(values_of([ARM.name])[ARM.name])
    return parameters_from_values(values_of([s.name for s in declared(arm.dof)]), arm)
