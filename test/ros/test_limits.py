# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""How much of everything is taken: more is rejected in one sentence, at once and whole."""

import bisect
from dataclasses import replace
from pathlib import Path
import time

from geometry_msgs.msg import Point
import numpy as np
import pytest

pytest.importorskip('rclpy')

from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.io.resources import resource_path  # noqa: E402
from rrth_planner.io.text_file import (  # noqa: E402
    DEEPEST,
    MOST_BYTES as FILE_BYTES,
    MOST_VALUES,
)
from rrth_planner.io.wearer_file import LONGEST_TEXT  # noqa: E402
from rrth_planner.model.arrays import FARTHEST  # noqa: E402
from rrth_planner.model.errors import (  # noqa: E402
    LONGEST_SENTENCE,
    MessageError,
    one_line,  # noqa: E402
    RequestError,  # noqa: E402
)
from rrth_planner.model.goal import PointingGoal  # noqa: E402
from rrth_planner.model.scene import Scene  # noqa: E402
from rrth_planner.model.status import ErrorCode  # noqa: E402
from rrth_planner.requests.answer import answer  # noqa: E402
from rrth_planner.requests.inputs import InputSnapshot  # noqa: E402
from rrth_planner.ros.interface.inputs import Input  # noqa: E402
from rrth_planner.ros.messages import body as body_module  # noqa: E402
from rrth_planner.ros.messages.answer import answer_from_text  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody  # noqa: E402
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import joint_reading
from rrth_planner.ros.messages.marker_edits import (  # noqa: E402
    LONGEST_NAMESPACE,
    MOST_BOXES,
    read_edits,
)
from rrth_planner.ros.messages.message_file import message_from_file  # noqa: E402
from rrth_planner.ros.messages.trajectory import (
    joint_trajectory_from_msg,
    MOST_POINTS,  # noqa: E402
)
from rrth_planner.ros.middleware.open_subscription import decoded, MOST_BYTES  # noqa: E402
from rrth_planner.ros.playback_node import MOST_BYTES as MOST_BYTES_OF_MOTION  # noqa: E402
from samples import array, box, command, FOLDED, JOINTS, joints, target  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

SECURITY = Path(__file__).parents[2] / 'docs' / 'security.md'


def rejection(call, *arguments):
    """Return the sentence of a MessageError, which is one line of bounded length."""
    with pytest.raises(MessageError) as caught:
        call(*arguments)
    sentence = str(caught.value)
    assert 0 < len(sentence) <= LONGEST_SENTENCE
    assert sentence.isprintable()
    return sentence


def cube_list(n, index=0):
    """Return a CUBE_LIST marker."""
    marker = box(index=index, size=(0.01, 0.01, 0.01))
    marker.type, marker.points = Marker.CUBE_LIST, [Point(x=0.001 * k) for k in range(n)]
    return marker


def test_a_million_markers_are_rejected_before_they_are_decoded():
    one = serialize_message(array(box()))
    # What the middleware hands over: header, number of markers, markers.
    data = one[:4] + (10**6).to_bytes(4, 'little') + one[8:] * 10**6
    assert len(data) > 10**8
    begin = time.process_time()
    sentence = rejection(decoded, data, MarkerArray)
    assert time.process_time() - begin < 0.1
    assert sentence == f'{len(data)} bytes, expected a MarkerArray of at most {MOST_BYTES}'


@pytest.mark.parametrize('length', [2**31 - 1, 2**32 - 1, 10**6])
@pytest.mark.parametrize('msg_type', [MarkerArray, JointState, JointTrajectory])
def test_a_length_that_the_message_does_not_have_is_no_message(msg_type, length):
    lie = length.to_bytes(4, 'little')
    assert 'bytes that are no ' in rejection(decoded, b'\0\1\0\0' + lie * 20, msg_type)


def test_as_many_boxes_as_are_taken_fit_into_a_message():
    msg = decoded(serialize_message(array(cube_list(MOST_BOXES))), MarkerArray)
    body = WearerBody().edited(read_edits(msg, 0.0, 'torso'), 0.0)
    assert body.n_boxes == MOST_BOXES
    sentence = rejection(body.edited, read_edits(array(box('hat')), 0.0, 'torso'), 0.0)
    assert sentence == f'{MOST_BOXES + 1} boxes, expected at most {MOST_BOXES} in all'
    sentence = rejection(read_edits, array(cube_list(MOST_BOXES + 1)), 0.0, 'torso')
    assert f'points: {MOST_BOXES + 1}, expected 1 to {MOST_BOXES}' in sentence


def test_a_long_namespace_is_rejected_and_a_long_text_cut_short():
    sentence = rejection(read_edits, array(box('n' * (LONGEST_NAMESPACE + 1))), 0.0, 'torso')
    assert f'ns of {LONGEST_NAMESPACE + 1} characters, expected at most' in sentence
    gone = command(Marker.DELETE, 'n' * 10**6)
    assert 'ns of 1000000 characters' in rejection(read_edits, array(gone), 0.0, 'torso')
    hat = box('n' * LONGEST_NAMESPACE, text='hat\n' * 10**5)
    (edit,) = read_edits(array(hat), 0.0, 'torso')
    name = edit.part.boxes[0].name
    assert len(name) == LONGEST_TEXT
    assert name.isprintable()


def test_a_long_frame_is_named_in_short():
    sentence = rejection(read_edits, array(box(frame='f' * 10**6)), 0.0, 'torso')
    assert sentence.startswith('marker 0 ("torso/0"): frame "fff')
    assert rejection(goal_from_msg, target(frame='a\nb\x1b'), 'torso').startswith('frame "a b?", ')


def test_many_joints_of_others_are_passed_over_and_named_in_short():
    names = [f'wheel_{k}' for k in range(20_000)]
    zeros = [0.0] * len(names)
    reading = joint_reading(joints([*zeros, *FOLDED], [*names, *JOINTS]), JOINTS, 1.0, None)
    assert reading.positions.tolist() == FOLDED
    bad = joints([*zeros, *FOLDED[:3]], [*names, *JOINTS[:3]])
    assert "no ['joint_4'] in" in rejection(joint_reading, bad, JOINTS, 1.0, None)
    more = JointState(name=[f'wheel_{k}' for k in range(50_000)])
    assert 'expected a JointState of at most' in rejection(
        decoded, serialize_message(more), JointState
    )


def _motion(n):
    msg = JointTrajectory(joint_names=JOINTS)
    for k in range(n):
        point = JointTrajectoryPoint(
            positions=FOLDED, velocities=[0.0] * 4, accelerations=[0.0] * 4
        )
        point.time_from_start.sec, point.time_from_start.nanosec = k // 100, k % 100 * 10**7
        msg.points.append(point)
    return msg


def test_a_motion_of_too_many_points_is_rejected():
    longest = decoded(
        serialize_message(_motion(MOST_POINTS)), JointTrajectory, MOST_BYTES_OF_MOTION
    )
    assert len(joint_trajectory_from_msg(longest, JOINTS).times) == MOST_POINTS
    more = _motion(MOST_POINTS + 1)
    sentence = rejection(joint_trajectory_from_msg, more, JOINTS)
    assert sentence == f'points: {MOST_POINTS + 1}, expected at most {MOST_POINTS}'
    data = serialize_message(more)
    head, point = data[:-136], data[-136:]
    data = head + 90_000 * point
    begin = time.process_time()
    assert 'bytes, expected a JointTrajectory of at most' in rejection(
        decoded, data, JointTrajectory, MOST_BYTES_OF_MOTION
    )
    assert time.process_time() - begin < 0.1


def test_long_names_of_a_motion_are_named_in_short():
    msg = _motion(1)
    msg.joint_names = ['j' * 10**6]
    assert rejection(joint_trajectory_from_msg, msg, JOINTS).startswith('joint_names: ')


def test_the_last_of_many_lost_parts_are_kept(monkeypatch):
    monkeypatch.setattr(body_module, 'MOST_BOXES', 50)
    hats = [box('hat', k) for k in range(50)]
    pile = cube_list(20)
    for marker in (*hats, pile):
        marker.lifetime.nanosec = 1
    body = WearerBody().apply(array(*hats), 0.0, 'torso').at(1.0)
    body = body.apply(array(pile), 1.0, 'torso').at(2.0)
    assert [key for key, _ in body.lost] == [('hat', 20 + k) for k in range(30)] + [('torso', 0)]
    assert len(scene_of(body).boxes) == 50


def test_a_message_names_only_some_lost_parts_each_by_its_first_box():
    hats = cube_list(1000)
    hats.lifetime.nanosec = 1
    body = WearerBody().apply(array(hats), 0.0, 'torso').at(1.0)
    assert body.lost_names() == '"torso/0[0]"'
    many = [box('hat', k) for k in range(100)]
    for hat in many:
        hat.lifetime.nanosec = 1
    names = WearerBody().apply(array(*many), 0.0, 'torso').at(1.0).lost_names().split(', ')
    assert names == [f'"hat/{k}"' for k in range(100 - body_module.MOST_NAMED, 100)]


def test_a_box_of_next_to_no_size_is_an_obstacle_and_huge_numbers_are_rejected():
    tiny = WearerBody().apply(array(box(size=(5e-324, 1e-310, 1e-300))), 0.0, 'torso')
    assert scene_of(tiny).boxes[0].size[0] == 5e-324
    assert 'expected' in rejection(read_edits, array(box(center=(1.7e308,) * 3)), 0.0, 'torso')
    assert 'expected' in rejection(goal_from_msg, target(1.7e308, 1.7e308), 'torso')


def test_joints_and_motions_beyond_what_is_proven_are_rejected():
    for bad in (1.1e4, -1e300):
        sentence = rejection(joint_reading, joints([bad, *FOLDED[1:]]), JOINTS, 1.0, None)
        assert 'expected numbers of at most 10000 [rad]' in sentence
        msg = _motion(2)
        msg.points[1].positions[0] = bad
        sentence = rejection(joint_trajectory_from_msg, msg, JOINTS)
        assert sentence.startswith('positions: ')
        assert 'expected numbers of at most 10000 [rad]' in sentence


@pytest.mark.skipif(not SECURITY.is_file(), reason='the documents are not installed')
def test_the_documents_say_how_much_is_taken():
    def most(*markers):
        """Return how many of some markers, taken in turn, an array may have."""

        def is_longer(n):
            taken = (markers * (n // len(markers) + 1))[:n]
            return len(serialize_message(array(*taken))) > MOST_BYTES

        return bisect.bisect_left(range(5000), True, key=is_longer) - 1

    body = message_from_file(resource_path('msg_examples/body.yaml'), MarkerArray)
    typical = [marker for marker in body.markers if marker.action == Marker.ADD]
    short, long = most(box('torso')), most(*typical)
    said = (
        f'{MOST_BYTES // 1024} KiB (`MOST_BYTES`): some {round(short, -1):,} CUBEs with a short '
        f'name, or {round(long, -1):,} like those of `msg_examples/body.yaml`'
    )
    table = SECURITY.read_text(encoding='utf-8')
    assert said in table
    assert f'| {MOST_BOXES:,} (`MOST_BOXES`) |' in table
    assert f'{MOST_BYTES_OF_MOTION // 1024**2} MiB and {MOST_POINTS:,} points' in table
    files = f'{FILE_BYTES // 2**20} MiB, {MOST_VALUES:,} values, nested {DEEPEST} deep'
    assert files in table
    assert f'angles, lengths and coordinates | {FARTHEST:,.0f} rad or m' in table


def test_an_answer_of_somebody_else_is_one_line():
    answered = answer_from_text('SUCCESS (1): a\nb \x1b[31m; answer 7')
    assert answered.sentence == 'a b ?[31m; answer 7'
    assert answered.number == 7
    assert 'expected NAME' in rejection(answer_from_text, f'SUCCESS ({"1" * 5000}): a')


def test_answers_are_one_line_whatever_they_quote():
    said = answer(ErrorCode.FAILURE, 'a\nb\r\x1b[31m\u2028' + 'x' * 10**6)
    assert said.startswith('FAILURE (99999): a b ?[31m ')
    assert said.isprintable()
    assert len(said) == LONGEST_SENTENCE
    assert one_line('Ω 🦾') == 'Ω 🦾'


def test_an_age_is_unknown_once_the_clock_was_set_back():
    source = Input('target', None)
    assert source.age(5.0) == float('inf')
    source.accept(lambda: None, 100.0)
    assert source.age(100.5) == 0.5
    assert source.age(99.99) == 0.0
    assert source.age(50.0) == float('inf')
    source.accept(lambda: None, 50.0)
    assert source.age(50.25) == 0.25


def test_a_clock_that_was_set_back_makes_no_speed():
    first = joint_reading(joints(velocity=[]), JOINTS, 100.0, None)
    moved = joints([0.5, *FOLDED[1:]], velocity=[])
    again = joint_reading(moved, JOINTS, 10.0, first)
    assert not again.velocities.any()
    assert again.velocities_expire == 10.0


def test_stamps_of_any_time_do_not_date_a_reading():
    for sec in (-(2**31), -1, 0, 2**31 - 1):
        msg = joints()
        msg.header.stamp.sec = sec
        assert joint_reading(msg, JOINTS, 1000.0, None).taken == 1000.0


def test_an_arm_that_is_nowhere_soon_is_rejected():
    reading = joint_reading(joints(velocity=[0.0, -1.5e308, 0.0, 0.0]), JOINTS, 0.0, None)
    inputs = InputSnapshot(Scene(()), PointingGoal([1.0, 0.0, 0.0]), reading)
    assert np.isfinite(inputs.start_state_at(None, 1.0, load_arm()).state.positions).all()
    with pytest.raises(RequestError, match=r'joint_2 moves at .*a finite position 2\.000 s later'):
        inputs.start_state_at(None, 2.0, load_arm())


def test_an_arm_that_moves_is_told_in_the_unit_of_the_joint():
    slides = replace(load_arm(), is_prismatic=(False, False, True, False))
    reading = joint_reading(joints(velocity=[0.0, 0.0, 0.5, 0.0]), JOINTS, 0.0, None)
    inputs = InputSnapshot(Scene(()), PointingGoal([1.0, 0.0, 0.0]), reading)
    for arm, unit in ((load_arm(), 'rad/s'), (slides, 'm/s')):
        told = rf'joint_3 moves at 0\.500 {unit}, .* \(at most 0\.01 {unit}, rest_speed\)'
        with pytest.raises(RequestError, match=told):
            inputs.require_rest(0.0, arm)
    inputs = replace(inputs, joints=replace(reading, rest_speed=0.5))
    inputs.require_rest(0.0, arm)
