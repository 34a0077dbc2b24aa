# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Planning in a process of its own: the same answers, cancelled, killed, left alone."""

import dataclasses
from multiprocessing.connection import Pipe
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import Thread
import time

import numpy as np
import pytest
from rrth_planner.model.arm import ArmModel, tool_pose
from rrth_planner.model.errors import ModelError
from rrth_planner.model.goal import PointingGoal
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.status import PlanStatus
from rrth_planner.pipeline.channel import Channel, REMEMBERED, STOP
from rrth_planner.pipeline.planning_process import (
    PlanningProcess,
    PlanningProcessError,
    PlanningTraceback,
)
from rrth_planner.pipeline.request import asked, parts_of, PlanQuestion
from rrth_planner.pipeline.worker_process import WorkerProcess
from rrth_planner.planning.options import RRTHOptions
import worlds

in_process = pytest.importorskip('rrth_planner.pipeline.in_process_planner', exc_type=ImportError)
TARGETS = ([1.5, 0.1, 0.3], [0.4, -1.2, 0.5], [-1.0, 0.5, 0.9])
worker = pytest.importorskip('rrth_planner.pipeline.planning_worker', exc_type=ImportError)
LONGEST_WAIT = 60.0


def question(target=TARGETS[0], seed=7, **changes):
    """Return what is asked of the folded arm."""
    given = {
        'arm': worlds.table_1_arm(),
        'scene': worlds.wearer(),
        'q_start': np.array(worlds.FOLDED),
        'goal': PointingGoal(np.array(target)),
        'limits': worlds.limits(),
        'options': RRTHOptions(),
        'margin': 0.02,
        'ray_guard_length': 1.0,
        'seed': seed,
    }
    return PlanQuestion(**{**given, **changes})


def shut_in():
    """Return a wearer with plates round the forearm of the folded arm, which cannot get out."""
    plates = [((-0.421, y, z), (0.06, 0.02, 0.18)) for y, z in ((-0.04, 0.552), (-0.16, 0.552))]
    plates += [((-0.421, -0.1, z), (0.06, 0.14, 0.02)) for z in (0.632, 0.472)]
    boxes = [Box(f'plate {k}', *plate, np.eye(3)) for k, plate in enumerate(plates)]
    return Scene((*worlds.wearer().boxes, *boxes))


@pytest.fixture(name='said', scope='module')
def _said():
    """Give the sentences of deaths."""
    return []


@pytest.fixture(name='process', scope='module')
def _process(said):
    """Give a process that plans."""
    process = PlanningProcess(worlds.table_1_arm(), RRTHOptions(), said.append)
    yield process
    process.close()


@pytest.fixture(name='hasty', scope='module')
def _hasty(said):
    """Give one that is soon taken to hang."""
    process = PlanningProcess(worlds.table_1_arm(), RRTHOptions(), said.append, longest_stop=0.3)
    process.warm_up(worlds.table_1_arm(), RRTHOptions())
    yield process
    process.close()


@pytest.mark.parametrize('target', TARGETS)
def test_it_answers_as_this_process_would(process, target):
    here, there = (
        planner.plan(question(target)) for planner in (in_process.InProcessPlanner(), process)
    )
    assert (there.status, there.target_distance, there.seed) == (
        here.status,
        here.target_distance,
        here.seed,
    )
    for name in ('times', 'positions', 'velocities', 'accelerations'):
        values = getattr(there.trajectory, name)
        np.testing.assert_array_equal(values, getattr(here.trajectory, name))
        assert not values.flags.writeable
    assert there.path.length == here.path.length


def test_the_second_checker_sees_what_it_sees_here(process):
    asked = question()
    motion = process.plan(asked).trajectory
    tool = motion.positions[len(motion.times) // 2]
    in_the_way = Box(
        'hand', tool_pose(worlds.table_1_arm(), tool)[:3, 3], np.full(3, 0.05), np.eye(3)
    )
    for scene in (asked.scene, Scene((*asked.scene.boxes, in_the_way))):
        arguments = (asked.required, scene, motion, 1.0)
        found = process.violation_seen(*arguments)
        assert found == in_process.InProcessPlanner.violation_seen(*arguments)
    assert found.box == 'hand'


def test_cancelled_requests_end(process):
    # Without a limit that it could reach soon.
    endless = RRTHOptions(max_samples=10**7, time_limit=3600.0)
    asked = [False]

    def should_stop():
        asked.append(len(asked) > 3)
        return asked[-1]

    begin = time.monotonic()
    asked_for = question(scene=shut_in(), options=endless)
    assert process.plan(asked_for, should_stop).status is PlanStatus.CANCELLED
    assert time.monotonic() - begin < 0.5 * LONGEST_WAIT
    # The next one is planned to its end.
    assert process.plan(question()).status is PlanStatus.SOLVED


def test_one_that_hangs_is_replaced_once_its_request_is_cancelled(hasty, said):
    n_said = len(said)
    assert hasty.plan(question()).status is PlanStatus.SOLVED
    os.kill(hasty.pid, signal.SIGSTOP)
    with pytest.raises(PlanningProcessError, match='ended with code -9 while working'):
        hasty.plan(question(), lambda: True)
    assert len(said) == n_said + 1
    hasty.warm_up(worlds.table_1_arm(), RRTHOptions())
    assert hasty.plan(question()).status is PlanStatus.SOLVED


def test_one_that_hangs_over_a_question_is_replaced_after_its_time_limit(hasty, said):
    assert hasty.plan(question()).status is PlanStatus.SOLVED
    asked = question(options=RRTHOptions(time_limit=0.1))
    motion, required = hasty.plan(question()).trajectory, asked.required
    # More than a pipe holds.
    huge = Scene(tuple(Box(f'{k}', [9.0, 9.0, k], np.ones(3), np.eye(3)) for k in range(5000)))
    for ask in (
        lambda: hasty.plan(asked),
        lambda: hasty.plan(dataclasses.replace(asked, scene=huge)),
        lambda: hasty.violation_seen(required, worlds.wearer(), motion, 1.0),
    ):
        before, n_said = hasty.pid, len(said)
        os.kill(before, signal.SIGSTOP)
        with pytest.raises(PlanningProcessError, match='since it had not answered in time'):
            ask()
        assert len(said) == n_said + 1
        assert hasty.pid != before
        # The next one waits for its successor, which loads as long as that takes.
        hasty.warm_up(required.arm, RRTHOptions())
        assert hasty.plan(question()).status is PlanStatus.SOLVED


def test_a_question_does_not_wait_for_ever_for_a_process_that_loads():
    loading = PlanningProcess(worlds.table_1_arm(), RRTHOptions(), longest_stop=1.0)
    before = loading.pid
    os.kill(before, signal.SIGSTOP)
    with pytest.raises(PlanningProcessError, match='still loads: ask again'):
        loading.plan(question(options=RRTHOptions(time_limit=0.1)))
    # It may be compiling, which takes minutes.
    assert loading.pid == before
    os.kill(before, signal.SIGCONT)
    loading.warm_up(worlds.table_1_arm(), RRTHOptions())
    assert loading.plan(question()).status is PlanStatus.SOLVED
    loading.close()


def test_a_stop_that_comes_after_the_answer_stops_nothing():
    ours, theirs = map(Channel, Pipe())
    thread = Thread(target=worker.serve, args=(theirs, {'double': lambda k: 2 * k}))
    thread.start()
    for k in range(3):
        ours.send(k, 'double', k)
        assert ours.receive() == (k, 2 * k)
        ours.send(STOP)
    ours.line.close()
    thread.join(LONGEST_WAIT)
    assert not thread.is_alive()


def test_an_answer_that_nobody_waited_for_is_not_that_of_the_next_question(process):
    begun = process.pid
    os.kill(begun, signal.SIGKILL)
    with pytest.raises(PlanningProcessError):
        # It may die before or while it is asked.
        while process.pid == begun:
            process._begin('warm_up', *process._warm_up)
            process._end(lambda: False)
    # Its successor warms up, and is asked to do so again before anybody has waited for that.
    process.warm_up(worlds.table_1_arm(), RRTHOptions(club_attempts=3))
    here = in_process.InProcessPlanner()
    for target in TARGETS:
        assert process.plan(question(target)).target_distance == (
            here.plan(question(target)).target_distance
        )


def test_what_cannot_be_sent_was_not_sent():
    ours, theirs = map(Channel, Pipe())
    arm = worlds.table_1_arm()
    with pytest.raises(Exception, match='pickle'):
        ours.send(arm, lambda: None)
    ours.send(arm)
    (sent,) = theirs.receive()
    np.testing.assert_array_equal(sent.dh, arm.dh)
    ours.line.close()


def test_a_question_is_made_of_its_parts():
    whole = question()
    again = asked(parts_of(whole))
    for field in dataclasses.fields(PlanQuestion):
        assert getattr(again, field.name) is getattr(whole, field.name)


def test_arms_and_scenes_are_sent_once():
    ours, theirs = map(Channel, Pipe())
    arm, scenes = worlds.table_1_arm(), [Scene(()) for _ in range(REMEMBERED + 1)]

    def sent(*parts):
        ours.send(*parts)
        return theirs.receive()

    first, scene = sent(arm, scenes[0])
    assert first is not arm
    np.testing.assert_array_equal(first.dh, arm.dh)
    for values in (first.dh, first.bounds):
        assert not values.flags.writeable
        assert values.flags.aligned
    assert sent(scenes[0], arm) == (scene, first)
    # What was sent long ago is sent anew, and nothing is mistaken for something else.
    others = [sent(other)[0] for other in scenes[1:]]
    (again,) = sent(arm)
    assert again is not first
    np.testing.assert_array_equal(again.dh, arm.dh)
    assert sent(*scenes[-9:]) == tuple(others[-9:])
    ours.line.close()


def test_one_that_dies_over_a_question_says_so_and_another_one_goes_on(process, said):
    killed = []

    def kill():
        if not killed:
            killed.append(process.pid)
            os.kill(process.pid, signal.SIGKILL)
        return False

    endless = RRTHOptions(max_samples=10**7, time_limit=3600.0)
    expected = 'the planning process ended with code -9 while working; another one is started'
    with pytest.raises(PlanningProcessError, match=expected):
        process.plan(question(scene=shut_in(), options=endless), kill)
    assert said[-1] == expected
    assert process.pid not in killed
    assert process.plan(question()).status is PlanStatus.SOLVED


def test_one_that_has_died_is_replaced_before_it_is_asked(process, said):
    before = process.pid
    os.kill(before, signal.SIGKILL)
    os.waitid(os.P_PID, before, os.WEXITED | os.WNOWAIT)
    assert process.plan(question()).status is PlanStatus.SOLVED
    assert 'ended with code -9 while idle' in said[-1]
    assert process.pid != before


def test_one_that_was_started_before_is_used():
    early = WorkerProcess()
    process = PlanningProcess(worlds.table_1_arm(), RRTHOptions(), worker=early)
    assert process.pid == early.pid
    assert process.plan(question()).status is PlanStatus.SOLVED
    process.close()
    assert not early.is_alive()


def test_one_that_finds_nothing_compiled_leaves_that_to_its_owner(monkeypatch, tmp_path):
    monkeypatch.setenv('RRTH_CACHE_DIR', str(tmp_path))
    early = WorkerProcess()
    # Its imports take less; compiling takes many times as long.
    time.sleep(3.0)
    assert early.is_alive()
    assert early.end() == 0
    assert not list(tmp_path.rglob('*.nbc'))


def test_ctrl_c_does_not_end_it(process):
    before = process.pid
    os.kill(before, signal.SIGINT)
    assert process.plan(question()).status is PlanStatus.SOLVED
    assert process.pid == before
    assert not signal.pthread_sigmask(signal.SIG_BLOCK, set())


def test_an_error_is_raised_here_with_where_it_was_raised_there(process):
    with pytest.raises(AttributeError) as caught:
        process.violation_seen(question().required, None, None, 0.0)
    assert isinstance(caught.value.__cause__, PlanningTraceback)
    assert 'trajectory_validation' in str(caught.value.__cause__)
    assert process.plan(question()).status is PlanStatus.SOLVED


def test_an_error_that_cannot_be_sent_becomes_a_sentence():
    class LocalError(Exception):
        pass

    def fail():
        raise LocalError('out of paper')

    ours, theirs = map(Channel, Pipe())
    Thread(target=worker.serve, args=(theirs, {'fail': fail}), daemon=True).start()
    ours.send(1, 'fail')
    _, raised = ours.receive()
    assert isinstance(raised.problem, RuntimeError)
    assert str(raised.problem) == 'LocalError: out of paper'
    ours.line.close()


def test_an_arm_that_cannot_point_is_rejected(process):
    turns = ArmModel(
        joint_names=('turn',),
        is_prismatic=(False,),
        dh=np.array([[0.0, 0.0, 0.0, 0.2], [0.5 * np.pi, 0.0, 0.0, 0.0]]),
        bounds=np.array([[-1.0], [1.0]]),
        radii=np.full(2, 0.01),
        T_base_mount=np.eye(4),
    )
    with pytest.raises(ModelError, match='expected 2: the ray sweeps a surface'):
        process.warm_up(turns, RRTHOptions())
    process.warm_up(worlds.table_1_arm(), RRTHOptions())


# No `if __name__ == '__main__'`: nobody asks a user for that.
OWNER = """
import sys, time
from rrth_planner.io.arm_file import load_arm
from rrth_planner.pipeline.planning_process import PlanningProcess
from rrth_planner.planning.options import RRTHOptions
process = PlanningProcess(load_arm(), RRTHOptions())
print(process.pid, flush=True)
time.sleep(600)
"""


def test_it_ends_with_its_owner_however_that_ends(tmp_path):
    script = tmp_path / 'owner.py'
    script.write_text(OWNER)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as owner:
        pid = int(owner.stdout.readline())
        assert Path(f'/proc/{pid}').exists()
        owner.kill()
        end = time.monotonic() + LONGEST_WAIT
        while Path(f'/proc/{pid}').exists():
            assert time.monotonic() < end
            time.sleep(0.05)
