# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Part two of the soak: a hand is placed in the path of running motions."""

from collections import Counter
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
import sys
import time

import numpy as np
from rclpy.serialization import deserialize_message
from rrth_planner.collision.reference_checker import bars
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arm import ArmModel
from rrth_planner.model.arrays import Array
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from tqdm import tqdm
from trajectory_msgs.msg import JointTrajectory

from benchmarks.common.client import ros_client
from benchmarks.common.random_draws import random_target
from benchmarks.common.real_time import put_ahead, staying_off
from benchmarks.soak.body import BodyStream, NO_HAND
from benchmarks.soak.client import brakes_in, Published, SoakClient, threads_of
from benchmarks.soak.contacts import Episode, HIT, judge_episode, MISSED, sentence_on
from benchmarks.soak.judge import RAY

PLANNER, PLAYBACK = (f'rrth_planner.ros.{name}_node' for name in ('planner', 'playback'))
# The monitor is what is judged: with separation the arm mostly does not come near enough.
ARGUMENTS = ['--ros-args', '-p', 'seed:=7', '-p', 'separation:=false']
# A hand that is deleted is really gone.
FORGETFUL = [*ARGUMENTS, '-p', 'keep_lost:=0.0']
# When within a motion the hand comes, how far ahead of the arm [s], and its size [m].
SHARE, LEAD, SIDE = (0.05, 0.7), (0.05, 1.5), (0.05, 0.15)
# A place that the arm moves so far to is in the way [m]; places that are tried.
WAY, PLACES = 0.1, 40
SHORTEST, LONGEST, SETTLE = 0.4, 12.0, 0.25
# So many rejections in a row, and the arm counts as stuck.
STUCK = 100


@dataclass(slots=True)
class MonitorRecord:
    """
    What was recorded of the monitor.

    Parameters
    ----------
    n_motions, n_rejected : int
        That began, and requests that were rejected.
    episodes : list of Episode
        A hand each.
    outcomes : Counter
        Of the words of `judge_episode`, and of how the motions went on.
    suspects : list of (str, int, str)
        Of each hand that was missed or hit though it need not be: the word, when it came
        [ns], and `sentence_on` it.
    brakes : list of (int, float)
        As from `brakes_in`.
    said : Counter
        What the logs of both nodes say of stops that are not proven free and of rejections.
    figures : dict
        The last diagnostics.
    is_interrupted : bool
    stuck : str
        Why no request was answered with a motion any more; empty: they were.

    """

    n_motions: int = 0
    n_rejected: int = 0
    episodes: list[Episode] = field(default_factory=list)
    outcomes: Counter = field(default_factory=Counter)
    suspects: list[tuple[str, int, str]] = field(default_factory=list)
    brakes: list[tuple[int, float]] = field(default_factory=list)
    said: Counter = field(default_factory=Counter)
    figures: dict[str, str] = field(default_factory=dict)
    is_interrupted: bool = False
    stuck: str = ''


def soak_monitor(
    n: int, longest: float, folder: Path, seed: int = 1, is_alone: bool = False
) -> MonitorRecord:
    """
    Return what was recorded of the monitor within a time [s], with a hand for each of n motions.

    Where it is alone the planner has a processor for itself.
    """
    record = MonitorRecord()

    def listen(line: str) -> None:
        record.brakes += brakes_in(line)
        if 'not proven free either' in line:
            record.said['stop not proven free'] += 1
        if 'motion continues' in line:
            record.said['continuing escaped, a stop would not'] += 1
        if 'joint_trajectory rejected' in line:
            record.said['motions that the playback rejected'] += 1

    with (
        ros_client(lambda: SoakClient(folder)) as client,
        ChildProcess(PLANNER, FORGETFUL, listen) as one,
        ChildProcess(PLAYBACK, [], listen) as other,
    ):
        client.listen_to_states()
        client.wait_for_service(one)
        client.hear(30.0, lambda: client.states)
        put_ahead(*threads_of(PLANNER), *threads_of(PLAYBACK))
        with (
            staying_off(threads_of(PLANNER), threads_of(PLAYBACK)) if is_alone else nullcontext(),
            BodyStream(client.stream.publish, -1) as bodies,
        ):
            client.hear(1.0)
            try:
                _run(client, bodies, record, n, longest, seed, (one, other))
            except KeyboardInterrupt:
                record.is_interrupted = True
            client.hear(1.5)
        record.figures = client.figures
    client.close()
    for episode in record.episodes:
        words = judge_episode(load_arm(), episode)
        record.outcomes.update(words)
        for word in {MISSED, HIT}.intersection(words):
            sentence = sentence_on(load_arm(), episode)
            record.suspects.append((word, episode.body.sent, sentence))
    return record


def _run(
    client: SoakClient,
    bodies: BodyStream,
    record: MonitorRecord,
    n: int,
    longest: float,
    seed: int,
    children: tuple[ChildProcess, ...],
) -> None:
    rng, end = np.random.default_rng(seed), time.monotonic() + longest
    rejected = 0
    with tqdm(total=n, unit='hand', file=sys.stderr, mininterval=2.0) as bar:
        while len(record.episodes) < n and time.monotonic() < end:
            for child in children:
                child.check()
            client.motions.clear()
            client.states = client.states[-20:]
            client.publish_target(random_target(rng))
            _, answer = client.question()
            if answer is None or not answer.success:
                record.n_rejected += 1
                record.said[f'requests answered {answer and answer.message.split(" ")[0]}'] += 1
                rejected += 1
                if rejected == STUCK:
                    record.stuck = answer.message if answer else 'no answer'
                    return
                client.hear(0.02)
                continue
            rejected = 0
            record.n_motions += 1
            client.hear(1.0, lambda: client.motions)
            motion = client.motions[-1]
            trajectory = _trajectory(client, motion)
            if trajectory.duration >= SHORTEST:
                record.episodes.append(_episode(client, bodies, rng, motion, trajectory))
                bar.update()
            _wait_for_rest(client)


def _episode(
    client: SoakClient,
    bodies: BodyStream,
    rng: np.random.Generator,
    motion: Published,
    trajectory: Trajectory,
) -> Episode:
    """Place a hand in the path of a motion that has begun; return what happened."""
    arm = load_arm()
    client.hear(rng.uniform(*SHARE) * trajectory.duration)
    phase = (time.time_ns() - motion.published) * 1e-9
    put = bodies.put(_in_the_way(arm, rng, trajectory, phase))
    n_before = len(client.motions)
    _wait_for_rest(client)
    found = client.motions[n_before:]
    # What was published before the hand is no answer to it.
    found = [m for m in found if m.published > put.sent]
    states = [s for s in client.states if s[0] > put.sent - 50_000_000]
    bodies.put(NO_HAND)
    client.hear(0.03)
    return Episode(
        body=put,
        motion=trajectory,
        phase=(put.sent - motion.published) * 1e-9,
        published=tuple((m.published, m.received) for m in found),
        followed=tuple(_trajectory(client, m) for m in found),
        times=np.array([s[0] for s in states]),
        positions=np.array([s[1] for s in states]),
        monitor=client.figures['monitor'],
    )


def _in_the_way(
    arm: ArmModel, rng: np.random.Generator, trajectory: Trajectory, phase: float
) -> tuple[float, float, float, float]:
    """Return a hand at a point that a bar of the arm or its ray comes to."""
    ahead = min(phase + rng.uniform(*LEAD), trajectory.duration)
    now, then = bars(arm, sample(trajectory, [phase, ahead])[0], RAY)
    k, share = rng.integers(len(now), size=PLACES), rng.uniform(size=(PLACES, 1))
    before, after = (b[k, 0] + share * (b[k, 1] - b[k, 0]) for b in (now, then))
    moved = np.linalg.norm(after - before, axis=1)
    good = np.flatnonzero(moved > WAY)
    place: Array = after[good[0] if len(good) else moved.argmax()]
    x, y, z = place.tolist()
    return x, y, z, float(rng.uniform(*SIDE))


def _wait_for_rest(client: SoakClient) -> None:
    """Return when the arm is at rest and nothing is monitored any more."""
    client.hear(SETTLE)

    def is_over() -> bool:
        speed = max(map(abs, client.states[-1][2]))
        return speed == 0.0 and client.figures['monitor'] in ('no motion', 'holding')

    client.hear(LONGEST, is_over)


def _trajectory(client: SoakClient, motion: Published) -> Trajectory:
    msg = deserialize_message(client.bytes_of(motion), JointTrajectory)
    return joint_trajectory_from_msg(msg, load_arm().joint_names)
