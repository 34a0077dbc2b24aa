# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer from sight to sight: ages, and parts that are faster than assumed."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest
from rrth_planner.execution.body_motion import (
    body_at,
    first_sight,
    RAISED,
    seen_again,
    SHARE,
    WINDOW,
)
from rrth_planner.io.resources import resource_path
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.errors import OptionsError, SceneError
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import (
    ANY_OTHER,
    governing_speed,
    growth_at,
    seen_body,
    SeparationRules,
    speed_bound,
)
import worlds

RULES = SeparationRules(body_error=0.01)


def moved(scene, **shifts):
    """Return a scene some of whose parts are shifted [m]."""
    boxes = [
        replace(b, center=b.center + np.array(shifts[b.name])) if b.name in shifts else b
        for b in scene.boxes
    ]
    return Scene(tuple(boxes))


def at(scene, time):
    return np.full(len(scene.boxes), time)


@pytest.mark.parametrize(
    'name, speed',
    [
        ('torso', 0.0),
        ('right upper arm', 1.6),
        ('LEFT_UPPER_ARM', 1.6),
        ('skeleton/left-forearm', 2.0),
        ('LeftUpperArm', 1.6),
        ('lThigh', 1.0),
        ('upper arm 2', 1.6),
        ('left upper-arm[12]', 1.6),
        ('head', 1.0),
        ('torso and head', 1.0),
        ('Torso', 0.0),
        ('chest', 0.0),
        # The second box of a CUBE_LIST whose text is no more than that.
        ('torso[1]', 0.0),
        ('rucksack', 2.0),
        ('left hand on torso', 2.0),
    ],
)
def test_a_speed_belongs_to_whole_words_of_a_name(name, speed):
    assert speed_bound(RULES, name) == speed


@pytest.mark.parametrize(
    'name',
    [
        'torso/0',
        'head/0',
        'chest_camera/3',
        'rucksack on torso',
        'torso_strap',
        'ChestCamera',
        'torso 2',
        'chest-torso',
        'forehead',
        'handset on chest',
        'head ' + 'x' * 91 + ' ...',
        '7',
        '',
    ],
)
def test_what_is_not_known_exactly_is_fast(name):
    assert governing_speed(RULES, name)[1] == 2.0


@given(st.text(st.sampled_from('headtorsn _-/[1]AHT'), max_size=30), st.randoms())
def test_no_name_is_read_for_the_better_than_by_the_letters_that_occur_in_it(name, random):
    entries = ['head', 'torso', 'arm', 'hand', 'to', 'so torso', '']
    speeds = [(words, random.choice([0.0, 0.5, 1.0, 3.0])) for words in entries]
    found = speed_bound(SeparationRules(body_speeds=tuple(speeds)), name)
    plain = name.lower().replace('_', ' ').replace('-', ' ')
    occurring = [speed for words, speed in speeds if words and words in plain]
    assert found >= max(occurring, default=0.0)
    # Nothing but a whole name is taken to stand still.
    at_rest = {words for words, speed in speeds if speed == 0.0}
    whole = ' '.join(plain.split()).partition('[')[0]
    assert found > 0.0 or speeds[-1][1] == 0.0 or whole in at_rest


def test_the_packaged_bodies_are_known_by_their_names():
    speeds = {'torso': 0.0, 'head': 1.0, 'neck': 1.0, 'pelvis': 1.0, 'thigh': 1.0, 'arm': 1.6}
    bodies = ('config/body.yaml', 'msg_examples/body.yaml', 'msg_examples/body_arm_raised.yaml')
    names = [box.name for file in bodies for box in load_body(resource_path(file)).boxes]
    names += [part.name for part in load_skeleton('azure_kinect').parts]
    assert len(names) == 3 * 8 + 16
    for name in names:
        assert speed_bound(RULES, name) == speeds.get(name.split()[-1], 2.0), name


def test_words_that_occur_in_a_name_make_it_faster_and_never_slower():
    rules = SeparationRules(body_speeds=(('hand', 4.0), ('torso', 0.0), ('', 2.0)))
    names = ('left hand', 'lefthand', 'hand/3', 'LeftHand on torso', 'torsohat')
    assert [governing_speed(rules, name) for name in names] == [('hand', 4.0)] * 4 + [
        (ANY_OTHER, 2.0)
    ]


def test_of_words_that_fit_the_greatest_speed_counts():
    rules = SeparationRules(body_speeds=(('left', 0.5), ('hand', 3.0), ('', 1.0)))
    assert [speed_bound(rules, n) for n in ('left hand', 'left foot', 'hat')] == [3.0, 0.5, 1.0]


@pytest.mark.parametrize(
    'changes, sentence',
    [
        ({'contact_speed': -0.1}, 'contact_speed: -0.1, expected 0 to 100'),
        ({'body_error': float('nan')}, 'body_error: nan'),
        ({'body_speeds': (('hand', -1.0), ('', 2.0))}, 'body_speeds: "hand: -1.0"'),
        ({'body_speeds': (('hand', 1.0),)}, 'none for any other part'),
    ],
)
def test_bad_rules_are_rejected_in_a_sentence(changes, sentence):
    with pytest.raises(OptionsError, match=sentence):
        SeparationRules(**changes)


def test_a_body_has_an_age_and_a_speed_for_each_box():
    with pytest.raises(SceneError, match='speeds'):
        body = seen_body(worlds.wearer(), 0.1, RULES)
        replace(body, speeds=body.speeds - 1.0)


def test_boxes_grow_by_margin_error_and_speed():
    scene = worlds.wearer()
    body = seen_body(scene, 0.03, RULES)
    found = dict(
        zip((b.name for b in scene.boxes), growth_at(body, RULES, 0.02, 0.1), strict=True)
    )
    assert found['torso'] == pytest.approx(0.03)
    assert found['forearm_left'] == pytest.approx(0.03 + 2.0 * (0.1 + 0.01 + 0.03))


def test_each_part_has_the_age_of_its_own_measurement():
    scene = worlds.wearer()
    measured = at(scene, 1.0)
    measured[3] = 0.5
    ages = body_at(first_sight(scene, measured), 1.2, RULES).ages
    assert ages[3] == pytest.approx(0.7)
    assert np.delete(ages, 3) == pytest.approx(0.2)


def test_what_was_measured_later_than_now_has_an_age_that_blocks_everything():
    scene = worlds.wearer()
    body = first_sight(scene, at(scene, 1.0))
    assert body_at(body, 0.95, RULES).ages == pytest.approx(0.0)
    assert (body_at(body, 0.8, RULES).ages > 100.0).all()


def test_a_part_within_its_speed_is_not_counted():
    scene = worlds.wearer()
    body = first_sight(scene, at(scene, 0.0))
    # 2 m/s for 10 ms and twice the error.
    body = seen_again(body, moved(scene, forearm_left=[0.0399, 0, 0]), at(scene, 0.01), RULES)
    assert (body.n_seen, body.n_faster, body.faster) == (8, 0, ())


@pytest.mark.parametrize('turned', [False, True])
def test_a_part_that_is_faster_is_noticed_and_its_bound_is_raised_for_a_while(turned):
    scene = worlds.wearer()
    body = first_sight(scene, at(scene, 0.0))
    if turned:
        # Turned about its centre: only its corners move.
        boxes = list(scene.boxes)
        turn = rotation_matrix(np.array([0.0, 0.0, np.sin(0.2), np.cos(0.2)]))
        boxes[4] = replace(boxes[4], rotation=turn @ boxes[4].rotation)
        after, name = Scene(tuple(boxes)), boxes[4].name
    else:
        after, name = moved(scene, forearm_left=[0.0, 0.0401, 0.0]), 'forearm_left'
    body = seen_again(body, after, at(scene, 0.01), RULES)
    assert body.n_faster == 1
    ((found, speed),) = body.faster
    assert found == name
    assert speed > 2.0
    i = [b.name for b in scene.boxes].index(name)
    assert body_at(body, 0.02, RULES).speeds[i] == pytest.approx(SHARE * speed)
    assert body_at(body, 0.02 + RAISED, RULES).speeds[i] == 2.0
    # Once assumed to be so fast, it may be.
    again = moved(after, forearm_left=[0.0, 0.0401, 0.0])
    assert turned or seen_again(body, again, at(scene, 0.02), RULES).n_faster == 1


def test_a_part_that_goes_on_so_fast_keeps_its_raised_bound():
    name, speed = 'hand', 5.0
    begin = Box(name, [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body, found = first_sight(Scene((begin,)), np.zeros(1)), []
    for time in np.arange(0.01, 3.0 * RAISED, 0.01):
        hand = Scene((replace(begin, center=[speed * time, 0.0, 0.0]),))
        body = seen_again(body, hand, at(hand, time), RULES)
        found.append(body_at(body, time + 0.05, RULES).speeds[0])
    assert np.array(found) == pytest.approx(SHARE * speed)
    assert body.n_faster == 1


@pytest.mark.parametrize('rate', [30.0, 120.0, 500.0])
@pytest.mark.parametrize('speed', [1.9, 2.3, 8.0])
def test_a_part_that_is_a_little_faster_is_noticed_however_often_it_is_seen(rate, speed):
    begin = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body = first_sight(Scene((begin,)), np.zeros(1))
    # Two windows: between neighbouring sights at 500 Hz the errors hide 10 m/s.
    for time in np.arange(1, int(2.0 * WINDOW * rate) + 2) / rate:
        hand = Scene((replace(begin, center=[speed * time, 0.0, 0.0]),))
        body = seen_again(body, hand, at(hand, time), RULES)
    assert (body.n_faster > 0) == (speed > 2.0)
    assert body_at(body, time, RULES).speeds[0] == pytest.approx(
        max(2.0, SHARE * speed * (speed > 2.0))
    )


def test_a_clock_that_is_set_back_begins_another_window():
    begin = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body = first_sight(Scene((begin,)), np.full(1, 1000.0))
    for time in np.arange(0, 60) * 2e-3:
        hand = Scene((replace(begin, center=[3.0 * time, 0.0, 0.0]),))
        body = seen_again(body, hand, at(hand, time), RULES)
    assert body.n_faster > 0


def test_a_sight_that_is_no_newer_tells_nothing_of_speeds():
    scene = worlds.wearer()
    body = first_sight(scene, at(scene, 1.0))
    after = moved(scene, head=[0.5, 0.0, 0.0])
    assert seen_again(body, after, at(scene, 1.0), RULES).n_faster == 0
    assert seen_again(body, after, at(scene, 0.9), RULES).n_faster == 0


def test_parts_may_come_go_and_change_places():
    scene = worlds.wearer()
    body = first_sight(scene, at(scene, 0.0))
    hat = Box('hat', [0.0, 0.0, 1.0], [0.1, 0.1, 0.1], np.eye(3))
    others = Scene((hat, *reversed(scene.boxes[2:])))
    body = seen_again(body, others, at(others, 0.01), RULES)
    assert (body.n_seen, body.n_faster) == (6, 0)
    nobody = Scene(())
    body = seen_again(body, nobody, at(nobody, 0.02), RULES)
    assert body_at(body, 0.03, RULES).ages.shape == (0,)
    # What was never seen before has no speed.
    assert seen_again(body, scene, at(scene, 0.03), RULES).n_seen == 6


def test_of_parts_with_one_name_the_first_is_the_first():
    first = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    other = Box('hand', [1.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body = first_sight(Scene((first, other)), np.zeros(2))
    assert seen_again(body, Scene((first, other)), np.full(2, 0.01), RULES).n_faster == 0
    assert seen_again(body, Scene((other, first)), np.full(2, 0.01), RULES).n_faster == 2
