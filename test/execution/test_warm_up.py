# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What the first body of the first motion would have to wait for is loaded before."""

from functools import partial

import pytest
from rrth_planner.collision.separation import Blocked
from rrth_planner.execution import warm_up as module
from rrth_planner.execution.commitment import Commitment
from rrth_planner.execution.warm_up import warm_up
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.separation import Separation, SeparationRules
from worlds import limits


@pytest.mark.parametrize('is_separated', [False, True])
@pytest.mark.parametrize('file', [None, 'config/examples/chest_arm.yaml'])
def test_a_motion_is_monitored_in_each_way_that_there_is(monkeypatch, file, is_separated):
    arm = load_arm() if file is None else load_arm(file)
    found = []

    def noted(name, call, *args, **kwargs):
        result = call(*args, **kwargs)
        found.append((name, type(result)))
        return result

    for name in ('is_remaining_free', 'escapes_by_continuing', 'fast_stop', 'extended'):
        monkeypatch.setattr(module, name, partial(noted, name, getattr(module, name)))
    rates = limits(arm.dof)
    separation = Separation(
        arm=arm, rules=SeparationRules(), margin=0.02, limits=rates, stop_limits=rates
    )
    warm_up(RequiredClearance(arm, 0.02, 1.0), rates, separation if is_separated else None)
    assert {name for name, _ in found[:3]} == {
        'is_remaining_free',
        'escapes_by_continuing',
        'fast_stop',
    }
    # Within the stretch, and within the stop.
    kinds = [kind for name, kind in found if name == 'extended'][:2]
    assert kinds == ([Commitment, Blocked] if is_separated else [])
