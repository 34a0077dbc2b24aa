# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Rehearsals: the same scenario has the same course, and what goes wrong has its consequences."""

from dataclasses import replace
from functools import cache
import os
from pathlib import Path
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from rrth_planner.cli.rehearse import main
from rrth_planner.execution.commitments import ExecutionRules
from rrth_planner.execution.watch import PlainRules
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.required_clearance import RequiredClearance
from rrth_planner.model.scene import Box
from rrth_planner.model.separation import Separation, SeparationRules
from rrth_planner.pipeline.planning_process import PlanningProcessError
from rrth_planner.rehearsal.contacts import FAST
from rrth_planner.rehearsal.rehearsal import rehearsed
from rrth_planner.rehearsal.rehearsed_wearer import Hidden, InterceptingWearer
from rrth_planner.rehearsal.scenario import load_scenario, Recorded, Scenario
from rrth_planner.rehearsal.session import REACHED
from rrth_planner.rehearsal.timeline import Timeline
from rrth_planner.rehearsal.virtual_host import VirtualHost
from rrth_planner.rehearsal.witness import Witness
from rrth_planner.rehearsal.world import BEGIN, Wire, World
from rrth_planner.simulation.trajectory_controller import ControllerState

NAMES = ('recorded_person', 'intercepting_hand', 'lagging_arm', 'lost_hand', 'dead_planner')
DIGEST = """
import sys
from dataclasses import replace
from rrth_planner.rehearsal.rehearsal import rehearsed
from rrth_planner.rehearsal.scenario import load_scenario
print(rehearsed(replace(load_scenario(sys.argv[1]), seconds=float(sys.argv[2]))).digest)
"""


def scenario_of(name, **changes):
    """Return a packaged scenario with changes."""
    return replace(load_scenario(resource_path(f'config/scenarios/{name}.yaml')), **changes)


# How long each of them is rehearsed: until what it is about has happened [s].
SECONDS = {
    'recorded_person': 20.0,
    'intercepting_hand': 32.0,
    'lost_hand': 29.0,
    'dead_planner': 24.0,
}


@cache
def course_of(name):
    """Return how a packaged scenario goes."""
    return rehearsed(scenario_of(name, seconds=SECONDS.get(name, 12.0)))


@pytest.mark.parametrize('name', NAMES)
def test_a_packaged_scenario_moves_the_arm_and_touches_nobody_fast(name):
    found = course_of(name)
    assert found.n_commands > 0
    assert any(one.outcome == REACHED for one in found.pursuits)
    assert not found.testimony.sentences
    assert found.testimony.moving_seconds > 0.5


def test_two_runs_have_the_same_course_also_in_another_process():
    file = resource_path('config/scenarios/recorded_person.yaml')
    first, second = (rehearsed(scenario_of('recorded_person', seconds=5.0)) for _ in range(2))
    assert first.digest == second.digest
    assert first.glances == second.glances
    env = {**os.environ, 'PYTHONHASHSEED': '7'}
    ran = subprocess.run(
        [sys.executable, '-c', DIGEST, file, str(SECONDS['recorded_person'])],
        capture_output=True,
        text=True,
        check=True,
        env=env,
    )
    assert ran.stdout.split()[-1] == course_of('recorded_person').digest


def test_another_seed_has_another_course():
    one = rehearsed(scenario_of('intercepting_hand', seconds=4.0))
    other = rehearsed(scenario_of('intercepting_hand', seconds=4.0, seed=2))
    assert one.digest != other.digest


def test_a_dead_planner_leaves_requests_unanswered_in_time():
    found = course_of('dead_planner')
    told = [one for one in found.pursuits if 'has not answered' in one.sentence]
    assert told
    assert all(one.took > 8.99 for one in told)


def test_nothing_begins_while_a_hand_is_lost_and_what_moves_then_stops():
    scenario, found = scenario_of('lost_hand'), course_of('lost_hand')
    loss = scenario.tracker.loses[1]
    # The arm may move on for keep_lost.
    since = BEGIN + loss.begin + scenario.tracker.keep_lost + 0.7
    while_lost = [one for one in found.glances if since < one.time < BEGIN + loss.end]
    assert while_lost
    assert not any(one.state.value == 'monitoring' for one in while_lost)
    assert any('lost parts' in one.sentence for one in found.pursuits)


def test_a_hand_goes_for_the_arm_at_its_speed():
    wearer = InterceptingWearer(load_body(), 'right hand', (0.4, -0.3, -0.1), 1.5, 0.1, 5.0)
    times = BEGIN + 0.02 * np.arange(40)
    for time in times:
        wearer.advance(time, load_arm(), np.zeros(4))
    places = np.array([wearer.rows_at(time)[-1, :3] for time in times])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.max() == pytest.approx(1.5 * 0.02)
    assert (steps[:4] == 0.0).all()


def test_what_a_tracker_loses_is_still_there():
    wearer = InterceptingWearer(load_body(), 'right hand', (0.4, -0.3, -0.1), 1.5, 1.0, 1.0)
    seen = Hidden(wearer, [('right hand', 1.0, 2.0)])
    assert np.isfinite(seen.rows_at(BEGIN + 0.5)).all()
    assert np.isnan(seen.rows_at(BEGIN + 1.5)[-1]).all()
    assert np.isfinite(wearer.rows_at(BEGIN + 1.5)).all()


def test_coroutines_await_virtual_time():
    timeline, seen = Timeline(5.0), []
    host = VirtualHost(timeline, None, lambda: 0.01, lambda: True)
    question = SimpleNamespace(options=SimpleNamespace(time_limit=4.0))

    async def ask():
        await host.sleep(2.0)
        seen.append(host.now())
        try:
            await host.plan(question)
        except PlanningProcessError as problem:
            seen.append((host.now(), str(problem)))

    host.begin(ask())
    timeline.run(30.0)
    assert seen == [7.0, (16.0, 'the planner has not answered within 9 s')]


class OnTheWay:
    """A wearer who stands where the arm moves, and is not seen there."""

    names = ('torso', 'hand')

    def rows_at(self, time):
        """Return a box far away, and one round the whole arm."""
        far = Box('torso', [9.0, 0.0, 0.0], [0.1, 0.1, 0.1], np.eye(3))
        near = Box('hand', [0.0, 0.0, 0.5], [3.0, 3.0, 3.0], np.eye(3))
        return np.array([far.numbers, near.numbers])


def test_the_witness_sees_contacts_that_nobody_else_sees():
    arm = load_arm()
    limits = load_settings(arm.dof).limits
    separation = Separation(
        arm=arm, rules=SeparationRules(), margin=0.02, limits=limits, stop_limits=limits
    )
    rules = PlainRules(
        required=RequiredClearance(arm, 0.02, 1.0),
        stop_limits=limits,
        execution=ExecutionRules(separation, 0.01, False),
    )
    world = World(rules, OnTheWay(), np.zeros(arm.dof), 0, Wire())
    witness = Witness(world, OnTheWay())
    for k in range(20):
        q, v = np.full(arm.dof, 0.01 * k), np.full(arm.dof, 1.0 if k < 10 else 0.0)
        state = ControllerState(positions=q, velocities=v, accelerations=np.zeros(arm.dof))
        world.on_setpoint(BEGIN + 0.005 * k, state)
    found = witness.close()
    assert sum(n for (word, _), n in found.contacts.items() if word == FAST) >= 1
    assert found.moving_seconds == pytest.approx(0.05, abs=0.01)
    assert found.ray_seconds == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('seed: 1', 'either recorded or intercepting'),
        ('recorded: {}\nintercepting: {}', 'either recorded or intercepting'),
        ('recorded: {speed: 1.0}', 'speed, expected only file, skeleton, rate, begin'),
        ('recorded: {}\ntracker: {rate: 0}', 'tracker.rate: 0, expected 0.0001 to 10000'),
        ('recorded: {}\ntracker: {age: [0.1]}', 'age: '),
        ('recorded: {}\ntracker: {loss: -1.0}', 'loss: -1, expected 0 to 1'),
        ('recorded: {}\nseed: -3', 'seed: -3, expected a whole number >= 0'),
        ('recorded: {}\ntracker: {loses: [{part: hand}]}', 'begin, end'),
        ('recorded: {rate: 0}', 'rate: 0, expected 0.01 to 100 [-]'),
        ('intercepting: {waits: 0, pursues: 0}', 'waits: 0, expected a number from 0.0001 on [s]'),
        (
            'recorded: {}\ntracker: {age: [0.3, 0.01]}',
            'age: 0.3 to 0.01, expected from 0 on, upwards',
        ),
        ('recorded: {}\ncontroller: {version: "9"}', 'expected one of 4.20'),
        ('recorded: {}\nrequests: {lowest: [2, 0, 0]}', 'expected at most highest'),
        ('recorded: {}\ntracker: {loss: 3}', 'loss: 3, expected 0 to 1 [-]'),
        ('recorded: {rate: fast}', "rate: 'fast', expected a number"),
        ('- 1', 'expected a mapping'),
    ],
)
def test_a_bad_scenario_is_rejected_in_a_sentence(text, sentence, tmp_path):
    file = tmp_path / 'scenario.yaml'
    file.write_text(text)
    with pytest.raises(OptionsError) as caught:
        load_scenario(file)
    assert sentence in str(caught.value)
    assert str(file) in str(caught.value)


def test_the_page_says_the_values_that_a_scenario_does_not_give(tmp_path):
    page = Path(__file__).parents[2] / 'docs' / 'rehearsal.md'
    block = re.search(r'```yaml\n(.*?)```', page.read_text(encoding='utf-8'), re.DOTALL)
    file = tmp_path / 'scenario.yaml'
    file.write_text(block[1], encoding='utf-8')
    assert load_scenario(file) == Scenario(recorded=Recorded(), folder=tmp_path)


def test_the_command_prints_what_became_of_each_target_and_draws_it(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    picture = tmp_path / 'course.png'
    given = ['intercepting_hand', '--seconds', '16', '--seed', '6', '--plot', str(picture)]
    assert main(given) == 0
    text = capsys.readouterr().out
    found = rehearsed(scenario_of('intercepting_hand', seconds=16.0, seed=6))
    assert found.digest in text
    outcomes = [one.outcome for one in found.pursuits if one.outcome]
    assert outcomes
    assert all(text.count(outcome) >= outcomes.count(outcome) for outcome in outcomes)
    assert picture.stat().st_size > 10_000


def test_the_command_says_what_it_does_not_know(capsys, tmp_path):
    assert main(['nobody']) == 2
    assert 'expected a file, or a scenario that comes along' in capsys.readouterr().err
    assert main([str(tmp_path / 'none.yaml')]) == 2
    assert main(['recorded_person', '--plot', str(tmp_path / 'x.txt')]) == 2
    assert '.png, .svg, .pdf' in capsys.readouterr().err
