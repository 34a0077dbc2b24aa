# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The wearer from sight to sight: ages, and parts that get further than assumed."""

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
)
from rrth_planner.io.resources import resource_path
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.body_reach import BODY_REACH, KNOWN_FOR
from rrth_planner.model.errors import OptionsError, SceneError
from rrth_planner.model.rotation import rotation_matrix
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import (
    ANY_OTHER,
    governing_reach,
    growth_at,
    growth_lines,
    reach_at,
    reach_of,
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
    assert speed_bound(RULES, name) == 2.0
    # No part that is known gets further at first, nor later.
    lines = np.array(governing_reach(RULES, name)[1])
    assert (lines[:, 1] >= 2.0).all()


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
    assert [governing_reach(rules, name) for name in names] == [('hand', ((0.0, 4.0),))] * 4 + [
        (ANY_OTHER, ((0.0, 2.0),))
    ]


def test_of_words_that_fit_the_greatest_speed_counts():
    rules = SeparationRules(body_speeds=(('left', 0.5), ('hand', 3.0), ('', 1.0)))
    assert [speed_bound(rules, n) for n in ('left hand', 'left foot', 'hat')] == [3.0, 0.5, 1.0]


HAND, HEAD = ((0.0, 5.0), (0.2, 1.0)), ((0.0, 1.5), (0.1, 0.2))


@pytest.mark.parametrize(
    'name, words, lines',
    [
        ('left hand', 'hand', HAND),
        ('LeftHand on torso', 'hand', HAND),
        ('hand on head', 'hand', HAND),
        # What occurs makes it worse, and nothing fits.
        ('handle', f'hand, {ANY_OTHER}', ((0.0, 5.0), (0.2, 2.0))),
        ('forehead', ANY_OTHER, ((0.0, 2.0),)),
        # Each of two that fit is bounded at any time.
        ('bag on head', 'head, bag', ((0.0, 1.5), (0.1, 1.2))),
        ('torso', 'torso', ((0.0, 0.0),)),
        ('torso/0', ANY_OTHER, ((0.0, 2.0),)),
    ],
)
def test_lines_belong_to_words_as_speeds_do_and_all_that_count_are_bounded(name, words, lines):
    speeds = (('torso', 0.0), ('hand', 2.0), ('head', 1.0), ('bag', 1.2), ('', 2.0))
    rules = SeparationRules(body_speeds=speeds, body_reach=(('hand', HAND), ('head', HEAD)))
    assert governing_reach(rules, name) == (words, lines)


def test_what_wears_the_arm_fits_its_own_name_only_also_where_its_box_changes_a_little():
    lines = ((0.0, 0.7), (0.03, 0.15))
    rules = SeparationRules(body_reach=(*BODY_REACH, ('torso', lines)))
    assert governing_reach(rules, 'torso') == ('torso', lines)
    for name in ('rucksack on torso', 'torso strap', 'torso/0'):
        words, found = governing_reach(rules, name)
        assert words == ANY_OTHER
        assert found == dict(BODY_REACH)['']


def test_speeds_of_ones_own_count_alone_unless_there_are_lines_of_ones_own():
    speeds = (('hand', 3.0), ('', 2.0))
    assert governing_reach(RULES, 'hand')[1] == dict(BODY_REACH)['hand']
    assert governing_reach(SeparationRules(body_speeds=speeds), 'hand')[1] == ((0.0, 3.0),)
    assert governing_reach(SeparationRules(body_reach=()), 'hand')[1] == ((0.0, 2.0),)
    both = SeparationRules(body_speeds=speeds, body_reach=(('hand', HAND),))
    assert governing_reach(both, 'hand')[1] == HAND
    assert governing_reach(both, 'foot')[1] == ((0.0, 2.0),)
    assert governing_reach(RULES, 'hat') == (ANY_OTHER, dict(BODY_REACH)[''])


@pytest.mark.parametrize(
    'changes, sentence',
    [
        (
            {'body_reach': (('hand', ((0.2, 1.0),)),)},
            'body_reach: "hand: 0.2 \\+ 1 t", expected one',
        ),
        ({'contact_speed': -0.1}, 'contact_speed: -0.1, expected 0 to 100'),
        ({'body_error': float('nan')}, 'body_error: nan'),
        ({'body_speeds': (('hand', -1.0), ('', 2.0))}, 'body_speeds: "hand: -1.0"'),
        ({'body_speeds': (('hand', 1.0),)}, 'none for any other part'),
    ],
)
def test_bad_rules_are_rejected_in_a_sentence(changes, sentence):
    with pytest.raises(OptionsError, match=sentence):
        SeparationRules(**changes)


def test_a_body_has_an_age_and_lines_for_each_box():
    body = seen_body(worlds.wearer(), 0.1, RULES)
    with pytest.raises(SceneError, match='speeds'):
        replace(body.reach, speeds=body.reach.speeds - 9.0)
    with pytest.raises(SceneError, match='stated'):
        replace(body.reach, stated=body.reach.stated[1:])
    with pytest.raises(SceneError, match='ages'):
        replace(body, ages=-body.ages)
    with pytest.raises(SceneError, match='reach: of 1 boxes, expected 8'):
        replace(body, reach=reach_of(('hand',), RULES))


def test_boxes_grow_by_margin_error_and_reach():
    scene = worlds.wearer()
    body = seen_body(scene, 0.03, RULES)
    found = dict(
        zip((b.name for b in scene.boxes), growth_at(body, RULES, 0.02, 0.1), strict=True)
    )
    assert found['torso'] == pytest.approx(0.03)
    lines = dict(BODY_REACH)['forearm']
    assert found['forearm_left'] == pytest.approx(0.03 + min(c + 0.14 * w for c, w in lines))


@pytest.mark.parametrize('age', [0.0, 0.05, 0.4, 2.2, 2.6, 9.0])
def test_lines_bound_how_much_boxes_grow_also_where_their_reach_is_not_known(age):
    body, until = seen_body(worlds.wearer(), age, RULES), 0.7
    growths, speeds = growth_lines(body, RULES, 0.02, until)
    times = np.linspace(0.0, until, 701)
    least = (growths + speeds * times[:, None, None]).min(axis=-1)
    wanted = np.array([growth_at(body, RULES, 0.02, time) for time in times])
    assert (least >= wanted - 1e-12).all()
    if age + until + RULES.controller_delay <= KNOWN_FOR:
        assert least == pytest.approx(wanted)
    if age > KNOWN_FOR:
        # No part may have been left behind by its stated speed.
        elapsed = times[:, None] + age + RULES.controller_delay
        assert (wanted >= 0.03 + body.reach.stated * elapsed - 1e-12).all()


def test_each_part_has_the_age_of_its_own_measurement():
    scene = worlds.wearer()
    measured = at(scene, 1.0)
    measured[3] = 0.5
    ages = body_at(first_sight(scene, measured, 1.0), 1.2, RULES).ages
    assert ages[3] == pytest.approx(0.7)
    assert np.delete(ages, 3) == pytest.approx(0.2)


def test_what_was_measured_later_than_now_has_an_age_that_blocks_everything():
    scene = worlds.wearer()
    body = first_sight(scene, at(scene, 1.0), 1.0)
    assert body_at(body, 0.95, RULES).ages == pytest.approx(0.0)
    assert (body_at(body, 0.8, RULES).ages > 100.0).all()


def again(body, scene, measured, since=-np.inf):
    """Return the wearer at his next sight, which comes as soon as it is measured."""
    return seen_again(body, scene, measured, RULES, measured.max(initial=0.0), since)


def first(scene, measured):
    return first_sight(scene, measured, measured.max(initial=0.0))


def furthest(name, elapsed):
    """Return how far a part may get within a time [m]."""
    return float(reach_at(reach_of((name,), RULES), np.array([elapsed]))[0])


def test_a_part_within_its_reach_is_not_counted():
    scene = worlds.wearer()
    body = first(scene, at(scene, 0.0))
    way = furthest('forearm', 0.01) + 2.0 * RULES.body_error
    body = again(body, moved(scene, forearm_left=[way - 1e-4, 0, 0]), at(scene, 0.01))
    assert (body.n_seen, body.n_further, body.further) == (8, 0, ())


def test_a_part_that_gets_further_is_noticed_and_its_reach_is_raised_for_a_while():
    scene = worlds.wearer()
    body = first(scene, at(scene, 0.0))
    i = scene.names.index('forearm_left')
    before = body_at(body, 0.01, RULES).reach
    excess = 0.03
    way = furthest('forearm', 0.01) + 2.0 * RULES.body_error + excess
    after = moved(scene, forearm_left=[0.0, way, 0.0])
    body = again(body, after, at(scene, 0.01))
    assert body.n_further == 1
    ((found, by),) = body.further
    assert found == 'forearm_left'
    assert by == pytest.approx(excess)
    raised = body_at(body, 0.02, RULES).reach
    assert raised.offsets[i] == pytest.approx(before.offsets[i] + SHARE * excess)
    assert np.delete(raised.offsets, i, 0).tolist() == np.delete(before.offsets, i, 0).tolist()
    assert (raised.speeds == before.speeds).all()
    # Once assumed to get so far, it may.
    back = moved(after, forearm_left=[0.0, -way, 0.0])
    assert again(body, back, at(scene, 0.02)).n_further == 1
    assert body_at(body, 0.011 + RAISED, RULES).reach.offsets[i] == pytest.approx(
        before.offsets[i]
    )


def test_a_box_that_turns_within_what_it_was_is_no_further():
    scene = worlds.wearer()
    boxes = list(scene.boxes)
    # A long bar of a square section: its corners go far, and it stays where it was.
    boxes[4] = replace(boxes[4], size=[0.3, 0.08, 0.08])
    scene = Scene(tuple(boxes))
    body = first(scene, at(scene, 0.0))
    for k, angle in enumerate(np.linspace(0.0, np.pi / 2, 3)[1:]):
        turn = rotation_matrix(np.array([np.sin(angle / 2), 0.0, 0.0, np.cos(angle / 2)]))
        boxes[4] = replace(boxes[4], rotation=scene.boxes[4].rotation @ turn)
        body = again(body, Scene(tuple(boxes)), at(scene, 0.02 * (k + 1)))
    assert body.n_further == 0
    # About another axis it gets out.
    turn = rotation_matrix(np.array([0.0, 0.0, np.sin(np.pi / 4), np.cos(np.pi / 4)]))
    boxes[4] = replace(boxes[4], rotation=scene.boxes[4].rotation @ turn)
    assert again(body, Scene(tuple(boxes)), at(scene, 0.05)).n_further == 1


def test_a_part_that_goes_on_so_far_keeps_its_raised_reach():
    name, speed = 'hand', 5.0
    begin = Box(name, [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body, found = first(Scene((begin,)), np.zeros(1)), []
    for time in np.arange(0.01, 3.0 * RAISED, 0.01):
        hand = Scene((replace(begin, center=[speed * time, 0.0, 0.0]),))
        body = again(body, hand, at(hand, time), time - 0.3)
        found.append(body_at(body, time + 0.05, RULES).reach.offsets[0, 0])
    # Its excess over the sights of the last 0.3 s is what it stays.
    excess = 0.3 * speed - furthest(name, 0.3) - 2.0 * RULES.body_error
    assert np.array(found[40:]) == pytest.approx(SHARE * excess)
    assert (np.diff(found) >= -1e-9).all()
    # After that it is what is assumed.
    assert body.n_further < 40


@pytest.mark.parametrize('rate', [30.0, 120.0, 500.0])
@pytest.mark.parametrize('name', ['hand', 'head', 'thigh', 'forearm'])
def test_a_part_that_keeps_its_greatest_speed_is_noticed_however_often_it_is_seen(rate, name):
    lines = np.array(governing_reach(RULES, name)[1])
    speed = lines[0, 1]
    begin = Box(name, [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body, noticed = first(Scene((begin,)), np.zeros(1)), np.inf
    for time in np.arange(1, int(rate) + 2) / rate:
        box = Scene((replace(begin, center=[speed * time, 0.0, 0.0]),))
        # From each sight to the next, and to many after that, it is where it may be.
        assert speed / rate <= furthest(name, 1.0 / rate) + 1e-12
        body = again(body, box, at(box, time), time - 0.6)
        if body.n_further and noticed == np.inf:
            noticed = time
    # As soon as it is two errors beyond one of the lines since it left, and is seen then.
    c, w = lines[1:].T
    soonest = ((c + 2.0 * RULES.body_error) / (speed - w)).min()
    assert soonest < noticed <= soonest + 1.0 / rate + 1e-9


@pytest.mark.parametrize('rate', [30.0, 120.0])
def test_a_part_that_gets_just_as_far_as_assumed_is_never_noticed(rate):
    begin = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body = first(Scene((begin,)), np.zeros(1))
    for time in np.arange(1, int(rate) + 2) / rate:
        hand = Scene((replace(begin, center=[furthest('hand', time), 0.0, 0.0]),))
        body = again(body, hand, at(hand, time))
    assert body.n_further == 0
    assert len(body.kept.blocks) > 1 or rate < 32


def test_sights_before_a_time_are_compared_no_more():
    begin = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    times = np.arange(0.0, 2.0, 0.01)
    for since, n in ((0.2, 0), (2.0, 1)):
        body = first(Scene((begin,)), np.zeros(1))
        for time in times[1:]:
            # Too slow to be noticed within 0.2 s.
            hand = Scene((replace(begin, center=[1.5 * time, 0.0, 0.0]),))
            body = again(body, hand, at(hand, time), time - since)
        assert (body.n_further > 0) == n
        kept = sum(len(rows) for rows in body.kept.since(times[-1] - since))
        assert kept == min(len(times), round(since / 0.01) + 1)


def test_a_clock_that_is_set_back_begins_anew():
    begin = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body = first(Scene((begin,)), np.full(1, 1000.0))
    for time in np.arange(0, 60) * 5e-3:
        hand = Scene((replace(begin, center=[4.0 * time, 0.0, 0.0]),))
        body = again(body, hand, at(hand, time))
    assert body.n_further > 0


def test_a_clock_that_is_set_forward_changes_nothing():
    begin = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body, step = first(Scene((begin,)), np.zeros(1)), 7.0
    for k in range(1, 20):
        hand = Scene((replace(begin, center=[0.05 * k, 0.0, 0.0]),))
        body = again(body, hand, np.full(1, 0.01 * k))
    later = body.shifted(step)
    hand = Scene((replace(begin, center=[1.2, 0.0, 0.0]),))
    one, other = again(body, hand, np.full(1, 0.2)), again(later, hand, np.full(1, 0.2 + step))
    assert other.n_further == one.n_further
    assert other.raised == pytest.approx(one.raised)
    assert other.until == pytest.approx(one.until + step)


def test_a_sight_that_is_no_newer_tells_nothing():
    scene = worlds.wearer()
    body = first(scene, at(scene, 1.0))
    after = moved(scene, head=[0.5, 0.0, 0.0])
    assert again(body, after, at(scene, 1.0)).n_further == 0
    assert again(body, after, at(scene, 0.9)).n_further == 0


def test_parts_may_come_go_and_change_places():
    scene = worlds.wearer()
    body = first(scene, at(scene, 0.0))
    hat = Box('hat', [0.0, 0.0, 1.0], [0.1, 0.1, 0.1], np.eye(3))
    others = Scene((hat, *reversed(scene.boxes[2:])))
    body = again(body, others, at(others, 0.01))
    assert (body.n_seen, body.n_further) == (6, 0)
    # What was seen of a part before, in another place of the list, still counts.
    far = moved(others, hat=[0.2, 0.0, 0.0], upper_arm_left=[0.2, 0.0, 0.0])
    found = [name for name, _ in again(body, far, at(far, 0.02)).further]
    assert found == ['hat', 'upper_arm_left']
    nobody = Scene(())
    body = again(body, nobody, at(nobody, 0.02))
    assert body_at(body, 0.03, RULES).ages.shape == (0,)
    # What was never seen before, or was gone, has got nowhere.
    assert again(body, scene, at(scene, 0.03)).n_seen == 6


def test_of_parts_with_one_name_the_first_is_the_first():
    one = Box('hand', [0.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    other = Box('hand', [1.0, 0.0, 0.0], [0.1] * 3, np.eye(3))
    body = first(Scene((one, other)), np.zeros(2))
    assert again(body, Scene((one, other)), np.full(2, 0.01)).n_further == 0
    assert again(body, Scene((other, one)), np.full(2, 0.01)).n_further == 2
