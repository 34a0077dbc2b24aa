# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""A rehearsal: a scenario in virtual time, and what was seen of it."""

from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.flight_recorder import FlightRecorder
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arrays import Array
from rrth_planner.model.separation import Separation, SeparationRules
from rrth_planner.model.trajectory import MotionLimits
from rrth_planner.pipeline.in_process_planner import InProcessPlanner
from rrth_planner.rehearsal.parameters import BODY_TIMEOUT, JOINT_TIMEOUT, rehearsed_parameters
from rrth_planner.rehearsal.rehearsed_wearer import (
    HAND_PERIOD,
    Hidden,
    InterceptingWearer,
    RecordedWearer,
)
from rrth_planner.rehearsal.scenario import Pair, Scenario
from rrth_planner.rehearsal.session import (
    Glance,
    GLANCE_PERIOD,
    IDLE,
    Pursuit,
    Session,
    SessionRules,
)
from rrth_planner.rehearsal.virtual_host import VirtualHost
from rrth_planner.rehearsal.witness import Testimony, Witness
from rrth_planner.rehearsal.world import BEGIN, Wire, World
from rrth_planner.simulation.trajectory_controller import ControllerRules, ControllerVersion
from rrth_planner.wearer.hands import hands_of, has_fingers, round_wrists, with_hand_size

# Where the arm begins [rad].
FOLDED = (0.0, -0.35, 0.5 * np.pi, 0.5 * np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class Rehearsal:
    """
    What was seen of a scenario.

    Parameters
    ----------
    digest : str
        Two runs that have the same took the same decisions.

    """

    scenario: Scenario
    digest: str
    n_events: int
    n_commands: int
    n_stops: int
    pursuits: tuple[Pursuit, ...]
    glances: tuple[Glance, ...]
    testimony: Testimony

    @property
    def lost(self) -> dict[tuple[str, str], float]:
        """How long targets took longer than at the full rate, by what the arm did and why [s]."""
        found: dict[tuple[str, str], float] = {}
        for glance in self.glances:
            if glance.doing != IDLE and glance.rate < 1.0:
                key = glance.doing, glance.cause
                found[key] = found.get(key, 0.0) + GLANCE_PERIOD * (1.0 - glance.rate)
        return found


def rehearsed(
    scenario: Scenario, is_drawn: bool = False, flight: FlightRecorder | None = None
) -> Rehearsal:
    """
    Return what is seen of a scenario in virtual time.

    Parameters
    ----------
    is_drawn : bool
        Whether to measure how far the nearest part of the wearer is, for pictures.
    flight : FlightRecorder, optional
        Records the events of the monitor.

    Raises
    ------
    RrthError
        What the scenario names is not there, or does not fit.

    """
    arm = load_arm()
    settings = load_settings(arm.dof)
    proof, execution, tracker = scenario.separation, scenario.controller, scenario.tracker
    stop_limits = MotionLimits(
        velocity=settings.limits.velocity,
        acceleration=np.full(arm.dof, proof.stop_acceleration),
        jerk=np.full(arm.dof, proof.stop_jerk),
    )
    separation = Separation(
        arm=arm,
        rules=SeparationRules(contact_speed=proof.contact_speed, controller_delay=execution.delay),
        margin=settings.margin,
        limits=settings.limits,
        stop_limits=stop_limits,
    )
    rules = ExecutionRules(separation, execution.delay, False)
    parameters = rehearsed_parameters(settings, arm, stop_limits, rules, tracker.keep_lost)
    person = _person(scenario)
    world = World(
        parameters,
        Hidden(person, [(loss.part, loss.begin, loss.end) for loss in tracker.loses]),
        np.array(FOLDED),
        scenario.seed,
        Wire(
            frame_period=1.0 / tracker.rate,
            age=tracker.age,
            loss=tracker.loss,
            transport=execution.transport,
            deciding=scenario.node.deciding,
            body_timeout=BODY_TIMEOUT,
            joint_timeout=JOINT_TIMEOUT,
            keep_lost=tracker.keep_lost,
        ),
        controller=ControllerRules(version=ControllerVersion(execution.version)),
        controller_period=execution.period,
        lag=execution.lag,
        flight=flight,
    )
    witness = Witness(world, person, is_drawn, _flesh(scenario))
    if isinstance(person, InterceptingWearer):
        hand = person

        def look() -> None:
            q = world.arm.measured_at(world.timeline.now).positions
            hand.advance(world.timeline.now, arm, q)

        world.timeline.every(HAND_PERIOD, look)
    # Latencies of their own: what is asked for is the same whatever becomes of it.
    latencies, seeds = (np.random.default_rng((scenario.seed, k)) for k in (1, 2))
    host = VirtualHost(
        world.timeline,
        InProcessPlanner(),
        lambda: float(latencies.uniform(*scenario.planner.latency)),
        lambda: is_within(world.timeline.now - BEGIN, scenario.planner.dead),
        lambda: world.stands_until,
        world.read,
        lambda: int(seeds.integers(2**31)),
    )
    for begin, end in scenario.node.stands_still:
        world.timeline.at(BEGIN + begin, partial(world.stand_still, BEGIN + end))
    for begin, end in execution.rejects:
        world.timeline.at(BEGIN + begin, partial(world.reject, BEGIN + end))
    wanted, targets = scenario.requests, np.random.default_rng((scenario.seed, 3))

    def draw() -> Array:
        target: Array = targets.uniform(wanted.lowest, wanted.highest)
        return target

    session = Session(
        world,
        host,
        parameters,
        SessionRules(pause=wanted.pause, gives_up=wanted.gives_up, replaced=wanted.replaced),
        draw,
        scenario.seed,
    )
    world.timeline.run(BEGIN + scenario.seconds)
    monitor = world.monitor
    return Rehearsal(
        scenario,
        monitor.digest,
        monitor.n_events,
        monitor.n_commands,
        monitor.n_stops,
        tuple(session.pursuits),
        tuple(session.glances),
        witness.close(),
    )


def is_within(time: float, spans: tuple[Pair, ...]) -> bool:
    """Return whether a time is within one of some spans [s]."""
    return any(begin <= time < end for begin, end in spans)


def _person(scenario: Scenario) -> RecordedWearer | InterceptingWearer:
    recorded, hand = scenario.recorded, scenario.intercepting
    if recorded is not None:
        return recorded_wearer(scenario)
    assert hand is not None
    return InterceptingWearer(
        *(load_body(), hand.hand, hand.home, hand.speed, hand.waits, hand.pursues)
    )


def recorded_wearer(scenario: Scenario) -> RecordedWearer:
    """Return the recorded person of a scenario that has one, with the boxes of his tracker."""
    recorded = scenario.recorded
    assert recorded is not None
    file = str(scenario.folder / recorded.file) if recorded.file else ''
    return _recorded(*(file, recorded.skeleton, recorded.rate, recorded.begin, recorded.hand_size))


def _flesh(scenario: Scenario) -> RecordedWearer | None:
    """Return a recorded person with hands that bend any way; None: who has no such hands."""
    recorded = scenario.recorded
    if recorded is None or any(map(has_fingers, hands_of(load_skeleton(recorded.skeleton)))):
        return None
    file = str(scenario.folder / recorded.file) if recorded.file else ''
    found = _recorded(file, recorded.skeleton, recorded.rate, recorded.begin, None)
    return found if found.names == recorded_wearer(scenario).names else None


# Several scenarios beside the same person make boxes of him once.
@lru_cache(maxsize=8)
def _recorded(
    file: str, skeleton: str, rate: float, begin: float, hand_size: float | None
) -> RecordedWearer:
    """Return a recorded person; without a size of hands: hands that bend any way."""
    person, boxes = load_person(Path(file) if file else None), load_skeleton(skeleton)
    hands = round_wrists(boxes) if hand_size is None else with_hand_size(boxes, hand_size)
    return RecordedWearer(person, hands, rate, begin)
