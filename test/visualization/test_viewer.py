# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The viewer's model without a browser: the last request is answered, and rejections are shown."""

from argparse import Namespace
from dataclasses import replace
import socket
from urllib.request import urlopen

import numpy as np
import pytest
from recordings import write_child

pytest.importorskip('fcl')
pytest.importorskip('viser')

from rrth_planner.cli.viewer import _served, main
from rrth_planner.io.arm_file import load_arm
from rrth_planner.io.motion_capture_file import load_person
from rrth_planner.io.resources import resource_path
from rrth_planner.io.settings import load_settings
from rrth_planner.io.skeleton_file import load_skeleton
from rrth_planner.io.urdf.placed_robot import place_robot
from rrth_planner.io.wearer_file import load_body
from rrth_planner.model.arm import pointing_error, tool_pose
from rrth_planner.model.errors import OptionsError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.pipeline.request import PlanQuestion
from rrth_planner.planning.result import Tree
from rrth_planner.visualization.viewer.curves import along_z, path_curve, tree_segments
from rrth_planner.visualization.viewer.examples import (
    BODIES,
    example_body,
    example_target,
    start_of,
    TARGETS,
)
from rrth_planner.visualization.viewer.panel import response_html
from rrth_planner.visualization.viewer.person_page import PersonPage
from rrth_planner.visualization.viewer.planning_worker import ViewerModel
from rrth_planner.visualization.viewer.player import Player
from rrth_planner.visualization.viewer.scene_view import LAYERS, SceneView
from rrth_planner.wearer.body_boxes import body_boxes
from rrth_planner.wearer.recorded_person import excerpt, posture_at

WAIT = 120.0
ARM = load_arm()
SETTINGS = load_settings(ARM.dof)
FRONT = example_target('front')


def question(body='body', target=FRONT, seed=0):
    """Return what the page begins with."""
    return PlanQuestion(
        arm=ARM,
        scene=example_body(body),
        q_start=start_of(ARM),
        goal=PointingGoal(target),
        limits=SETTINGS.limits,
        options=SETTINGS.options,
        margin=0.02,
        ray_guard_length=1.0,
        seed=seed,
    )


@pytest.fixture
def model():
    """Give a model, and end its thread."""
    model = ViewerModel(question('body_arm_raised'))
    yield model
    model.close()


def test_a_dragged_target_is_planned_for_anew(model):
    first = model.wait(model.ask(), WAIT)
    left = example_target('left')
    second = model.wait(model.ask(target=left), WAIT)
    for response, target in ((first, FRONT), (second, left)):
        assert response.plan.trajectory is not None, response.sentence
        assert pointing_error(ARM, response.plan.trajectory.positions[-1], target) < 1e-6
        assert 'planning time' in response_html(response)


def test_the_newest_drag_wins(model):
    targets = [FRONT + [0.0, 0.01 * k, 0.0] for k in range(40)]
    numbers = [model.ask(target=target) for target in targets]
    response = model.wait(numbers[-1], WAIT)
    assert response.number == numbers[-1]
    assert response.question.goal.target.tolist() == targets[-1].tolist()


def test_a_refusal_is_said_and_the_next_target_is_planned_for(model):
    response = model.wait(model.ask(target=np.zeros(3)), WAIT)
    assert response.plan.trajectory is None
    assert 'inside box "torso"' in response.sentence
    assert 'inside box &quot;torso&quot;' in response_html(response)
    assert model.wait(model.ask(target=FRONT), WAIT).plan.trajectory is not None


def test_what_is_no_target_is_said_and_changes_nothing(model):
    response = model.wait(model.ask(target=np.array([np.nan, 0.0, 0.0])), WAIT)
    assert response.plan is None
    assert 'target' in response.sentence
    assert 'no motion' in response_html(response)
    assert model.question.goal.target.tolist() == FRONT.tolist()


def test_margin_and_seed_count(model):
    near = model.wait(model.ask(margin=0.0), WAIT)
    far = model.wait(model.ask(margin=0.03, seed=5), WAIT)
    assert far.question.margin == 0.03
    assert far.plan.seed == 5
    assert far.plan.clearance >= 0.03 > near.question.margin == 0.0
    again = model.wait(model.ask(), WAIT)
    assert np.array_equal(again.plan.trajectory.positions, far.plan.trajectory.positions)


def test_a_plan_keeps_its_first_path_and_its_trees(model):
    plan = model.wait(model.ask(seed=0, step_size=0.2), WAIT).plan
    raw = plan.search.raw_path
    assert raw.length > plan.path.length
    assert np.allclose(raw.waypoints[0], plan.path.waypoints[0])
    assert sum(len(tree.nodes) for tree in plan.search.trees) >= len(raw.waypoints) - 1


@pytest.mark.parametrize('name', BODIES)
def test_an_example_body_is_read_without_ros(name):
    scene = example_body(name)
    assert {box.name for box in scene.boxes} >= {'torso', 'head'}
    if name == 'body':
        np.testing.assert_allclose(scene.numbers, load_body().numbers, atol=1e-12)


def test_an_example_body_is_that_of_the_messages():
    pytest.importorskip('rclpy')
    from rrth_planner.ros.messages.body import scene_of, WearerBody
    from rrth_planner.ros.messages.message_file import message_from_file
    from visualization_msgs.msg import MarkerArray

    for name in BODIES:
        file = resource_path(f'msg_examples/{name}.yaml')
        body = WearerBody().apply(message_from_file(file, MarkerArray), 0.0, 'torso')
        numbers = example_body(name).numbers
        np.testing.assert_allclose(numbers, scene_of(body).numbers, atol=1e-12)


def test_bad_files_and_arguments_are_one_sentence(tmp_path, capsys):
    file = tmp_path / 'body.yaml'
    file.write_text('markers: 5\n')
    for arguments, words in (
        (['--ros-args', '-r', '__ns:=/a'], 'expected only with --live'),
        (['--set', 'speed=3'], 'speed: unknown parameter'),
        (['--set', 'speed'], 'expected NAME=VALUE'),
        (['--set', 'dof=4'], 'dof: unknown parameter'),
        (['--set', 'margin=[0.1]'], 'margin: [0.1], expected a number [m]'),
        (['--set', 'margin="1"'], "margin: '1', expected a number [m]"),
        (['--set', 'margin=*a'], '--set margin: line 1: '),
        (['--person', 'none.bvh'], 'file none.bvh: No such file'),
        (['--person', '--body', str(file)], '--person: given with --body'),
        (['--person', '--skeleton', 'mediapipe'], 'base: '),
        (['--person', '--live'], '--live: given with'),
        (['--body', str(file)], 'markers: 5, expected a list'),
    ):
        assert main([*arguments, '--no-open']) == 1
        said = capsys.readouterr().err
        assert words in said
        assert said.count('\n') == 1


def test_another_arm_starts_in_the_middle_of_its_range():
    other = replace(ARM, joint_names=tuple('abcd'))
    np.testing.assert_array_equal(start_of(other), ARM.bounds.mean(axis=0))
    assert np.array([example_target(name) for name in TARGETS]).shape == (5, 3)


def test_curves_of_the_tool_go_from_waypoint_to_waypoint():
    q = np.array([start_of(ARM), start_of(ARM) - 0.4, start_of(ARM) - 0.1])
    tool = tool_pose(ARM, q)[:, :3, 3]
    curve = path_curve(ARM, q)
    np.testing.assert_allclose(curve[[0, -1]], tool[[0, 2]], atol=1e-12)
    pieces = tree_segments(ARM, Tree(nodes=q, parents=[-1, 0, 0]))
    ends = pieces.reshape(2, -1, 2, 3)
    np.testing.assert_allclose(ends[:, 0, 0], tool[[0, 0]], atol=1e-12)
    np.testing.assert_allclose(ends[:, -1, 1], tool[[1, 2]], atol=1e-12)


def test_a_bar_along_z_joins_two_points():
    rng = np.random.default_rng(0)
    for begin, end in rng.normal(size=(50, 2, 3)):
        middle, (w, x, y, z), length = along_z(begin, end)
        axis = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        np.testing.assert_allclose(middle + 0.5 * length * np.array(axis), end, atol=1e-9)


def test_a_motion_plays_to_its_end_and_again():
    player = Player().loaded(2.0)
    assert player.time == 0.0
    player = player.toggled()
    assert (player.time, player.is_playing) == (0.0, True)
    assert replace(player, speed=0.5).advanced(1.0).time == 0.5
    ended = player.advanced(5.0)
    assert (ended.time, ended.is_playing) == (2.0, False)
    again = replace(player, is_repeating=True).advanced(5.0).advanced(0.1)
    assert (again.time, again.is_playing) == (0.0, True)
    assert player.moved(9.0).time == 2.0
    assert ended.moved(1.0).loaded(4.0).time == 2.0


def test_another_target_shows_where_the_arm_comes_to():
    opened = Player().loaded(2.0)
    aimed = opened.aimed()
    assert (opened.time, aimed.time, aimed.loaded(3.0).time) == (0.0, 2.0, 3.0)
    # Also after a rejection, which has no motion.
    assert aimed.loaded(0.0).aimed().loaded(3.0).time == 3.0
    assert Player().aimed().loaded(3.0).time == 3.0
    halfway = opened.moved(1.0)
    assert halfway.aimed() == halfway
    playing = opened.toggled()
    assert playing.aimed() == playing


def can_listen_on(host):
    """Return whether this machine has an address."""
    try:
        socket.create_server((host, 0), family=socket.AF_INET6).close()
    except OSError:
        return False
    return True


@pytest.mark.parametrize(
    ('host', 'page'),
    [
        ('127.0.0.1', 'http://127.0.0.1:'),
        ('0.0.0.0', 'http://localhost:'),
        ('localhost', 'http://localhost:'),
        ('::', 'http://localhost:'),
        ('::1', 'http://[::1]:'),
    ],
)
def test_a_page_is_served_on_addresses_of_both_kinds(host, page, capsys):
    if ':' in host and not can_listen_on(host):
        pytest.skip('this machine has no such address')
    options = Namespace(host=host, port=0, open=False, screenshot=None)
    with _served(options) as (_, url):
        assert url.startswith(page)
        if host != '::':
            # Which of the two kinds the name stands for is the matter of the machine.
            with urlopen(url, timeout=WAIT) as response:
                assert response.status == 200
    assert f'The viewer is at {url}' in capsys.readouterr().out


@pytest.mark.parametrize('host', ['no.such.host.invalid', '203.0.113.7', '2001:db8::1', '.'])
def test_a_host_that_is_none_of_this_machine_is_one_sentence(host, capsys):
    assert main(['--host', host, '--no-open']) == 1
    said = capsys.readouterr().err
    assert f'--host {host} --port 8081: ' in said
    assert 'expected an address of this machine' in said
    assert said.count('\n') == 1


def test_a_port_that_is_taken_is_one_sentence(capsys):
    with socket.create_server(('127.0.0.1', 0)) as listener:
        port = listener.getsockname()[1]
        assert main(['--port', str(port), '--no-open']) == 1
    said = capsys.readouterr().err
    assert f'--port {port}: ' in said
    assert '--port 0: any that is' in said
    assert said.count('\n') == 1


def test_a_missing_browser_is_one_sentence(monkeypatch, tmp_path):
    from rrth_planner.visualization.viewer import screenshot

    pytest.importorskip('playwright')
    monkeypatch.setattr(screenshot, 'find_browser', lambda: None)
    with pytest.raises(OptionsError, match='no browser found'):
        screenshot.save_picture('http://127.0.0.1:9', tmp_path / 'a.png')


def test_meshes_of_the_urdf_move_with_the_capsules(tmp_path):
    pytest.importorskip('yourdfpy')
    file = resource_path('config/examples/chest_arm.urdf')
    arm = load_arm(resource_path('config/examples/chest_arm.yaml'))
    robot = place_robot(file, arm)
    with _served(Namespace(host='127.0.0.1', port=0, open=False, screenshot=None)) as (server, _):
        view = SceneView(server, arm, 0.5, robot)
        assert set(view.layers) == {*LAYERS, 'meshes'}
        for q in np.random.default_rng(0).uniform(*arm.bounds, (5, arm.dof)):
            view.show_configuration(q, None)
            names = list(robot.model.actuated_joint_names)
            shown = dict(zip(names, np.asarray(robot.model.cfg), strict=True))
            np.testing.assert_allclose([shown[name] for name in arm.joint_names], q)


def test_the_urdf_of_another_arm_is_one_sentence(capsys):
    file = resource_path('config/examples/chest_arm.urdf')
    assert main(['--urdf', str(file), '--port', '0', '--no-open']) == 1
    said = capsys.readouterr().err
    assert 'no joint "joint_1", expected those of the arm' in said
    assert said.count('\n') == 1


def test_a_child_is_a_wearer_where_the_stature_says_so(tmp_path, capsys):
    person = ['--person', str(write_child(tmp_path / 'child.csv')), '--no-open']
    nowhere = ['--host', 'no.such.host.invalid']
    for arguments, words in (
        ([], 'smaller than the parameter stature says'),
        (['--stature', '0.2'], 'stature: [0.2, 0.2], expected that of the smallest'),
        (['--stature', '0.9', '1.0', '1.1'], 'stature: 3 values, expected one or two [m]'),
        # He is taken: only the address is none.
        (['--stature', '1.0', '1.2'], '--host no.such.host.invalid'),
        (['--stature', '1.2'], '--host no.such.host.invalid'),
        (['--stature', '1.2', '--hand-size', '3'], 'hand_size: 3, expected 0 or a size from 0.05'),
        (['--stature', '1.2', '--hand-size', '0.2'], '--host no.such.host.invalid'),
    ):
        assert main([*person, *nowhere, *arguments]) == 1
        said = capsys.readouterr().err
        assert words in said
        assert len([line for line in said.splitlines() if words in line]) == 1


@pytest.fixture(name='person_page')
def _person_page():
    """Give what makes the page of a recorded person; the server and the threads end afterwards."""
    made, skeleton = [], load_skeleton('cmu_bvh')
    with _served(Namespace(host='127.0.0.1', port=0, open=False, screenshot=None)) as (server, _):

        def make(person):
            scene, _ = body_boxes(skeleton, posture_at(person, 0.0))
            made.append(PersonPage(server, replace(question(), scene=scene), person, skeleton))
            return made[-1]

        yield make
        for page in made:
            page.model.close()


def drawn_for(page, begin, span):
    """Draw 30 frames a second for a span [s], and wait for each plan; give the time of each."""
    for now in np.arange(begin, begin + span, 1.0 / 30.0):
        page.draw(now)
        page.model.wait(page.asked, WAIT)
        yield now


def test_beside_a_person_the_arm_aims_where_the_target_is_dragged(person_page):
    page = person_page(excerpt(load_person(), 0.0, 0.0))
    begin = 0.0
    for name in ('front', 'left'):
        target = example_target(name)
        page.aim(target)
        for begin in drawn_for(page, begin, 8.0):  # noqa: B020
            if pointing_error(ARM, page.positions_at(begin), target) < 1e-6:
                break
        # There it stays.
        for begin in drawn_for(page, begin, 0.5):  # noqa: B020
            assert pointing_error(ARM, page.positions_at(begin), target) < 1e-6


def test_beside_a_person_who_moves_boxes_are_drawn_where_he_is_and_the_arm_plans_again(
    person_page,
):
    person = load_person()
    page, skeleton = person_page(person), load_skeleton('cmu_bvh')
    numbers = set()
    for now in drawn_for(page, 0.0, 9.0):
        scene, _ = body_boxes(skeleton, posture_at(person, now))
        drawn = np.array([handle.position for handle in page.view.body])
        np.testing.assert_allclose(drawn, [box.center for box in scene.boxes], atol=1e-9)
        numbers.add(page.model.response.number)
    assert len(numbers) > 2
