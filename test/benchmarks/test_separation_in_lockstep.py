# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the wearer that leave to intercept the arm meet it at rest; without separation not."""

import pytest

pytest.importorskip('tqdm')

from benchmarks.separation.adversary import chain_of_hands, FAST, Trial, trials
from benchmarks.separation.durations import chain_of_timed
from benchmarks.separation.lockstep import Controller
from benchmarks.separation.people import beside_person, items, reach_lines, Take
from benchmarks.separation.reaching import EARLIEST, interception, Reaching
from benchmarks.separation.reference import chain_of_motions
from benchmarks.separation.setting import Case
import numpy as np
from rrth_planner.model.arm import tool_pose
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.trajectory import Trajectory
from rrth_planner.rehearsal.contacts import AT_REST, classes_of, distances_to, SLOW
from worlds import table_1_arm

STEADY = 'for ever at the greatest speed'
SHARP, STRICT = 'as far as assumed, stop 10/400', 'as far as assumed, strict'


def hand_at(place):
    """Return a wearer of one hand."""
    return Scene((Box('hand', place, [0.1, 0.1, 0.1], np.eye(3)),))


@pytest.mark.parametrize(
    ('trial', 'n'), [(Trial(), 4), (trials()[SHARP], 4), (trials()[STRICT], 2)]
)
def test_a_part_that_gets_as_far_as_assumed_meets_no_faster_place_of_the_arm(trial, n):
    hands = chain_of_hands(trial, n, 0).hands
    assert len(hands) == n
    # The arm moved, unless nothing may that he could reach, and they came near.
    assert any(hand.was_moving for hand in hands) or trial.case.contact_speed == 0.0
    assert any(hand.word for hand in hands)
    assert not [hand for hand in hands if hand.word == FAST or hand.is_near]


def test_a_part_that_goes_on_at_its_greatest_speed_is_noticed():
    hands = chain_of_hands(trials()[STEADY], 6, 1).hands
    far = [hand for hand in hands if hand.part != 'head']
    assert len(far) > 3
    assert all(hand.is_noticed for hand in far)


@pytest.mark.parametrize(('k', 'seed'), [(0, 3), (1, 1), (2, 1)])
def test_a_part_with_any_name_that_is_seen_or_missing_meets_no_faster_place_of_the_arm(k, seed):
    pytest.importorskip('rclpy')
    from benchmarks.separation import markers

    trial = list(markers.trials().values())[k]
    hands = chain_of_hands(trial, 4, seed).hands
    assert len(hands) == 4
    assert any(hand.was_moving for hand in hands)
    assert any(hand.word for hand in hands)
    assert not [hand for hand in hands if hand.word == FAST or hand.is_near]


@pytest.mark.parametrize('what', [name for name in trials() if name.startswith('power')][::3])
def test_the_test_finds_contacts_where_the_wearer_gets_further_or_separation_is_off(what):
    # The monitor knows that a part got further once it has seen that: most of them meet no one.
    assert any(hand.word == FAST for hand in chain_of_hands(trials()[what], 5, 2).hands)


def test_commitments_pass_the_reference_checker():
    judged = chain_of_motions(2, 1, 0)
    assert judged.n_arrived == judged.n_motions == 1
    assert judged.n_judged == 2
    assert judged.n_instants > 100
    assert judged.n_violations == 0


@pytest.mark.parametrize('stop', ['4/40', '10/400'])
@pytest.mark.parametrize('dead', [0.03, 0.1])
def test_beside_a_wearer_at_rest_no_motion_stops_on_its_way(dead, stop):
    for seed in (0, 2):
        for one in chain_of_timed(dead, Case(stop=stop, controller_delay=0.01), 5, seed):
            assert one.n_stops == 0
            assert one.took < 4.0 * one.planned
            assert one.excess <= 1.01
            assert one.jump <= 2e-4
            assert one.speed_jump <= 0.02


@pytest.mark.parametrize('item', items(Take('', 1.0))[:2])
def test_a_recorded_person_is_never_met_by_a_fast_place_while_he_gets_no_further(item):
    record = beside_person(0.5, item)
    assert record.n_plans
    assert record.n_steps['right hand'] == 59
    assert not record.contacts[FAST, True]
    assert len(reach_lines([record])) == 3


def test_contacts_are_classified_by_the_speed_of_the_arm_there():
    arm, q = table_1_arm(), np.zeros((3, 4))
    # One joint turns the arm fast, slowly, not at all, with a hand right at its tool.
    v = np.array([[0.0, 0.5, 0.0, 0.0], [0.0, 0.1, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    scene = hand_at(tool_pose(arm, q[0])[:3, 3])
    rows = np.repeat(scene.numbers[None], 3, axis=0)
    classes = classes_of(distances_to(arm, q, v, ('hand',), rows, 0.1, 0.0))
    assert classes[:, -1, 0].tolist() == [FAST, SLOW, AT_REST]
    rows[:, :, 2] += 0.5
    assert (classes_of(distances_to(arm, q, v, ('hand',), rows, 0.1, 0.0)) == '').all()


def test_a_part_that_leaves_goes_where_it_intercepts_the_arm():
    arm, times = table_1_arm(), np.arange(0.0, 1.0, 5e-3)
    q, v = np.zeros((len(times), 4)), np.zeros((len(times), 4))
    q[:, 1], v[:, 1] = -0.3 + 0.5 * times, 0.5
    scene = hand_at(tool_pose(arm, q[100])[:3, 3] + [0.0, 0.0, 0.8])
    lines = ((0.0, 3.0), (0.1, 2.0))
    wearer = Reaching(scene, 0, lines)
    ways = wearer.ways_ahead(0.0, times)
    assert ways == pytest.approx(np.minimum(3.0 * times, 0.1 + 2.0 * times))
    direction = interception(arm, q, v, scene.numbers[0], ways, 0.1, EARLIEST)
    wearer.head_for(direction, 0.0)
    rows = wearer.rows(times)
    assert np.linalg.norm(rows[:, 0, :3] - rows[0, 0, :3], axis=1) == pytest.approx(ways)
    found = distances_to(arm, q, v, ('hand',), rows, 0.1, 1.0)
    # It is there as soon as it can be, to a step.
    assert found.fast.min() < 0.005


def test_a_controller_follows_the_newest_trajectory_that_it_has():
    def still(value):
        at = np.full((1, 4), value)
        return Trajectory(np.zeros(1), at, 0.0 * at, 0.0 * at)

    controller = Controller(np.zeros(4))
    controller.give(still(1.0), 0.0, 0.010)
    # The next two come in the wrong order.
    controller.give(still(2.0), 0.01, 0.020)
    controller.give(still(3.0), 0.012, 0.018)
    q, _ = controller.states(np.array([0.0, 0.011, 0.0181, 0.03]))
    assert q[:, 0].tolist() == [0.0, 1.0, 3.0, 3.0]
