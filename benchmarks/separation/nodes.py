# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Separation of real nodes: hands that reach for the arm, planners that die or stand still."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import itertools
import os
from pathlib import Path
import signal
import sys
import tempfile
from threading import Event, Lock, Thread
import time
from typing import Any

import numpy as np
import psutil
from rclpy.qos import QoSProfile
from rrth_planner.collision.reference_checker import bars
from rrth_planner.io.wearer_file import load_body
from rrth_planner.kernels.layout import SIZE
from rrth_planner.model.arrays import Array
from rrth_planner.model.body_reach import Lines
from rrth_planner.model.rotation import quaternion_xyzw
from rrth_planner.model.scene import Box, Scene
from rrth_planner.model.separation import governing_reach
from rrth_planner.model.trajectory import sample, Trajectory
from rrth_planner.rehearsal.contacts import (
    AT_REST,
    box_distances,
    classes_of,
    distances_to,
    FAST,
    SLOW,
    worst_class,
)
from rrth_planner.ros.messages.fields import seconds_of
from rrth_planner.ros.messages.trajectory import joint_trajectory_from_msg
from rrth_planner.ros.middleware.child_process import ChildProcess
from tqdm import tqdm
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from benchmarks.common.client import FRAME, LATCHED, ros_client
from benchmarks.common.random_draws import random_target
from benchmarks.common.real_time import run_in_real_time
from benchmarks.separation.reaching import EARLIEST, FASTEST, interception, Reaching
from benchmarks.separation.setting import Case, separation_of, STOPS, the_arm
from benchmarks.soak.client import SoakClient

# What docs/ros_control.md gives the planner.
PLANNER_PRIORITY = 10
PLANNER, PLAYBACK = (f'rrth_planner.ros.{name}_node' for name in ('planner', 'playback'))
# A tracker publishes so often [1/s]; a hand reaches for so long [s], aimed anew so often [s].
RATE, REACH, AIM_PERIOD = 120.0, 1.0, 0.02
# Where hands rest: so far from the bars of an arm at rest [m]; their size [m]; places tried.
NEAR, FAR, SIDE, PLACES = 0.05, 0.6, 0.1, 200
# An arm has set off once it is so fast; in strict separation, where it is slow near him, the
# second counts. Below the third it is at rest [rad/s].
SET_OFF, SET_OFF_STRICT, REST = 0.2, 0.02, 1e-3
# When a hand leaves, or the planner is killed, after the arm has set off [s].
LATEST = 0.5
# The planner stands still for so long [s].
STANDSTILL = 1.2
# So often it is asked for a motion beside a hand.
MOST_REQUESTS = 50
# What a planner says once it offers its service.
READY = 'ready after'
# What happens to the planner at that instant.
NOTHING, KILLED, STOPPED = 'nothing', 'SIGKILL', f'SIGSTOP of {STANDSTILL:g} s'
# Whatever was published is there by then [s].
TAKEN = 0.1
# Longest waits: for an arm that sets off, and that comes to rest [s].
PATIENCE, LONGEST = 3.0, 20.0
# What joint states 10 ms apart say of a speed is uncertain by so much [m/s].
UNCERTAIN = 5e-3
# A joint state so near to a commitment is of it [rad, rad/s]; so many are remembered of the time
# before a hand leaves.
SAME, RECENT = 1e-4, 20
# Joint states so near to a contact are looked at [s].
BESIDE = 0.1
# An arm this near to the end of the planned motion has played out all of it [rad].
AT_END = 1e-3


@dataclass(frozen=True, slots=True)
class Trial:
    """What is assumed, what happens to the planner, and how far hands really get, of `D_k`."""

    what: str
    case: Case
    event: str = NOTHING
    scale: float = 1.0
    is_separated: bool = True
    is_planner_in_real_time: bool = False


@dataclass(slots=True)
class Hands:
    """
    What was seen of hands.

    Parameters
    ----------
    words : list of str
        The worst class of contact of each hand, empty: none; only of those that left while the
        arm moved.
    fastest : float
        Speed of a place of the arm in contact [m/s].
    rests : list of float
        From the event until the arm was at rest, where it stopped on its way [s].
    played : list of float
        The same where it went on to the end of the planned motion.
    n_requests : int
        Asked for.
    commitments : str
        How long the planner took from a body to its commitment; empty where planners died.
    share : float
        Of a core that the planner's node used, without planning; 0 where planners died.

    """

    words: list[str] = field(default_factory=list)
    fastest: float = 0.0
    rests: list[float] = field(default_factory=list)
    played: list[float] = field(default_factory=list)
    n_requests: int = 0
    commitments: str = ''
    share: float = 0.0


class Wearer:
    """Publishes a wearer as a tracker would, one part of whom may be reaching for the arm."""

    def __init__(self, client: 'Client') -> None:
        """Begin with a wearer who stands still, without a hand."""
        self._client, self._body = client, load_body()
        self.reaching: Reaching | None = None
        # Held while the way of the hand is read or changed.
        self.lock = Lock()
        self._is_over = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._n_hands, self._gone = 0, ''

    def __enter__(self) -> 'Wearer':
        """Begin to publish."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End."""
        self._is_over.set()
        self._thread.join()

    def add_hand(self, center: Array, lines: Lines) -> Reaching:
        """Have a hand at rest, which may leave, and get as far as lines say."""
        self._n_hands += 1
        hand = Box(f'hand {self._n_hands}', center, np.full(3, SIDE), np.eye(3))
        scene = Scene((*self._body.boxes, hand))
        self.reaching = Reaching(scene, len(scene.boxes) - 1, lines)
        return self.reaching

    def remove_hand(self) -> None:
        """Let the hand be gone."""
        if self.reaching is not None:
            self._gone = self.reaching.scene.boxes[-1].name
        self.reaching = None

    def _run(self) -> None:
        due = time.monotonic()
        while not self._is_over.is_set():
            self._publish()
            due = max(due + 1.0 / RATE, time.monotonic() - 1.0 / RATE)
            time.sleep(max(0.0, due - time.monotonic()))

    def _publish(self) -> None:
        now = self._client.get_clock().now()
        reaching, boxes = self.reaching, self._body.boxes
        rows = self._body.numbers
        if reaching is not None:
            boxes = reaching.scene.boxes
            with self.lock:
                rows = reaching.rows(np.array([now.nanoseconds * 1e-9]))[0]
        # What a whole body leaves out is lost. A planner that stands still may miss that the last
        # hand is gone.
        markers = [Marker(action=Marker.DELETEALL), Marker(action=Marker.DELETE, ns=self._gone)]
        for box, row in zip(boxes, rows, strict=True):
            marker = Marker(ns=box.name, text=box.name, type=Marker.CUBE, action=Marker.ADD)
            p, o = marker.pose.position, marker.pose.orientation
            p.x, p.y, p.z = row[:SIZE].tolist()
            o.x, o.y, o.z, o.w = quaternion_xyzw(box.rotation).tolist()
            marker.scale.x, marker.scale.y, marker.scale.z = box.size.tolist()
            markers.append(marker)
        for marker in markers:
            marker.header.frame_id, marker.header.stamp = FRAME, now.to_msg()
        self._client.bodies.publish(MarkerArray(markers=markers))


class Client(SoakClient):
    """Asks, and keeps the last commitment."""

    def __init__(self, folder: Path) -> None:
        """Subscribe to the motions as a controller does."""
        super().__init__(folder)
        self.last: JointTrajectory | None = None
        # All of a hand.
        self.commitments: list[JointTrajectory] = []
        # Not latched: a planner that starts must not get a hand that is gone.
        self.bodies = self.create_publisher(MarkerArray, 'body_boxes', 10)
        # Where the planned motion ends, with separation [rad].
        self.planned_end: Array | None = None
        self.create_subscription(
            JointTrajectory, 'joint_trajectory', self._keep, QoSProfile(depth=10)
        )
        planned = 'rrth_planner/planned_trajectory'
        self.create_subscription(JointTrajectory, planned, self._keep_end, LATCHED)

    def _publish_acked(self, publisher: Any, message: Any) -> None:
        # A planner that was killed acknowledges nothing for 20 s, and waiting for that would also
        # keep the wearer from being published.
        publisher.publish(message)
        self.hear(TAKEN)

    def _keep(self, msg: JointTrajectory) -> None:
        self.last = msg
        self.commitments.append(msg)

    def _keep_end(self, msg: JointTrajectory) -> None:
        self.planned_end = np.array(msg.points[-1].positions)

    @property
    def speed(self) -> float:
        """How fast the arm moved last [rad/s]."""
        return max(map(abs, self.states[-1][2])) if self.states else 0.0

    def ahead(self, times: Array) -> tuple[Array, Array]:
        """Return states at times from now on, by the last commitment, (n, dof) twice."""
        now = self.get_clock().now().nanoseconds * 1e-9
        assert self.last is not None
        stamp = self.last.header.stamp.sec + 1e-9 * self.last.header.stamp.nanosec
        motion = joint_trajectory_from_msg(self.last, the_arm().joint_names)
        q, v, _ = sample(motion, times + (now - stamp if stamp > 0.0 else 0.0))
        return q, v


def run(trial: Trial, n: int, seed: int) -> Hands:
    """Return what became of n hands, one a motion."""
    rng, found = np.random.default_rng(seed), Hands()
    acceleration, jerk = STOPS[trial.case.stop]
    planner = ['--ros-args', '-p', 'seed:=7', '-p', f'stop_acceleration:=[{acceleration}]']
    planner += ['-p', f'stop_jerk:=[{jerk}]', '-p', f'contact_speed:={trial.case.contact_speed}']
    planner += ['-p', f'separation:={str(trial.is_separated).lower()}']
    playback = ['--ros-args', '-p', f'max_acceleration:=[{acceleration}]']
    with (
        tempfile.TemporaryDirectory() as folder,
        ros_client(lambda: Client(Path(folder))) as client,
        ChildProcess(PLAYBACK, playback, lambda _: None) as controller,
        Wearer(client) as wearer,
    ):
        client.listen_to_states()
        client.hear(LONGEST, lambda: client.states)
        if not run_in_real_time(controller.pid):
            tqdm.write('the controller runs at ordinary priority', file=sys.stderr)
        with _planners(planner, client) as planners:
            child = next(planners)
            if trial.is_planner_in_real_time and not run_in_real_time(child.pid, PLANNER_PRIORITY):
                tqdm.write('the planner runs at ordinary priority', file=sys.stderr)
            node = psutil.Process(child.pid)
            begin, before = time.monotonic(), sum(node.cpu_times()[:2])
            for _ in tqdm(range(n), desc=trial.what, file=sys.stderr):
                _one_hand(trial, client, wearer, child, rng, found)
                if trial.event == KILLED:
                    child = next(planners)
            if trial.event == NOTHING:
                used = sum(node.cpu_times()[:2]) - before
                found.share = used / (time.monotonic() - begin)
                found.commitments = client.figures.get('commitments', '')
        client.close()
    return found


@contextmanager
def _planners(arguments: list[str], client: Client) -> Iterator[Iterator[ChildProcess]]:
    """Give planners that are ready, one after the other; each ends with the next one."""

    def each() -> Iterator[ChildProcess]:
        while True:
            ready: list[str] = []
            with ChildProcess(PLANNER, arguments, ready.append) as child:
                # The service of a planner that was killed seems to be there for 20 s.
                while not any(READY in line for line in ready):
                    child.check()
                    client.hear(0.1)
                client.wait_for_service(child)
                client.hear(LONGEST, lambda: client.states)
                client.hear(1.0)
                yield child

    planners = each()
    try:
        yield planners
    finally:
        planners.close()


def _one_hand(
    trial: Trial,
    client: Client,
    wearer: Wearer,
    child: ChildProcess,
    rng: np.random.Generator,
    found: Hands,
) -> None:
    """Have a hand reach for an arm in motion."""
    assumed = governing_reach(separation_of(trial.case).rules, 'hand')[1]
    lines = tuple((trial.scale * c, trial.scale * w) for c, w in assumed)
    fast = SET_OFF if trial.case.contact_speed > 0.0 else SET_OFF_STRICT
    client.hear(LONGEST, lambda: client.speed < REST)
    wearer.add_hand(_place_near(np.array(client.states[-1][1]), rng), lines)
    client.hear(0.3)
    for n_requests in itertools.count():
        client.publish_target(random_target(rng))
        found.n_requests += 1
        _, answer = client.question()
        if answer is None or not answer.success:
            if n_requests > MOST_REQUESTS:
                raise RuntimeError(f'no motion any more: {answer and answer.message}')
            # It may be the hand that is in the way.
            wearer.remove_hand()
            client.hear(0.1)
            wearer.add_hand(_place_near(np.array(client.states[-1][1]), rng), lines)
            client.hear(0.3)
            continue
        if client.hear(PATIENCE, lambda: client.speed > fast):
            break
    client.hear(float(rng.uniform(0.0, LATEST)))
    was_moving = client.speed > fast
    reaching = wearer.reaching
    assert reaching is not None
    n_states = max(0, len(client.states) - 10)
    client.commitments = client.commitments[-RECENT:]
    begin = client.get_clock().now().nanoseconds * 1e-9
    if trial.event == KILLED:
        os.kill(child.pid, signal.SIGKILL)
    elif trial.event == STOPPED:
        os.kill(child.pid, signal.SIGSTOP)
    _reach(client, wearer, trial, EARLIEST if rng.random() < 0.5 else FASTEST)
    if trial.event == STOPPED:
        client.hear(max(0.0, begin + STANDSTILL - client.get_clock().now().nanoseconds * 1e-9))
        states = client.states[n_states:]
        os.kill(child.pid, signal.SIGCONT)
    else:
        client.hear(LONGEST if trial.event == KILLED else 0.2, lambda: client.speed < REST)
        states = client.states[n_states:]
    if was_moving:
        _judge(trial, reaching, begin, states, client, found)
    wearer.remove_hand()
    client.hear(0.3)


def _reach(client: Client, wearer: Wearer, trial: Trial, aim: str) -> None:
    """Let the hand leave for the arm, and be aimed anew again and again."""
    reaching = wearer.reaching
    assert reaching is not None
    end, times = time.monotonic() + REACH, np.arange(0.0, 1.0, 0.01)
    while time.monotonic() < end:
        q, v = client.ahead(times)
        now = client.get_clock().now().nanoseconds * 1e-9
        row = reaching.rows(np.array([now]))[0, reaching.part]
        contact, ways = trial.case.contact_speed, reaching.ways_ahead(now, times)
        direction = interception(the_arm(), q, v, row, ways, contact, aim)
        if direction is None:
            # It is there, and stays.
            with wearer.lock:
                reaching.head_for(np.zeros(3), now)
            client.hear(max(0.0, end - time.monotonic()))
            return
        with wearer.lock:
            reaching.head_for(direction, now)
        client.hear(AIM_PERIOD)


def _judge(
    trial: Trial,
    reaching: Reaching,
    begin: float,
    states: list[tuple[int, Array, Array]],
    client: Client,
    found: Hands,
) -> None:
    """Take note of contacts, and of when the arm came to rest."""
    stamps = np.array([stamp for stamp, _, _ in states]) * 1e-9
    kept = np.concatenate([[True], np.diff(stamps) > 1e-6])
    stamps = stamps[kept]
    q, v = (np.array([s[k] for s in states])[kept] for k in (1, 2))
    times = np.arange(begin - stamps[0], stamps[-1] - stamps[0], 1e-3)
    q_fine, v_fine = _executed(stamps, q, v, times + stamps[0], client.commitments)
    rows = reaching.rows(times + stamps[0])
    contact = trial.case.contact_speed + UNCERTAIN
    distances = distances_to(the_arm(), q_fine, v_fine, reaching.names, rows, contact, 0.05)
    classes = classes_of(distances)
    found.words.append(worst_class(classes))
    for i, bar, box in np.argwhere(classes == FAST)[:1]:
        # Where a commitment comes too late, the arm jumps, and its velocities do not say so.
        steps = np.diff(stamps)[:, None]
        jumps = np.abs(np.diff(q, axis=0) - 0.5 * (v[1:] + v[:-1]) * steps).max(axis=1)
        near = np.abs(stamps[1:] - stamps[0] - times[i]) < BESIDE
        tqdm.write(
            f'{trial.what}: bar {bar} at {distances.speeds[i, bar, box]:.3f} m/s and '
            f'"{reaching.names[box]}" {times[i] - times[0]:.3f} s after the event; nearby joint '
            f'states are up to {1e3 * steps[near].max():.0f} ms apart, and jump by up to '
            f'{jumps[near].max():.4f} rad',
            file=sys.stderr,
        )
    found.fastest = max(
        found.fastest, float(distances.speeds[distances.fast <= 0.0].max(initial=0))
    )
    if trial.event != NOTHING:
        moving = np.flatnonzero((np.abs(v) >= REST).any(axis=1) & (stamps >= begin))
        rest = float(stamps[moving[-1]] - begin) if len(moving) else 0.0
        assert client.last is not None
        end = joint_trajectory_from_msg(client.last, the_arm().joint_names)
        is_played = client.planned_end is not None and bool(
            np.abs(client.planned_end - end.positions[-1]).max() < AT_END
        )
        (found.played if is_played else found.rests).append(rest)


def _executed(
    stamps: Array, q: Array, v: Array, times: Array, commitments: Sequence[JointTrajectory]
) -> tuple[Array, Array]:
    """
    Return the states of the arm at times, (n, dof) twice, by its joint states at stamps [s].

    Between two of them it executes the commitment that leads to the later one. Where none does, it
    is where their positions and velocities lead, whose speed is uncertain: jerks are unknown.
    """
    motion = Trajectory(stamps - stamps[0], q, v, np.gradient(v, stamps, axis=0))
    q_found, v_found, _ = sample(motion, times - stamps[0])
    names = the_arm().joint_names
    curves = [
        (seconds_of(m.header.stamp), joint_trajectory_from_msg(m, names)) for m in commitments
    ]
    for i in range(1, len(stamps)):
        within = (stamps[i - 1] < times) & (times <= stamps[i])
        for begin, curve in reversed(curves):
            if begin > stamps[i] or not within.any():
                continue
            p, w, _ = sample(curve, [stamps[i] - begin])
            if max(np.abs(p[0] - q[i]).max(), np.abs(w[0] - v[i]).max()) < SAME:
                later = within & (times >= begin)
                q_found[later], v_found[later], _ = sample(curve, times[later] - begin)
                break
    return q_found, v_found


def _place_near(q: Array, rng: np.random.Generator) -> Array:
    """Return where a hand rests near an arm, free of it [m]."""
    lines = bars(the_arm(), q[None], 0.0)[0]
    for _ in range(PLACES):
        line = lines[rng.integers(len(lines))]
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        away = rng.uniform(NEAR, FAR) + SIDE
        center = line[0] + rng.random() * (line[1] - line[0]) + away * direction
        hand = Box('hand', center, np.full(3, SIDE), np.eye(3))
        s = np.linspace(0.0, 1.0, 33)[:, None, None]
        points = (lines[:, 0] + s * (lines[:, 1] - lines[:, 0])).reshape(1, -1, 3)
        if box_distances(points, hand.numbers[None]).min() >= NEAR:
            return np.asarray(center)
    raise RuntimeError(f'no place for a hand within {PLACES} draws')


HEADER = (
    '| what | v_c [m/s] | stop | hands | contacts, arm faster than v_c | slower | at rest '
    '| fastest contact [m/s] | at rest on its way after: median [s] | most [s] '
    '| played to its end: motions | most [s] | body to commitment | share of a core |'
)


def trials() -> dict[str, tuple[Trial, bool]]:
    """Return the trials by name, and whether each ends planners."""
    found: list[tuple[Trial, bool]] = []
    for case in (Case(), Case(stop='10/400'), Case(contact_speed=0.0, stop='10/400')):
        found.append((Trial('hands as far as assumed', case), False))
    what = 'the same, planner in real time as well'
    found.append((Trial(what, Case(), is_planner_in_real_time=True), False))
    found.append((Trial('power: 1.5 times as far', Case(), scale=1.5), False))
    found.append((Trial('power: separation off', Case(), is_separated=False), False))
    for event in (KILLED, STOPPED):
        for case in (Case(), Case(stop='10/400')):
            found.append((Trial(event, case, event), True))
    return {f'{t.what}, {t.case.contact_speed:g}, {t.case.stop}': (t, e) for t, e in found}


def line_of(trial: Trial, found: Hands) -> str:
    """Return the row of a trial."""
    counts = [sum(word == name for word in found.words) for name in (FAST, SLOW, AT_REST)]
    n = len(found.words)
    cells = [trial.what, f'{trial.case.contact_speed:g}', trial.case.stop, str(n)]
    cells += [f'{counts[0]} ({counts[0] / max(n, 1):.1%})', str(counts[1]), str(counts[2])]
    cells.append(f'{found.fastest:.2f}')
    cells += (
        [f'{np.median(found.rests):.2f}', f'{max(found.rests):.2f}'] if found.rests else ['–', '–']
    )
    cells += [str(len(found.played)), f'{max(found.played):.2f}' if found.played else '–']
    cells += [found.commitments, f'{found.share:.0%}'] if found.commitments else ['–', '–']
    return f'| {" | ".join(cells)} |'
