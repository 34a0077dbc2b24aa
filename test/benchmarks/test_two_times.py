# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The same course in two times: what differs is found, and nothing else."""

from dataclasses import replace
import math

import numpy as np
import pytest

pytest.importorskip('rclpy')

from benchmarks.two_times.comparison import compared  # noqa: E402
from benchmarks.two_times.real import Course  # noqa: E402
from benchmarks.two_times.virtual import again  # noqa: E402
from rrth_planner.execution.event import Begin  # noqa: E402
from rrth_planner.execution.flight_recorder import (  # noqa: E402
    FlightRecorder,
    read_flight,
    replay,
)
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.rehearsal.rehearsal import rehearsed  # noqa: E402
from rrth_planner.rehearsal.scenario import load_scenario  # noqa: E402
from rrth_planner.requests.answer import Answer  # noqa: E402


@pytest.fixture(scope='module')
def course():
    """Return a course in virtual time, as one through nodes is recorded, and its seed."""
    scenario = load_scenario(resource_path('config/scenarios/recorded_person.yaml'))
    requests = replace(scenario.requests, gives_up=600.0, replaced=0.4, pause=0.3)
    scenario = replace(scenario, seconds=14.0, requests=requests)
    flight = FlightRecorder(math.inf)
    found = rehearsed(scenario, flight=flight)
    content = flight.to_bytes()
    made = Course(read_flight(content).rules[-1])
    made.events = list(replay(read_flight(content)))
    made.asked = [(one.asked, one.target) for one in found.pursuits]
    return made, scenario.seed


def seeds_of(seed):
    """Return what draws the seeds of a scenario's plans."""
    rng = np.random.default_rng((seed, 2))
    return lambda: int(rng.integers(2**31))


def test_with_the_same_latencies_the_same_is_decided(course):
    made, seed = course
    virtual, outcomes = again(made, -1, seeds_of(seed))
    given = replace(made, answers=[Answer(one.code, one.sentence) for one in outcomes])
    found = compared(given, virtual, outcomes)
    assert found.differences == ()
    assert found.n_same_motions == found.n_motions >= 3
    assert found.n_same_checks == found.n_checks > 1000
    # A decision to stop takes a millisecond in one of them only, and the stop ends further on.
    assert found.farthest < 2e-3


def test_other_seeds_are_other_motions_and_that_is_seen(course):
    made, seed = course
    virtual, outcomes = again(made, -1, seeds_of(seed + 1))
    found = compared(made, virtual, outcomes)
    assert found.n_same_motions < found.n_motions
    assert any('motion' in one for one in found.differences)


def test_a_course_that_lacks_a_motion_is_another_one(course):
    made, seed = course
    virtual, outcomes = again(made, -1, seeds_of(seed))
    left = [one for one in virtual if not isinstance(one.event, Begin)]
    found = compared(made, left, outcomes)
    assert found.n_same_motions == 0
    assert len(found.differences) == found.n_motions
