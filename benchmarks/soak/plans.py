# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Part one of the soak: plan after plan from anywhere to anywhere, round a body that moves."""

from collections import Counter
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
import sys
import time

import numpy as np
from rrth_planner.collision.world import arm_world
from rrth_planner.io.arm_file import load_arm
from rrth_planner.model.arrays import Array
from rrth_planner.ros.middleware.child_process import ChildProcess
from tqdm import tqdm

from benchmarks.common.client import ros_client
from benchmarks.common.random_draws import random_target
from benchmarks.common.real_time import give_way, put_ahead, staying_off
from benchmarks.soak.body import BodyAt, BodyStream, scene_of_body, SWAY
from benchmarks.soak.client import brakes_in, process_of, SoakClient, threads_of
from benchmarks.soak.judge import EACH, FREE, judge_bytes, MARGIN, name_of, newest_before, RAY
from benchmarks.soak.looks import Look, look_at

NODE = 'rrth_planner.ros.planner_node'
# The arm of this part stands where it is said to: a brake is not followed by another plan. Whole
# motions are judged, which are published without separation.
ARGUMENTS = ['--ros-args', '-p', 'seed:=7', '-p', 'replan:=false', '-p', 'separation:=false']
ARGUMENTS += ['--log-level', 'warn']
# Plans round one wearer, fewest starts of so many drawn, plans between looks at the memory.
PER_WEARER, STARTS, DRAWS, SAMPLE = 1000, 30, 2000, 20
# Bodies before a motion that it may have been planned round.
LOOKED_AT = 6
# A new wearer has been heard, and the last messages have come [s].
SETTLE, LAST = 0.1, 1.5
# Between two looks at the progress [s].
PROGRESS = 2.0
# One target in so many is so near to the torso's centre that it may be out of reach [m].
NEAR_EACH, NEAR = 10, (0.1, 0.5)


@dataclass(slots=True)
class PlansRecord:
    """
    What was seen of the plans.

    Parameters
    ----------
    n_asked, n_unanswered : int
    codes : Counter
        How often each code was answered.
    examples : dict
        The last answer of each code.
    calls : list of float
        How long the answers took [s].
    memory : list of (float, float)
        Time since the begin [s], and resident memory of the node [MB].
    looks : list of Look
        At the body, by the node's diagnostics.
    gaps : list of float
        Between two bodies of this client [s].
    figures : dict
        The last diagnostics.
    n_sent : int
        Bodies.
    verdicts : Counter
        Of (verdict, whether it is a brake).
    suspects : list of (str, int, list of float)
        Of each motion that is not free of the body: the verdict, when it was published [ns], and
        how long before that the bodies were sent, the newest first [s].
    n_motions : int
        That were published.
    brakes : list of (int, float)
        As from `brakes_in`.
    elapsed : float
        [s].
    is_interrupted : bool

    """

    n_asked: int = 0
    n_unanswered: int = 0
    codes: Counter = field(default_factory=Counter)
    examples: dict[str, str] = field(default_factory=dict)
    calls: list[float] = field(default_factory=list)
    memory: list[tuple[float, float]] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)
    gaps: list[float] = field(default_factory=list)
    figures: dict[str, str] = field(default_factory=dict)
    n_sent: int = 0
    verdicts: Counter = field(default_factory=Counter)
    suspects: list[tuple[str, int, list[float]]] = field(default_factory=list)
    n_motions: int = 0
    brakes: list[tuple[int, float]] = field(default_factory=list)
    elapsed: float = 0.0
    is_interrupted: bool = False


def soak_plans(
    n: int, longest: float, folder: Path, seed: int = 1, is_alone: bool = False
) -> PlansRecord:
    """
    Return what was seen of some plans, each published motion judged.

    Parameters
    ----------
    n : int
        Plans.
    longest : float
        Time after which no more is asked [s].
    folder : Path
        For what is kept until it is judged.
    seed : int
    is_alone : bool
        Whether the node has a processor for itself.

    """
    record = PlansRecord()
    with (
        ros_client(lambda: SoakClient(folder)) as client,
        ChildProcess(NODE, ARGUMENTS, lambda line: record.brakes.extend(brakes_in(line))) as child,
    ):
        client.wait_for_service(child)
        put_ahead(*threads_of(NODE))
        with (
            staying_off(threads_of(NODE)) if is_alone else nullcontext(),
            BodyStream(client.stream.publish, 1) as bodies,
        ):
            client.hear(2.0)
            client.on_figures = lambda figures: record.looks.append(
                look_at(figures, time.time_ns(), len(bodies.log))
            )
            try:
                _ask(client, child, bodies, record, n, longest, seed)
            except KeyboardInterrupt:
                record.is_interrupted = True
            client.on_figures = lambda _: None
        client.hear(LAST)
        record.figures, record.n_sent = client.figures, len(bodies.log)
    record.gaps = (np.diff([body.sent for body in bodies.log]) * 1e-9).tolist()
    record.n_motions = len(client.motions)
    try:
        judge_all(client, bodies.log, record.verdicts, record.suspects)
    except KeyboardInterrupt:
        record.is_interrupted = True
    client.close()
    return record


def _ask(
    client: SoakClient,
    child: ChildProcess,
    bodies: BodyStream,
    record: PlansRecord,
    n: int,
    longest: float,
    seed: int,
) -> None:
    rng, arm, process = np.random.default_rng(seed), load_arm(), process_of(NODE)
    begin = time.perf_counter()
    wearer, starts = 0, np.empty((0, arm.dof))
    with tqdm(total=n, unit='plan', file=sys.stderr, mininterval=PROGRESS) as bar:
        while record.n_asked < n and record.elapsed < longest:
            if record.n_asked % PER_WEARER == 0:
                wearer, starts = free_starts(rng, wearer + 1)
                bodies.change(wearer)
                client.hear(SETTLE)
            q = starts[rng.integers(len(starts))]
            client.publish_start(arm.joint_names, q, _target(rng, record.n_asked))
            elapsed, answer = client.question()
            child.check()
            record.n_asked += 1
            if answer is None:
                record.n_unanswered += 1
            else:
                code = answer.message.split(' ')[0]
                record.codes[code] += 1
                record.examples[code] = answer.message
                record.calls.append(elapsed)
            record.elapsed = time.perf_counter() - begin
            if record.n_asked % SAMPLE == 0:
                record.memory.append((record.elapsed, process.memory_info().rss / 2**20))
            bar.update()


def _target(rng: np.random.Generator, k: int) -> Array:
    target = random_target(rng)
    if k % NEAR_EACH == 0:
        target *= rng.uniform(*NEAR) / np.linalg.norm(target)
    return target


def free_starts(rng: np.random.Generator, wearer: int) -> tuple[int, Array]:
    """
    Return the next wearer who leaves the arm some room, and configurations that are free of him.

    They are free wherever he sways, shape (n, dof) [rad].
    """
    while True:
        scene = scene_of_body(BodyAt(0, -wearer, 0.0))
        world = arm_world(load_arm(), scene, MARGIN + 2.0 * SWAY, RAY)
        drawn = rng.uniform(*world.bounds, (DRAWS, len(world.bounds[0])))
        found = [q for q in drawn if world.is_valid(q)]
        if len(found) >= STARTS:
            return wearer, np.array(found)
        wearer += 1


def judge_all(
    client: SoakClient,
    log: list[BodyAt],
    verdicts: Counter,
    suspects: list[tuple[str, int, list[float]]],
) -> None:
    """Judge every motion against the bodies before it, in all processors."""
    from multiprocessing import get_context

    sent = [body.sent for body in log]

    def tasks():
        for k, motion in enumerate(client.motions):
            before = newest_before(sent, motion.published, LOOKED_AT + 1)
            yield client.bytes_of(motion), tuple(log[i] for i in before), k % EACH == 0

    progress = {'desc': 'judged', 'file': sys.stderr, 'mininterval': PROGRESS}
    with (
        get_context('spawn').Pool(initializer=give_way) as pool,
        tqdm(total=len(client.motions), unit='motion', **progress) as bar,
    ):
        words = pool.imap(judge_bytes, tasks(), chunksize=20)
        for motion, word in zip(client.motions, words, strict=True):
            verdicts[word] += 1
            if word[0] != FREE:
                before = newest_before(sent, motion.published, LOOKED_AT + 1)
                ages = [1e-9 * (motion.published - sent[i]) for i in before]
                suspects.append((name_of(word), motion.published, ages))
            bar.update()
