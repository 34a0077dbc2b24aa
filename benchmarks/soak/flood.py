# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Part three of the soak: requests while another process floods a topic."""

from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
import sys
import time

import numpy as np
from rrth_planner.io.arm_file import load_arm
from rrth_planner.ros.middleware.child_process import ChildProcess
from tqdm import tqdm

from benchmarks.common.client import ros_client
from benchmarks.common.flood import Flood, RATE
from benchmarks.common.random_draws import random_target
from benchmarks.common.real_time import put_ahead, staying_off
from benchmarks.soak.body import BodyAt, scene_of_body
from benchmarks.soak.client import SoakClient, threads_of
from benchmarks.soak.plans import ARGUMENTS, free_starts, NODE

# Between two requests [s].
PAUSE = 0.02


@dataclass(slots=True)
class FloodRecord:
    """
    How requests were answered while a topic was flooded.

    Parameters
    ----------
    topic : str
    rate : float
        Messages in a second [Hz].
    calls : list of float
        How long the answers took [s].
    n_unanswered : int

    """

    topic: str
    rate: float = 0.0
    calls: list[float] = field(default_factory=list)
    n_unanswered: int = 0
    is_interrupted: bool = False


def soak_floods(n: int, folder: Path, seed: int = 1, is_alone: bool = False) -> list[FloodRecord]:
    """
    Return how n requests are answered while each topic is flooded in its turn.

    Where it is alone the planner has a processor for itself.
    """
    records = []
    with (
        ros_client(lambda: SoakClient(folder)) as client,
        ChildProcess(NODE, ARGUMENTS, lambda _: None) as child,
    ):
        client.wait_for_service(child)
        put_ahead(*threads_of(NODE))
        rng = np.random.default_rng(seed)
        wearer, starts = free_starts(rng, 1)
        client.publish_body(scene_of_body(BodyAt(0, -wearer, 0.0)))
        client.publish_start(load_arm().joint_names, starts[0], random_target(rng))
        with (
            staying_off(threads_of(NODE)) if is_alone else nullcontext(),
            tqdm(total=n * len(client.published), unit='plan', file=sys.stderr) as bar,
        ):
            for topic, message in list(client.published.items()):
                records.append(FloodRecord(topic))
                try:
                    with Flood(topic, message, folder) as flood:
                        _ask(client, flood, records[-1], n, bar)
                except KeyboardInterrupt:
                    records[-1].is_interrupted = True
                    break
                child.check()
    client.close()
    return records


def _ask(client: SoakClient, flood: Flood, record: FloodRecord, n: int, bar: tqdm) -> None:
    while flood.count < RATE:
        flood.check()
        time.sleep(PAUSE)
    begin, before = time.monotonic(), flood.count
    for _ in range(n):
        elapsed, answer = client.question()
        if answer is None:
            record.n_unanswered += 1
        else:
            record.calls.append(elapsed)
        client.hear(PAUSE)
        flood.check()
        bar.update()
    record.rate = (flood.count - before) / (time.monotonic() - begin)
