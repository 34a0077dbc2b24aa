# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Part three of the soak: recorded people wear the arm, which is asked for target after target."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from rrth_planner.collision.reference_checker import bar_box_contact, bar_radii, bars
from rrth_planner.io.arm_file import load_arm
from rrth_planner.kernels.layout import ROTATION, SIZE
from rrth_planner.model.arm import pointing_error
from rrth_planner.model.scene import Scene
from rrth_planner.model.stamp import NANOSECONDS
from rrth_planner.ros.messages.body import scene_of, WearerBody
from rrth_planner.ros.messages.fields import nanoseconds_of
from rrth_planner.ros.middleware.child_process import ChildProcess
from tqdm import tqdm
from visualization_msgs.msg import MarkerArray

from benchmarks.common.client import FRAME, ros_client
from benchmarks.soak.client import brakes_in, SoakClient
from benchmarks.soak.judge import RAY
from benchmarks.soak.monitor import ARGUMENTS, PLANNER, PLAYBACK

WEARER = 'rrth_planner.cli.wearer'
# Targets low in front of the wearer, where his hands work: lower and upper corner [m].
LOW_IN_FRONT = np.array([[0.8, -0.6, -0.6], [1.6, 0.6, 0.0]])
# An arm that aims this near to its target has arrived [m]; a request has so long for that [s].
AIMS, PATIENCE = 0.02, 6.0
# A slower arm is at rest [rad/s].
REST = 1e-3
# A tracker publishes so often [1/s]; recordings begin with a T-pose of so long [s].
FPS, T_POSE = 60, 0.1
# The recording of the package is played at these rates.
RATES = (1.0, 1.5)


@dataclass(slots=True)
class PersonRecord:
    """
    What was seen of an arm on a recorded person.

    Parameters
    ----------
    name : str
        Of the recording.
    rate : float
        How fast it was played.
    seconds : float
        How long [s].
    n_requests, n_aimed : int
        Targets asked for; those that the arm aimed at in time.
    answers : Counter
        Of the codes of the answers, and of what followed a success.
    n_contacts : int
        Times at which the arm, in motion, came into contact with a box as recorded.
    contacts : list of str
        When, which bar and which box.
    ray_seconds : float
        How long the pointing ray of the arm in motion crossed a box [s].
    brakes : list of float
        How long after its body each fail-safe stop was published [ms].
    is_interrupted : bool

    """

    name: str
    rate: float
    seconds: float = 0.0
    n_requests: int = 0
    n_aimed: int = 0
    answers: Counter = field(default_factory=Counter)
    n_contacts: int = 0
    contacts: list[str] = field(default_factory=list)
    ray_seconds: float = 0.0
    brakes: list[float] = field(default_factory=list)
    is_interrupted: bool = False


def soak_people(recordings: Sequence[Path], seconds: float, folder: Path) -> list[PersonRecord]:
    """Return what was seen of an arm on the person of the package, and on recorded ones."""
    cases = [(None, rate) for rate in RATES] + [(file, 1.0) for file in recordings]
    records: list[PersonRecord] = []
    for seed, (file, rate) in enumerate(cases):
        records.append(soak_person(file, rate, seconds, folder, seed))
        if records[-1].is_interrupted:
            break
    return records


class PeopleClient(SoakClient):
    """A client that also keeps what the tracker publishes."""

    def __init__(self, folder: Path) -> None:
        """Subscribe to bodies, which are read later."""
        super().__init__(folder)
        self.bodies: list[bytes] = []
        self.create_subscription(MarkerArray, 'body_boxes', self.bodies.append, 10, raw=True)


def soak_person(
    file: Path | None, rate: float, seconds: float, folder: Path, seed: int = 1
) -> PersonRecord:
    """
    Return what was seen of an arm on a recorded person for a time [s].

    file: the recording; None for that of the package. rate: how fast it is played, back and forth.
    """
    record = PersonRecord('construction work' if file is None else file.stem, rate)
    begin = 0.0 if file is None else T_POSE
    options = ['--rate', f'{rate:g}', '--fps', f'{FPS}', '--begin', f'{begin:g}']
    options += ['--skeleton', 'tum_bvh' if file is not None and 'tum' in file.stem else 'cmu_bvh']

    def listen(line: str) -> None:
        record.brakes += [took for _, took in brakes_in(line)]

    with (
        ros_client(lambda: PeopleClient(folder)) as client,
        ChildProcess(PLANNER, ARGUMENTS, listen) as one,
        ChildProcess(PLAYBACK, [], lambda _: None) as other,
        ChildProcess(
            WEARER, [*([] if file is None else [str(file)]), *options], lambda _: None
        ) as wearer,
    ):
        client.listen_to_states()
        client.wait_for_service(one)
        client.hear(30.0, lambda: client.states and client.bodies)
        try:
            _ask(client, record, seconds, seed, (one, other, wearer))
        except KeyboardInterrupt:
            record.is_interrupted = True
    client.close()
    judge_person(record, client.bodies, client.states)
    return record


def _ask(
    client: PeopleClient,
    record: PersonRecord,
    seconds: float,
    seed: int,
    children: tuple[ChildProcess, ...],
) -> None:
    """Ask for one target after the other."""
    arm, rng = load_arm(), np.random.default_rng(seed)
    begin = time.monotonic()
    with tqdm(total=round(seconds), unit='s', desc=record.name, file=sys.stderr) as bar:
        while (passed := time.monotonic() - begin) < seconds:
            bar.update(int(passed) - bar.n)
            for child in children:
                child.check()
            target = rng.uniform(*LOW_IN_FRONT)
            client.publish_target(target)
            asked = time.monotonic()
            _, answer = client.question()
            record.n_requests += 1
            word = 'no answer' if answer is None else answer.message.partition(' ')[0]
            if answer is not None and answer.success:

                def aims(target: np.ndarray = target) -> bool:
                    _, q, v = client.states[-1]
                    is_at_rest = max(map(abs, v)) < REST
                    return is_at_rest and pointing_error(arm, np.array(q), target) < AIMS

                if client.hear(PATIENCE - (time.monotonic() - asked), aims):
                    record.n_aimed += 1
                else:
                    word += f', then {client.figures.get("last code", "")}'
            record.answers[word] += 1
            client.hear(0.02)
        record.seconds = time.monotonic() - begin


def judge_person(
    record: PersonRecord, bodies: Sequence[bytes], states: Sequence[tuple[int, Any, Any]]
) -> None:
    """
    Count contacts and crossings of the ray at each state of the arm, by the body of that time.

    bodies: serialized MarkerArrays, with stamps. states: when each was sent [ns], positions and
    velocities.
    """
    arm, body = load_arm(), WearerBody()
    scenes: list[tuple[int, Scene]] = []
    for data in bodies:
        msg = deserialize_message(data, MarkerArray)
        stamp = nanoseconds_of(msg.markers[-1].header.stamp)
        body = body.apply(msg, stamp / NANOSECONDS, FRAME)
        scenes.append((stamp, scene_of(body)))
    scenes.sort(key=lambda item: item[0])
    stamps = np.array([stamp for stamp, _ in scenes])
    ends, radii = bars(arm, np.array([q for _, q, _ in states]), RAY), bar_radii(arm)
    was_in, before = False, None
    for (sent, _, v), places in zip(states, ends, strict=True):
        k = int(np.searchsorted(stamps, sent)) - 1
        is_moving = max(map(abs, v)) >= REST
        if k < 0 or not is_moving:
            was_in, before = False, sent
            continue
        hits = _hits(places, radii, scenes[k][1])
        # The last one is the ray.
        found = np.argwhere(hits[:-1])
        if len(found) and not was_in:
            bar, box = found[0]
            record.n_contacts += 1
            record.contacts.append(
                f'{(sent - stamps[0]) * 1e-9:.2f} s: bar {bar} and box '
                f'"{scenes[k][1].boxes[box].name}"'
            )
        was_in = bool(len(found))
        if hits.any() and before is not None:
            record.ray_seconds += min(0.05, (sent - before) * 1e-9)
        before = sent


def _hits(places: np.ndarray, radii: np.ndarray, scene: Scene) -> np.ndarray:
    """Return which bars (n_bars, 2, 3) are in contact with which boxes, (n_bars, m)."""
    boxes = scene.numbers
    half = 0.5 * boxes[:, SIZE:ROTATION] + radii[:, None, None]
    rotations = boxes[:, ROTATION:].reshape(-1, 3, 3)
    return bar_box_contact(places[:, None], boxes[:, None, :SIZE], rotations, half)
