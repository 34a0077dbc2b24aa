# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The judges of the soak catch what is planted for them."""

from collections import Counter
from dataclasses import replace
from multiprocessing import Pipe
import os
import re
import signal
import subprocess
import sys
import time

from hypothesis import given, strategies as st
import numpy as np
import pytest

pytest.importorskip('rclpy')
pytest.importorskip('tqdm')
pytest.importorskip('psutil')
pytest.importorskip('matplotlib')

from benchmarks.common.processors import lose_time_asleep, OnEachProcessor, stay_awake  # noqa: E402
from benchmarks.common.real_time import (  # noqa: E402
    give_way,
    is_real_time,
    put_ahead,
    scheduling,
    staying_off,
)
from benchmarks.common.standstill import StandstillWatch, united  # noqa: E402
from benchmarks.soak import __main__ as soak, contacts, flood as soak_flood, judge
from benchmarks.soak.body import (  # noqa: E402
    BodyAt,
    BodyStream,
    next_due,
    NO_HAND,
    RATE,
    scene_of_body,
    SPEED,
)
from benchmarks.soak.client import brakes_in  # noqa: E402
from benchmarks.soak.flood import FloodRecord  # noqa: E402
from benchmarks.soak.looks import Look, look_at, Loss, losses  # noqa: E402
from benchmarks.soak.monitor import MonitorRecord  # noqa: E402
from benchmarks.soak.people import judge_person, PersonRecord  # noqa: E402
from benchmarks.soak.plans import free_starts, PlansRecord  # noqa: E402
from benchmarks.soak.report import draw_memory, report  # noqa: E402
from benchmarks.soak.targets import monitor_targets, people_targets, plan_targets  # noqa: E402
import psutil  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rrth_planner.collision import reference_checker  # noqa: E402
from rrth_planner.model.scene import Box, Scene  # noqa: E402
from rrth_planner.model.trajectory import Trajectory  # noqa: E402
from rrth_planner.ros.messages.body_writer import body_to_msg  # noqa: E402
from rrth_planner.ros.messages.trajectory import joint_trajectory_to_msg  # noqa: E402
import worlds  # noqa: E402

ARM = worlds.table_1_arm()
BODY = BodyAt(0, -1, 0.0)
FLAT = [(0.1 * k, 290.0 + 0.001 * k) for k in range(1000)]


def swing(q_from, q_to):
    """Return a motion from rest to rest."""
    still = np.zeros((2, ARM.dof))
    return Trajectory(
        times=[0.0, 1.0], positions=[q_from, q_to], velocities=still, accelerations=still
    )


@pytest.fixture(scope='module')
def motion():
    """Return a short motion that is free of the body."""
    q = free_starts(np.random.default_rng(0), 1)[1][0]
    return swing(q, q + 0.01)


def hand_at(motion, time_share, side=0.05):
    """Return a hand at the tool of a motion."""
    q = motion.positions[0] + time_share * (motion.positions[-1] - motion.positions[0])
    tool = reference_checker.frames(ARM, q[None])[0, -1, :3, 3]
    return replace(BODY, hand=(*tool.tolist(), side))


def hand_behind(motion):
    """Return a hand right beside the ray, on the side that the motion turns it away from."""
    T = reference_checker.frames(ARM, motion.positions)[:, -1]
    now, later = T[:, :3, 3] + 0.5 * T[:, :3, 2]
    center = now + 0.045 * (now - later) / np.linalg.norm(now - later)
    return replace(BODY, hand=(*center.tolist(), 0.05))


BRAKES = '3, last 1.000 ms, p50 2.000 ms, p99 4.000 ms, at most 4.000 ms'
FIGURES = {'good messages, body': '7', 'rejected messages, body': '0', 'fail-safe stops': BRAKES}


def plans(**changes):
    """Return a record of plans without a fault."""
    record = PlansRecord(
        n_asked=2,
        codes=Counter(SUCCESS=2),
        calls=[0.01, 0.02],
        memory=FLAT,
        looks=[Look(1, 0.01, 7, 7)],
        gaps=[0.01],
        figures=FIGURES,
        n_sent=7,
        verdicts=Counter({(judge.FREE, False): 2}),
        n_motions=2,
        elapsed=100.0,
    )
    return replace(record, **changes)


def test_a_motion_that_collides_is_caught(motion):
    free, hit = scene_of_body(BODY), scene_of_body(hand_at(motion, 0.5))
    assert judge.verdict_on(ARM, [free, free], motion) == judge.FREE
    assert judge.verdict_on(ARM, [hit, hit, hit], motion) == judge.COLLIDES
    # Only the body before it may have been on its way.
    assert judge.verdict_on(ARM, [hit, free], motion) == judge.FREE
    assert judge.verdict_on(ARM, [hit, hit, free], motion) == judge.OLDER


def test_a_motion_within_the_margin_is_caught(motion):
    away = scene_of_body(BODY)
    clearance = reference_checker.least_clearance(
        ARM, away, judge.positions_of(motion, 1e-3), judge.RAY
    )
    margin = clearance + 0.005
    assert judge.verdict_on(ARM, [away, away], motion, margin=margin) == judge.NEAR
    assert judge.verdict_on(ARM, [away, away], motion, margin=0.5 * clearance) == judge.FREE


def test_a_motion_is_judged_by_its_bytes(motion):
    data = serialize_message(joint_trajectory_to_msg(motion, ARM.joint_names, 'torso', 5.0))
    hand = hand_at(motion, 0.5)
    for is_fine in (False, True):
        assert judge.judge_bytes((data, (BODY,), is_fine)) == (judge.FREE, True)
        assert judge.judge_bytes((data, (hand, hand), is_fine)) == (judge.COLLIDES, True)


def test_the_bodies_before_a_motion_are_found():
    assert judge.newest_before([10, 20, 30, 40], 35, 2) == [2, 1]
    assert judge.newest_before([10, 20, 30, 40], 15, 3) == [0]
    assert judge.newest_before([10, 20], 5, 3) == []


def test_bodies_of_a_tracker_that_was_late_keep_their_distance():
    period, late = 1.0 / RATE, 0.4
    assert next_due(5.0, 5.0005) == 5.0 + period
    assert next_due(5.0, 5.0 + late * period) == pytest.approx(5.0 + (1.0 + late) * period)
    assert next_due(5.0, 7.0) == 7.0 + period


def test_memory_that_grows_is_caught():
    # What is taken at first does not count.
    warm = [100.0 + 10.0 * min(k, 5) for k in range(100)]
    assert judge.growth_of(warm).growth == 0.0
    leaking = [290.0 + 0.01 * k for k in range(1000)]
    assert judge.growth_of(leaking).growth == pytest.approx(9.0)
    peak = [290.0] * 500 + [300.0] + [290.0] * 499
    assert judge.growth_of(peak).growth == pytest.approx(10.0)


def unmet(lines):
    """Return the targets that are not met."""
    return [line[0] for line in lines if line[-1] != 'yes']


def test_each_fault_misses_its_target():
    assert unmet(plan_targets(plans())) == []
    leaking = [(time, 290.0 + time) for time, _ in FLAT]
    for changes, word in (
        ({'n_unanswered': 1}, 'answer'),
        ({'verdicts': Counter({(judge.FREE, False): 1, (judge.COLLIDES, False): 1})}, 'free'),
        ({'verdicts': Counter({(judge.FREE, False): 1})}, 'free'),
        ({'n_sent': 8}, 'received'),
        ({'figures': FIGURES | {'rejected messages, body': '1'}}, 'received'),
        ({'figures': FIGURES | {'fail-safe stops': BRAKES.replace('p99 4', 'p99 6')}}, 'busy'),
        ({'figures': FIGURES | {'fail-safe stops': '0, last 0 ms, p50 0 ms, p99 0 ms'}}, 'busy'),
        ({'looks': [Look(1, 0.01, 7, 7), Look(2, 0.06, 7, 7)]}, 'age'),
        ({'looks': []}, 'age'),
        ({'memory': leaking}, 'memory'),
    ):
        (missed,) = unmet(plan_targets(plans(**changes)))
        assert word in missed


def test_the_report_says_how_old_the_bodies_before_a_bad_motion_were():
    bad = plans(suspects=[('stop: collides', 10**9, [0.0004, 0.0104])])
    assert '- stop: collides: published 0.4, 10.4 ms after the bodies before' in report(
        bad, None, ''
    )


def test_the_report_says_when_the_body_was_old_and_bodies_were_lost():
    still = united([(1_000_000_000, 1_600_000_000)], 10**10)
    looks = [
        Look(800_000_000, 0.005, 70, 71),
        Look(1_620_000_000, 0.625, 72, 150),
        Look(2_800_000_000, 0.01, 270, 272),
    ]
    late = plans(looks=looks, n_sent=301, figures=FIGURES | {'good messages, body': '299'})
    text = report(late, None, '', still=still)
    assert '- 1 messages of diagnostics said' in text
    assert '50 ms old or older, 1 of them only because the machine stalled' in text
    assert '- the body was' not in text
    assert '- bodies were lost: 1, between two messages of diagnostics (from 00:00:0' in text
    assert ' stalled for 600.0 of 820.0 ms)' in text
    running = report(late, None, '', still=united([(1_000_000_000, 1_570_000_000)], 10**10))
    assert 'older, 0 of them' in running
    assert 'on; the machine stalled for 570.0 of 625.0 ms)' in running
    assert '- the body was 625.0 ms old\n' in report(late, None, '')
    many = [replace(looks[1], age=0.1 + 0.001 * k) for k in range(30)]
    assert report(plans(looks=many), None, '').count('- the body was') == 10
    assert 'older, ' not in report(plans(), None, '')
    assert 'were lost' not in report(plans(), None, '')


@worlds.examples(100)
@given(gaps=st.lists(st.tuples(st.integers(1, 10**10), st.integers(1, 10**9)), max_size=60))
def test_the_longest_standstills_are_reported_with_their_time_of_day(gaps):
    times = np.cumsum(np.array(gaps, dtype=np.int64).reshape(-1)) + 86_399 * 10**9
    still = united(list(zip(times[::2].tolist(), times[1::2].tolist(), strict=True)), 10**12)
    text = report(plans(), None, '', still=still)
    rows = re.findall(r'^\| (\d\d):(\d\d):(\d\d)\.(\d{3}) \| ([\d.]+) \|$', text, re.M)
    assert ('## Standstills of the machine' in text) == bool(gaps)
    lengths = sorted((1e-6 * length for _, length in gaps), reverse=True)
    assert sorted((float(row[-1]) for row in rows), reverse=True) == pytest.approx(
        lengths[:40], abs=0.06
    )
    begins = [((int(h) * 60 + int(m)) * 60 + int(s)) * 1000 + int(ms) for h, m, s, ms, _ in rows]
    known = {begin // 10**6 % 86_400_000 for begin in times[::2].tolist()}
    assert set(begins) <= known
    order = [(begin - 86_399_000) % 86_400_000 for begin in begins]
    assert order == sorted(order)


@worlds.examples(100)
@given(
    steps=st.lists(
        st.tuples(st.integers(0, 5), st.integers(0, 2), st.integers(0, 3)), min_size=1, max_size=30
    )
)
def test_bodies_are_lost_when_they_are_never_heard(steps):
    # Of each step: bodies that were sent, how many of them got lost, how many are on their way.
    looks, sent, lost = [], 0, 0
    for k, (n, n_lost, n_coming) in enumerate(steps):
        sent += n
        lost += min(n, n_lost)
        looks.append(Look(k, 0.0, sent - lost - min(n_coming, sent - lost), sent))
    found = losses(looks, lost)
    assert sum(loss.n for loss in found) == lost
    missing = [look.n_sent - look.n_heard for look in looks]
    for k in range(len(looks) - 1):
        # What is seen to be there later is not lost.
        assert sum(loss.n for loss in found if loss.end <= k) == min(*missing[k:], lost)
    on_time = [replace(look, n_heard=look.n_sent) for look in looks]
    assert losses(on_time, 0) == []


def test_a_look_is_read_from_diagnostics():
    figures = FIGURES | {'age of body [s]': '0.012'}
    assert look_at(figures, 5, 9) == Look(5, 0.012, 7, 9)
    assert losses([look_at(figures, 5, 9)], 2) == [Loss(2, 5, 5)]
    assert losses([], 2) == []


def test_the_report_says_what_was_interrupted_and_has_its_picture(tmp_path):
    text = report(plans(is_interrupted=True), MonitorRecord(), 'some command')
    assert 'some command' in text
    assert 'Interrupted' in text
    assert 'Interrupted' not in report(plans(), None, '')
    draw_memory(FLAT, tmp_path)
    assert (tmp_path / 'memory.png').stat().st_size > 1000


def test_figures_of_the_guard_are_held_to_its_targets():
    figures = {
        'remaining motion checks': '9, last 1 ms, p50 0.200 ms, p99 1 ms, at most 2 ms',
        'fail-safe stops': BRAKES,
    }
    assert unmet(monitor_targets(MonitorRecord(figures=figures))) == []
    slow = {key: value.replace('p99 4', 'p99 6') for key, value in figures.items()}
    assert unmet(monitor_targets(MonitorRecord(figures=slow))) == [
        'body to fail-safe stop in the node, p99'
    ]
    hit = MonitorRecord(figures=figures, outcomes=Counter({contacts.HIT: 1}))
    assert len(unmet(monitor_targets(hit))) == 1


def episode(motion, body, **changes):
    """Return an episode of an arm that follows a motion in spite of a hand."""
    q = judge.positions_of(motion, 0.01)
    fields = {
        'body': body,
        'motion': motion,
        'phase': 0.0,
        'published': (),
        'followed': (),
        'times': np.arange(len(q)) * 10_000_000 - 1,
        'positions': q,
        'monitor': 'no motion',
    }
    return contacts.Episode(**(fields | changes))


def test_contacts_are_distinguished():
    q = free_starts(np.random.default_rng(0), 1)[1][0]
    long = swing(q, q + [0.0, 0.0, 0.0, 1.0])
    there, here = hand_at(long, 1.0), hand_at(long, 0.0)
    # The tool is turned on the spot: a hand there is put right onto it.
    assert contacts.PUT_ON in contacts.judge_episode(ARM, episode(long, here))
    far = swing(q, q + [0.8, 0.0, 0.0, 0.0])
    there = hand_at(far, 1.0)
    words = contacts.judge_episode(ARM, episode(far, there))
    assert words == (contacts.MISSED, contacts.HIT)
    # A stop that collides itself came too late; one that does not was not followed.
    for brake, word in ((far, contacts.TOO_LATE), (swing(q, q), contacts.HIT)):
        found = episode(far, there, published=((1, 2),), followed=(brake,))
        assert contacts.judge_episode(ARM, found)[-1] == word
        assert 'motions were published 0.0 ms after it; bar ' in contacts.sentence_on(ARM, found)
    # The ray turns out of a hand that is held beside it.
    turned = swing(q, q + [0.0, 0.0, 0.6, 0.0])
    words = contacts.judge_episode(ARM, episode(turned, hand_behind(turned)))
    assert words[0] == contacts.LED_AWAY
    free = episode(far, BODY)
    assert contacts.judge_episode(ARM, free) == (contacts.WENT_ON,)


def test_no_box_is_faster_than_it_may_be():
    times = np.linspace(0.0, 30.0, 3001)
    centers = np.array(
        [[b.center for b in scene_of_body(BodyAt(0, 1, t)).boxes] for t in times.tolist()]
    )
    speed = np.linalg.norm(np.diff(centers, axis=0), axis=2) / np.diff(times)[:, None]
    assert 0.9 * SPEED < speed.max() <= 1.001 * SPEED


def test_what_is_published_is_what_is_judged():
    sent = []
    stream = BodyStream(
        lambda msg: sent.append(
            [(m.text, m.action, m.pose.position.x, m.scale.x) for m in msg.markers]
        ),
        2,
    )
    with stream:
        body = stream.put((1.0, 2.0, 3.0, 0.1))
        scene, index = scene_of_body(body), stream.log.index(body)
        gone = stream.put(NO_HAND)
    assert sent[index] == [(b.name, 0, b.center[0], b.size[0]) for b in scene.boxes]
    assert len(scene_of_body(gone).boxes) == len(scene.boxes) - 1
    assert sent[stream.log.index(gone)][-1][:2] == ('hand', 2)


def test_the_command_says_what_is_missing(capsys):
    assert soak.main([], find=lambda name: None) == 2
    assert 'rclpy' in capsys.readouterr().err
    with pytest.raises(SystemExit):
        soak.main(['--plans', '-1'])


def test_moments_in_which_a_processor_stood_still_are_found():
    with StandstillWatch() as watch:
        begin = time.time_ns()
        os.kill(watch.pids[0], signal.SIGSTOP)
        time.sleep(0.2)
        os.kill(watch.pids[0], signal.SIGCONT)
        end = time.time_ns()
        time.sleep(0.1)
    found = watch.found
    assert found.within(begin, end) >= 190_000_000
    assert end - begin <= found.span
    assert (found.begins[1:] > found.ends[:-1]).all()
    assert 'at most' in found.sentence()


def test_processors_are_kept_awake_by_what_gives_way_to_all_others():
    with OnEachProcessor(stay_awake) as awake:
        pids = awake.pids
        # Never asleep, though it may be kept waiting by all that the machine does besides.
        for _ in range(50):
            assert {psutil.Process(pid).status() for pid in pids} == {psutil.STATUS_RUNNING}
            time.sleep(0.01)
        assert {os.sched_getscheduler(pid) for pid in pids} == {os.SCHED_IDLE}
        cores = [os.sched_getaffinity(pid) for pid in pids]
    assert sorted(core for one in cores for core in one) == sorted(os.sched_getaffinity(0))
    assert not any(psutil.pid_exists(pid) for pid in pids)
    assert awake.results == [None] * len(pids)


@pytest.mark.parametrize(
    ('cpuinfo', 'quota', 'is_so'),
    [
        ('flags : fpu hypervisor lm', None, True),
        ('flags : fpu hypervisor lm', 'max 100000', True),
        # What a container uses up by keeping awake its work has no more.
        ('flags : fpu hypervisor lm', '150000 100000', False),
        ('flags : fpu lm', None, False),
        (None, None, False),
    ],
)
def test_processors_are_kept_awake_where_their_host_takes_them_away(
    tmp_path, cpuinfo, quota, is_so
):
    files = {tmp_path / 'cpuinfo': cpuinfo, tmp_path / 'cpu.max': quota}
    for file, text in files.items():
        if text is not None:
            file.write_text(text)
    assert lose_time_asleep(*files) is is_so


def test_where_idle_priority_is_rejected_nothing_is_kept_awake(monkeypatch):
    def reject(*_):
        raise PermissionError

    monkeypatch.setattr(os, 'sched_setscheduler', reject)
    ours, theirs = Pipe()
    # It would not return otherwise: nobody ends it.
    assert stay_awake(theirs) is None
    # Whoever entered waits for that.
    assert ours.recv() is None


def test_moments_of_several_processors_are_united():
    found = united([(50, 60), (10, 20), (15, 30), (16, 18), (30, 31)], 100)
    assert found.begins.tolist() == [10, 50]
    assert found.ends.tolist() == [31, 60]
    assert found.within(0, 100) == 31
    assert found.within(25, 55) == 11
    assert found.within(31, 50) == 0
    assert '31.00 %' in found.sentence()
    nothing = united([], 100)
    assert nothing.within(0, 100) == 0
    assert '0 times' in nothing.sentence()


def test_a_brake_is_read_from_the_log():
    line = 'WARN: the remaining motion is not proven free of the wearer: '
    told = 'fail-safe stop, at rest in 0.12 s; published after 20.50 ms'
    before = time.time_ns()
    ((came, took),) = brakes_in(line + told)
    assert took == 20.5
    assert before <= came + 20_500_000 <= time.time_ns()
    assert brakes_in(line + told.replace('; published', '; the stop is not proven; published'))
    assert brakes_in(line + 'motion continues') == []


def test_brakes_are_judged_apart_where_the_machine_ran():
    figures = {'remaining motion checks': 'p50 0.2 ms', 'fail-safe stops': BRAKES}
    ms = 1_000_000
    still = united([(1003 * ms, 1020 * ms)], 10**10)
    quick = [(100 * k * ms, 3.0) for k in range(20, 120)]
    # Slow since the machine stood still, and slow though it ran.
    for slow, is_met in (((1000 * ms, 21.0), True), ((1500 * ms, 21.0), False)):
        monitor = MonitorRecord(figures=figures, brakes=[*quick[:50], slow])
        some = plans(brakes=[*quick[50:], slow])
        text = report(some, monitor, '', still=still)
        (line,) = [line for line in text.splitlines() if 'in either part' in line]
        n, p99 = (100, '3.00') if is_met else (102, '21.00')
        assert f'{p99} ms, {n} of 102 times' in line
        assert ('**no**' in line) != is_met
    assert 'in either part' not in report(plans(), MonitorRecord(), '', still=still)
    suspects = [(contacts.MISSED, 1000 * ms, 'it came soon')]
    text = report(None, MonitorRecord(figures=figures, suspects=suspects), '', still=still)
    assert '- not stopped, though the remaining motion violated the margin: it came soon (' in text
    assert 'stalled for 17.0 of 1000.0 ms' in text
    bad = plans(suspects=[('collides', 1010 * ms, [0.001, 0.011, 0.5])])
    assert 'stalled for 7.0 of 11.0 ms' in report(bad, None, '', still=still)


@pytest.mark.parametrize('kind', [os.SCHED_RR, os.SCHED_FIFO, os.SCHED_OTHER])
def test_the_client_gives_way_to_what_it_measures_in_real_time(monkeypatch, kind):
    put = []
    monkeypatch.setattr(os, 'sched_getscheduler', lambda _: kind)
    # A thread of the planner stands back of the others, and goes on to do so.
    priorities = {0: 10, 7: 10, 8: 9, 9: 0}
    monkeypatch.setattr(os, 'sched_getparam', lambda k: os.sched_param(priorities[k]))
    monkeypatch.setattr(
        os, 'sched_setscheduler', lambda *given: put.append((*given[:2], given[2].sched_priority))
    )
    put_ahead(7, 8)
    put_ahead(9, by=2)
    is_ordinary = kind == os.SCHED_OTHER
    assert put == ([] if is_ordinary else [(7, kind, 11), (8, kind, 10), (9, kind, 12)])
    give_way()
    assert put[-1] == (0, os.SCHED_OTHER, 0)
    assert is_real_time() != is_ordinary
    assert ('in real time' in scheduling()) != is_ordinary


def test_a_node_may_have_a_processor_for_itself():
    known = sorted(os.sched_getaffinity(0))
    if len(known) < 2:
        pytest.skip('a single processor')
    *others, last = known
    sleep = [sys.executable, '-c', 'input()']
    with (
        subprocess.Popen(sleep, stdin=subprocess.PIPE) as node,
        subprocess.Popen(sleep, stdin=subprocess.PIPE) as aside,
    ):
        try:
            with staying_off([node.pid], [aside.pid]):
                assert os.sched_getaffinity(node.pid) == {last}
                for pid in (0, aside.pid):
                    assert os.sched_getaffinity(pid) == set(others)
            assert os.sched_getaffinity(0) == set(known)
            # Of a single one nobody stays off.
            os.sched_setaffinity(0, {last})
            with staying_off([node.pid]):
                assert os.sched_getaffinity(node.pid) == os.sched_getaffinity(0) == {last}
        finally:
            os.sched_setaffinity(0, known)
            for process in (node, aside):
                process.kill()


@pytest.mark.parametrize(
    ('calls', 'n_unanswered', 'is_met'),
    [([0.05] * 9, 0, True), ([0.05] * 9, 1, False), ([0.2] * 9, 0, False), ([], 0, False)],
)
def test_answers_under_a_flood_are_held_to_their_target(calls, n_unanswered, is_met):
    floods = [
        FloodRecord('body_boxes', 2000.0, [0.01] * 9),
        FloodRecord('target', 2000.0, calls, n_unanswered),
    ]
    text = report(None, None, '', floods=floods)
    (line,) = [line for line in text.splitlines() if 'while any topic is flooded' in line]
    assert ('**no**' in line) != is_met
    assert '| body_boxes | 2000 | 10.00 |' in text


@pytest.mark.slow
def test_requests_under_a_flood_are_timed(tmp_path):
    floods = soak_flood.soak_floods(2, tmp_path)
    assert [flood.topic for flood in floods] == ['body_boxes', 'joint_states', 'target']
    assert all(len(flood.calls) == 2 and flood.rate > 0.0 for flood in floods)


def person_bodies(*boxes):
    """Return a body as a tracker publishes it at 10 s."""
    msg = body_to_msg(Scene(boxes), 'torso')
    for marker in msg.markers:
        marker.header.stamp.sec = 10
    return [serialize_message(msg)]


def test_contacts_and_crossings_of_a_person_are_counted_while_the_arm_moves():
    q = np.array([0.0, -0.35, np.pi / 2, np.pi / 2])
    T = reference_checker.frames(ARM, q[None])[0, -1]
    far = Box('far', [0.0, 0.0, -9.0], np.full(3, 0.1), np.eye(3))
    on_arm = Box('head', T[:3, 3], np.full(3, 0.05), np.eye(3))
    in_ray = Box('hand', T[:3, 3] + 0.5 * T[:3, 2], np.full(3, 0.05), np.eye(3))
    times = [10_010_000_000 + 10_000_000 * k for k in range(11)]
    for box, speed, n_contacts, crossed in (
        (far, 1.0, 0, 0.0),
        (on_arm, 1.0, 1, 0.1),
        (on_arm, 0.0, 0, 0.0),
        (in_ray, 1.0, 0, 0.1),
        (in_ray, 0.0, 0, 0.0),
    ):
        record = PersonRecord('someone', 1.0)
        states = [(then, q.tolist(), [speed, 0.0, 0.0, 0.0]) for then in times]
        judge_person(record, person_bodies(box), states)
        assert record.n_contacts == len(record.contacts) == n_contacts
        assert record.ray_seconds == pytest.approx(crossed)


def test_targets_of_recorded_people_are_met_or_not():
    good = PersonRecord('a', 1.0, seconds=40.0, n_requests=20, n_aimed=19, ray_seconds=0.04)
    assert [line[-1] for line in people_targets([good])] == ['yes'] * 3
    bad = PersonRecord('b', 1.5, 40.0, 20, 18, n_contacts=1, ray_seconds=0.07, contacts=['so'])
    assert [line[-1] for line in people_targets([bad])] == ['**no**'] * 3
    assert [line[-1] for line in people_targets([PersonRecord('c', 1.0)])][2] == '**no**'
    text = report(None, None, 'command', people=[good, bad])
    assert '## Recorded people' in text
    assert '- b, so' in text
