# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Messages to the core's types and back: round trips, and a sentence for each rejection."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

pytest.importorskip('rclpy')

from geometry_msgs.msg import Point  # noqa: E402
from rrth_planner.collision.reference_checker import bar_ends_at  # noqa: E402
from rrth_planner.io.arm_file import load_arm  # noqa: E402
from rrth_planner.model.arm import bars_of, mount_bars, tool_pose  # noqa: E402
from rrth_planner.model.errors import MessageError  # noqa: E402
from rrth_planner.model.rotation import pose_matrix, rotation_matrix  # noqa: E402
from rrth_planner.model.status import ErrorCode, PlanStatus  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.requests.answer import answer, CODE_OF_STATUS  # noqa: E402
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.error_codes import code_of_rejection  # noqa: E402
from rrth_planner.ros.messages.frames import FrameError
from rrth_planner.ros.messages.goal import goal_from_msg
from rrth_planner.ros.messages.joint_state import configuration_from_msg, has_joint_of
from rrth_planner.ros.messages.marker_edits import measured_at, MOST_BOXES, read_edits
from rrth_planner.ros.messages.plan_markers import plan_markers
from rrth_planner.ros.messages.trajectory import (
    joint_trajectory_from_msg,
    joint_trajectory_to_msg,
    tool_path_to_msg,
)
from rrth_planner.timing.fast_stop import fast_stop  # noqa: E402
from samples import array, box, command, FOLDED, JOINTS, joints, target  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402
import worlds  # noqa: E402

NAN, INF = float('nan'), float('inf')


def body_of(*markers, now=0.0):
    return WearerBody().apply(array(*markers), now, 'torso')


def names(body):
    return [b.name for b in scene_of(body).boxes]


def test_a_cube_becomes_the_same_box():
    marker = box(center=(1.0, 2.0, 3.0), size=(0.1, 0.2, 0.3))
    o = marker.pose.orientation
    o.x, o.y, o.z, o.w = 0.5, 0.5, 0.5, 0.5
    (b,) = scene_of(body_of(marker)).boxes
    assert b.name == 'torso/0'
    np.testing.assert_array_equal(b.center, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(b.size, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(b.rotation, rotation_matrix([0.5] * 4), atol=1e-15)


def test_a_marker_is_called_by_its_text_or_its_id():
    assert names(body_of(box(text='left hand'), box('', 7))) == ['left hand', '7']


def test_a_cube_list_has_a_box_at_each_point():
    marker = box(center=(1.0, 0.0, 0.0), size=(0.1, 0.1, 0.1))
    marker.type = Marker.CUBE_LIST
    marker.points = [Point(x=1.0), Point(y=2.0)]
    o = marker.pose.orientation
    o.z, o.w = np.sqrt(0.5), np.sqrt(0.5)
    body = body_of(marker)
    assert names(body) == ['torso/0[0]', 'torso/0[1]']
    centers = [b.center for b in scene_of(body).boxes]
    np.testing.assert_allclose(centers, [[1.0, 1.0, 0.0], [-1.0, 0.0, 0.0]], atol=1e-12)


def test_markers_act_in_their_order_as_in_rviz():
    body = body_of(box('a'), box('a', 1), box('b'), box('a', size=(1.0, 1.0, 1.0)))
    assert names(body) == ['a/0', 'a/1', 'b/0']
    assert scene_of(body).boxes[0].size[0] == 1.0
    body = body.apply(array(command(Marker.DELETE, 'a', 1)), 0.0, 'torso')
    assert names(body) == ['a/0', 'b/0']
    assert names(body.apply(array(command(Marker.DELETE, 'x', 1)), 0.0, 'torso')) == names(body)
    assert names(body.apply(array(command(Marker.DELETEALL, 'a')), 0.0, 'torso')) == ['b/0']
    replaced = body.apply(array(command(Marker.DELETEALL), box('c')), 0.0, 'torso')
    assert names(replaced) == ['c/0']
    assert names(body.apply(array(box('c'), command(Marker.DELETEALL)), 0.0, 'torso')) == []


def test_a_lifetime_counts_from_reception_and_is_renewed():
    marker = box()
    marker.lifetime.nanosec = 500_000_000
    body = body_of(marker, box('head'), now=10.0)
    assert names(body.at(10.4)) == ['torso/0', 'head/0']
    # A lost part stays where it was last seen.
    assert names(body.at(10.5)) == ['head/0', 'torso/0']
    assert body.at(10.5).lost_names() == '"torso/0"'
    assert not body.at(10.4).lost_names()
    assert names(body.apply(array(marker), 10.4, 'torso').at(10.8)) == ['torso/0', 'head/0']


def test_a_body_that_does_not_change_is_one_scene_that_is_sent_once():
    marker = box()
    marker.lifetime.sec = 1
    body = body_of(marker, box('head'), now=10.0)
    assert scene_of(body.at(10.9)) is scene_of(body.at(10.1))
    assert scene_of(body.at(11.5)) is not scene_of(body)


def measured(marker, stamp):
    """Return a marker that was measured at a time [s]."""
    marker.header.stamp.sec, rest = divmod(round(stamp * 10**9), 10**9)
    marker.header.stamp.nanosec = rest
    return marker


def test_the_oldest_stamp_of_its_boxes_is_when_a_body_was_measured():
    markers = [
        command(Marker.DELETEALL),
        measured(box(), 9.5),
        measured(box('head'), 9.75),
        box('hat'),
    ]
    edits = read_edits(array(*markers), 10.0, 'torso', latency=0.125)
    assert [e.part.measured for e in edits if e.part is not None] == [9.5, 9.75, 9.875]
    assert measured_at(edits, 10.0) == 9.5
    assert measured_at(edits[:1], 7.0) == 7.0
    assert measured_at((), 7.0) == 7.0


def test_a_stamp_from_the_future_is_rejected_in_one_sentence():
    assert body_of(measured(box(), 10.05), now=10.0).n_boxes == 1
    with pytest.raises(MessageError) as caught:
        body_of(measured(box(), 11.5), now=10.0)
    assert str(caught.value) == (
        'marker 0 ("torso/0"): header.stamp: 1.500 s in the future, expected at most 0.1 (by the '
        'same clock as the planner: see use_sim_time)'
    )


def test_the_frame_of_a_marker_is_looked_up_at_its_stamp():
    asked = []

    def lookup(frame, stamp):
        asked.append((frame, stamp))
        return np.eye(4)

    markers = [measured(box(frame='camera'), 9.5), box('head', frame='camera')]
    read_edits(array(*markers, measured(box('hat', frame='camera'), 9.5)), 10.0, 'torso', lookup)
    assert asked == [('camera', 9_500_000_000), ('camera', 0)]
    goal_from_msg(measured(target(1.0, 0.0, 0.0, 'camera'), 2.5), 'torso', lookup)
    assert asked[-1] == ('camera', 2_500_000_000)


def test_an_invisible_box_is_an_obstacle():
    marker = box()
    marker.color.a = 0.0
    assert body_of(marker).n_boxes == 1


def test_an_empty_frame_is_the_base_frame_and_delete_needs_none():
    assert body_of(box(frame='')).n_boxes == 1
    other = command(Marker.DELETE, 'torso')
    other.header.frame_id = 'camera'
    assert body_of(box(), other).n_boxes == 0


def test_a_known_frame_is_transformed():
    T = pose_matrix([1.0, 2.0, 3.0], [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)])
    body = WearerBody().apply(
        array(box(center=(1.0, 0.0, 0.0), frame='camera')), 0.0, 'torso', lambda frame, stamp: T
    )
    np.testing.assert_allclose(scene_of(body).boxes[0].center, [1.0, 3.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(scene_of(body).boxes[0].rotation, T[:3, :3], atol=1e-12)
    goal = goal_from_msg(target(1.0, 0.0, 0.0, 'camera'), 'torso', lambda frame, stamp: T)
    np.testing.assert_allclose(goal.target, [1.0, 3.0, 3.0], atol=1e-12)


def change(path, value):
    def apply(marker):
        *parents, last = path.split('.')
        thing = marker
        for parent in parents:
            thing = getattr(thing, parent)
        setattr(thing, last, value)

    return apply


BAD_MARKERS = [
    (change('pose.position.x', NAN), r'pose.position: \[nan, 0.0, 0.0\], expected finite.*\[m\]'),
    (change('pose.position.y', INF), r'expected finite numbers \[m\]'),
    (change('scale.x', NAN), r'scale: .*expected finite numbers \[m\]'),
    (change('scale.x', 0.0), r'scale: \[0.0, .*expected three lengths > 0 \[m\]'),
    (change('scale.z', -0.1), r'expected three lengths > 0 \[m\]'),
    (change('scale.y', 1e5), r'expected numbers of at most 10000 \[m\]'),
    (change('pose.position.y', 1e5), r'expected numbers of at most 10000 \[m\]'),
    (change('pose.orientation.w', 0.0), r'of length 0, expected a quaternion'),
    (change('pose.orientation.w', 1.1), r'of length 1.1, expected a quaternion'),
    (change('pose.orientation.w', NAN), r'pose.orientation: .*expected finite numbers'),
    (change('type', Marker.SPHERE), r'type 2, expected 1 \(CUBE\) or 6 \(CUBE_LIST\)'),
    (change('type', Marker.CUBE_LIST), r'points: 0, expected 1 to 10000'),
    (change('action', 1), r'action 1, expected 0 \(ADD\), 2 \(DELETE\) or 3 \(DELETEALL\)'),
    (change('lifetime.sec', -1), r'lifetime: -1.0, expected 0 \(for ever\) or more \[s\]'),
    (change('header.frame_id', 'camera'), r'frame "camera", expected "torso" or an empty frame'),
]


@pytest.mark.parametrize(('spoil', 'sentence'), BAD_MARKERS)
def test_an_array_with_a_bad_marker_is_rejected_whole(spoil, sentence):
    body = body_of(box('old'))
    bad = box('hand', 3)
    spoil(bad)
    with pytest.raises(MessageError, match=r'marker 1 \("hand/3"\): ' + '.*' + sentence):
        body.apply(array(box('new'), bad, box('newer')), 0.0, 'torso')
    assert names(body) == ['old/0']


def test_an_unknown_frame_is_an_error_of_its_own():
    with pytest.raises(FrameError, match='frame "camera", expected "torso"'):
        body_of(box(frame='camera'))
    with pytest.raises(FrameError, match='frame "camera", expected "torso"'):
        goal_from_msg(target(frame='camera'), 'torso')


def test_more_boxes_than_the_limit_are_rejected():
    many = box()
    many.type, many.points = Marker.CUBE_LIST, [Point()] * MOST_BOXES
    body = body_of(many)
    with pytest.raises(MessageError, match='10001 boxes, expected at most 10000 in all'):
        body.apply(array(box(index=1)), 0.0, 'torso')
    many.points = [Point()] * (MOST_BOXES + 1)
    with pytest.raises(MessageError, match='points: 10001, expected 1 to 10000'):
        body_of(many)


@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4), st.floats(0.991, 1.009))
def test_a_quaternion_of_nearly_unit_length_is_normalised(q, length):
    norm = np.linalg.norm(q)
    if norm < 1e-3:
        return
    marker = box()
    o = marker.pose.orientation
    o.x, o.y, o.z, o.w = (length * np.array(q) / norm).tolist()
    r = scene_of(body_of(marker)).boxes[0].rotation
    np.testing.assert_allclose(r @ r.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(r, rotation_matrix(q), atol=1e-12)


OPERATIONS = st.tuples(
    st.sampled_from([Marker.ADD, Marker.DELETE, Marker.DELETEALL]),
    st.sampled_from(['', 'a', 'b']),
    st.integers(0, 2),
)


@given(st.lists(st.lists(OPERATIONS, max_size=6), max_size=4))
def test_any_markers_leave_what_a_dictionary_would(arrays):
    body, expected = WearerBody(), set()
    for operations in arrays:
        for action, ns, index in operations:
            if action == Marker.ADD:
                expected.add((ns, index))
            elif action == Marker.DELETE:
                expected.discard((ns, index))
            else:
                expected = {key for key in expected if ns and key[0] != ns}
        markers = [
            box(ns, index) if action == Marker.ADD else command(action, ns, index)
            for action, ns, index in operations
        ]
        body = body.apply(array(*markers), 0.0, 'torso')
    assert {key for key, _ in body.parts} == expected


@pytest.mark.parametrize(
    ('msg', 'sentence'),
    [
        (target(NAN), r'point: \[nan, 0.1, 0.3\], expected finite numbers \[m\]'),
        (target(1e6), r'expected numbers of at most 10000 \[m\]'),
    ],
)
def test_a_bad_target_is_rejected(msg, sentence):
    with pytest.raises(MessageError, match=sentence):
        goal_from_msg(msg, 'torso')


def test_joints_are_found_by_name_and_others_ignored():
    msg = joints([9.0, *FOLDED[::-1], NAN], ['wheel', *JOINTS[::-1], 'hand'])
    np.testing.assert_array_equal(configuration_from_msg(msg, JOINTS), FOLDED)
    assert has_joint_of(msg, JOINTS)
    assert not has_joint_of(joints([1.0], ['wheel']), JOINTS)


@pytest.mark.parametrize(
    ('msg', 'sentence'),
    [
        (joints(FOLDED[:3], JOINTS[:3]), r"no \['joint_4'\] in .*expected all of"),
        (joints(FOLDED[:3]), r'position: 3 values for 4 names, expected one a name \[rad\]'),
        (joints([0.0, NAN, 0.0, 0.0]), r'expected finite numbers \[rad\]'),
        (
            joints([*FOLDED, 0.0], [*JOINTS, 'joint_2']),
            r"\['joint_2'\] twice .*each joint once",
        ),
    ],
)
def test_bad_joint_positions_are_rejected(msg, sentence):
    with pytest.raises(MessageError, match=sentence):
        configuration_from_msg(msg, JOINTS)


def motion(times=(0.0, 0.5, 1.25)):
    n = len(times)
    v = np.linspace(0.1, 0.4, 4) * np.ones((n, 1))
    v[0] = v[-1] = 0.0
    return Trajectory(
        times=times, positions=np.arange(4.0 * n).reshape(n, 4), velocities=v, accelerations=2 * v
    )


def test_a_trajectory_survives_the_way_to_a_message_and_back():
    msg = joint_trajectory_to_msg(motion(), JOINTS, 'torso')
    assert msg.header.frame_id == 'torso'
    assert (msg.header.stamp.sec, msg.header.stamp.nanosec) == (0, 0)
    back = joint_trajectory_from_msg(msg, JOINTS)
    for name in ('times', 'positions', 'velocities', 'accelerations'):
        np.testing.assert_array_equal(getattr(back, name), getattr(motion(), name))


@pytest.mark.parametrize('begin', [0.0, 12.25, 1_795_920_508.139292717, 1_800_000_000.0 - 2**-22])
def test_the_stamp_of_a_motion_is_its_begin_to_half_a_nanosecond(begin):
    # As one number, nanoseconds since 1970 are 256 apart.
    still = np.zeros((1, 4))
    point = Trajectory([0.0], [FOLDED], still, still)
    stamp = joint_trajectory_to_msg(point, JOINTS, 'torso', begin).header.stamp
    found = Fraction(stamp.sec) + Fraction(stamp.nanosec, 10**9)
    assert abs(found - Fraction(begin)) <= Fraction(1, 2 * 10**9)


@settings(max_examples=50)
@given(st.lists(st.floats(1e-6, 10.0), min_size=1, max_size=30))
def test_times_are_rounded_to_nanoseconds_and_increase(steps):
    times = np.concatenate([[0.0], np.cumsum(steps)])
    msg = joint_trajectory_to_msg(motion(times), JOINTS, 'torso')
    ns = [p.time_from_start.sec * 10**9 + p.time_from_start.nanosec for p in msg.points]
    assert all(a < b for a, b in pairwise(ns))
    np.testing.assert_allclose(np.array(ns) * 1e-9, times, atol=1e-9)


@worlds.examples(60)
@given(seed=st.integers(0, 2**32 - 1))
def test_what_is_sent_is_what_was_proven_to_the_bit(seed):
    rng = np.random.default_rng(seed)
    moving = worlds.random_motion(rng)
    if moving is None:
        return
    stop = fast_stop(moving, rng.uniform(0.0, moving.duration), worlds.limits())
    for sent in (moving, stop):
        back = joint_trajectory_from_msg(joint_trajectory_to_msg(sent, JOINTS, 'torso'), JOINTS)
        for name in ('positions', 'velocities', 'accelerations'):
            assert np.array_equal(getattr(back, name), getattr(sent, name))
        # Whole nanoseconds, but for the last digit.
        assert np.abs(back.times - sent.times).max() < 1e-15


def test_a_trajectory_that_does_not_end_at_rest_is_no_message():
    v = np.full((2, 4), 1e-3)
    moving = Trajectory(times=[0, 1], positions=v, velocities=v, accelerations=v)
    with pytest.raises(MessageError, match=r'velocity of the last point: .*expected 0 \[rad/s\]'):
        joint_trajectory_to_msg(moving, JOINTS, 'torso')


def test_points_closer_than_a_nanosecond_are_rejected():
    with pytest.raises(MessageError, match='expected strictly increasing times'):
        joint_trajectory_to_msg(motion((0.0, 1.0, 1.0 + 1e-10)), JOINTS, 'torso')


def test_joints_in_another_order_are_sorted():
    msg = joint_trajectory_to_msg(motion(), JOINTS[::-1], 'torso')
    back = joint_trajectory_from_msg(msg, JOINTS)
    np.testing.assert_array_equal(back.positions, motion().positions[:, ::-1])


def points(index, field, value):
    def apply(msg):
        setattr(msg.points[index], field, value)

    return apply


def first_time(sec, nanosec):
    def apply(msg):
        msg.points[0].time_from_start.sec = sec
        msg.points[0].time_from_start.nanosec = nanosec

    return apply


def same_time(msg):
    msg.points[2].time_from_start = msg.points[1].time_from_start


def stamped(msg):
    msg.header.stamp.sec = 90


@pytest.mark.parametrize(
    ('spoil', 'sentence'),
    [
        (change('joint_names', JOINTS[:3]), 'joint_names: .*expected each of .* once'),
        (change('joint_names', []), r'joint_names: \[\], expected each of'),
        (change('joint_names', [*JOINTS[:3], 'wheel']), 'expected each of'),
        (change('joint_names', [*JOINTS[:3], 'joint_1']), 'expected each of'),
        (change('points', []), 'points: none, expected at least one'),
        (points(2, 'velocities', [1e-6, 0.0, 0.0, 0.0]), r'last point: .*expected 0 \[rad/s\]'),
        (stamped, r'header.stamp: 90.0 .*expected 0 or an end after the present time 100.0 \[s\]'),
        (same_time, r'points\[2\].time_from_start: 0.5 after 0.5, .*increasing times \[s\]'),
        (first_time(0, 1), r'points\[0\].time_from_start: 1e-09, expected 0'),
        (first_time(-1, 0), r'points\[0\].time_from_start: -1.0, expected 0'),
        (points(1, 'positions', [0.0] * 3), r'points\[1\].positions: 3 values, expected 4'),
        (points(1, 'positions', []), r'points\[1\].positions: 0 values, expected 4'),
        (points(1, 'velocities', []), r'points\[1\].velocities: 0 values, .*\[rad/s\]'),
        (points(1, 'accelerations', []), r'accelerations: 0 values, .*\[rad/s\^2\]'),
        (points(1, 'effort', [0.0] * 4), 'effort: given, expected none'),
        (points(1, 'positions', [NAN, 0.0, 0.0, 0.0]), r'expected finite numbers \[rad\]'),
        (points(0, 'velocities', [INF, 0.0, 0.0, 0.0]), r'expected finite numbers \[rad/s\]'),
    ],
)
def test_a_trajectory_that_no_controller_would_take_is_rejected(spoil, sentence):
    msg = joint_trajectory_to_msg(motion(), JOINTS, 'torso')
    spoil(msg)
    with pytest.raises(MessageError, match=sentence):
        joint_trajectory_from_msg(msg, JOINTS, now=100.0)


def test_the_tool_path_runs_from_the_first_to_the_last_pose():
    arm = load_arm()
    q = np.clip(motion().positions, *arm.bounds)
    t = motion()
    moved = Trajectory(
        times=t.times, positions=q, velocities=t.velocities, accelerations=t.accelerations
    )
    path = tool_path_to_msg(arm, moved, 'torso', 7)
    assert len(path.poses) == 7
    assert path.header.frame_id == 'torso'
    for pose, end in ((path.poses[0], q[0]), (path.poses[-1], q[-1])):
        p, o = pose.pose.position, pose.pose.orientation
        T = pose_matrix([p.x, p.y, p.z], [o.x, o.y, o.z, o.w])
        np.testing.assert_allclose(T, tool_pose(arm, end), atol=1e-9)


def test_each_status_has_a_code():
    assert set(CODE_OF_STATUS) == set(PlanStatus)
    assert answer(ErrorCode.TIMED_OUT, 'too late') == 'TIMED_OUT (-6): too late'


def test_a_bad_frame_has_a_code_of_its_own():
    for other in (ErrorCode.INVALID_GOAL_CONSTRAINTS, ErrorCode.UNABLE_TO_AQUIRE_SENSOR_DATA):
        assert code_of_rejection(MessageError('x'), other) is other
        assert code_of_rejection(FrameError('x'), other) is ErrorCode.FRAME_TRANSFORM_FAILURE


def test_markers_show_capsules_and_what_may_meet():
    arm = replace(
        worlds.capsule_arm(np.random.default_rng(0)), allowed=(('base', 'torso'), ('part 2', 'x'))
    )
    q = np.linspace(-0.5, 0.5, 7)
    still = np.zeros((2, 7))
    trajectory = Trajectory(
        times=[0.0, 1.0],
        positions=np.stack([q, -q]),
        velocities=still,
        accelerations=still,
    )
    path = tool_path_to_msg(arm, trajectory, 'chest', 20)
    msg = plan_markers(arm, worlds.wearer(), 0.02, trajectory, np.ones(3), path)
    placed = {}
    for m in msg.markers[1:]:
        assert m.header.frame_id == 'chest'
        assert (m.ns, m.id) not in placed
        placed[m.ns, m.id] = m
    for ns, at in (('arm_start_capsules', q), ('arm_goal_capsules', -q)):
        shown = [m for (name, _), m in placed.items() if name == ns]
        bars = bars_of(arm)[:-1]
        lines = np.delete(bar_ends_at(arm, at[None], 1.0)[0], len(bars), axis=0)
        for line, bar in zip(lines, (*bars, *mount_bars(arm)), strict=True):
            places = [
                [m.pose.position.x, m.pose.position.y, m.pose.position.z]
                for m in shown
                if m.type == Marker.SPHERE and abs(m.scale.x - 2.0 * bar.radius) < 1e-12
            ]
            for end in line:
                assert np.abs(np.array(places) - end).max(axis=1).min() < 1e-9
            (height,) = {
                round(m.scale.z, 9)
                for m in shown
                if m.type == Marker.CYLINDER and abs(m.scale.x - 2.0 * bar.radius) < 1e-12
            }
            assert height == pytest.approx(np.linalg.norm(line[1] - line[0]), abs=1e-8)
    text = placed['allowed', 0].text
    assert text == 'base may meet torso\npart 2 may meet x'
