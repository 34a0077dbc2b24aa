# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What is rehearsed, as a file says it: a wearer, tracker, planner, controller, requests."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
import math
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

from rrth_planner.io.entries import mapping, number, sequence, text, whole
from rrth_planner.io.text_file import load_yaml, naming_file
from rrth_planner.model.errors import OptionsError, shown
from rrth_planner.simulation.trajectory_controller import ControllerVersion

Pair = tuple[float, float]


def _require(name: str, value: float, unit: str, low: float, high: float = math.inf) -> None:
    """Raise OptionsError unless a number is from `low` to `high`."""
    if not low <= value <= high:
        span = f'{low:g} to {high:g}' if high < math.inf else f'a number from {low:g} on'
        raise OptionsError(f'{name}: {value:g}, expected {span} [{unit}]')


def _require_spans(name: str, spans: Sequence[Pair]) -> None:
    """Raise OptionsError unless each goes from an earlier time to a later one [s]."""
    for begin, end in spans:
        if not 0.0 <= begin <= end:
            raise OptionsError(f'{name}: {begin:g} to {end:g}, expected from 0 on, upwards [s]')


# No period is shorter [s], and no rate of a film slower [-].
SHORTEST, SLOWEST = 1e-4, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """
    A recorded person.

    Parameters
    ----------
    file : str
        A .bvh, .c3d or .csv file, beside the scenario where it is relative; empty: the one that
        comes along.
    skeleton : str
        What makes boxes of it.
    rate : float
        How fast he is played, of 1.
    begin : float
        What comes before is not played [s].
    hand_size : float
        Edge of the boxes of his hands [m]; 0: as the skeleton has them.

    """

    file: str = ''
    skeleton: str = 'cmu_bvh'
    rate: float = 1.0
    begin: float = 0.0
    hand_size: float = 0.0

    def __post_init__(self) -> None:
        """Validate."""
        _require('rate', self.rate, '-', SLOWEST, 100.0)
        _require('begin', self.begin, 's', 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Intercepting:
    """
    The wearer of `config/body.yaml`, with a hand that goes for the arm.

    Parameters
    ----------
    hand : str
        What it is called.
    home : (float, float, float)
        Where it rests [m].
    speed : float
        [m/s].
    waits, pursues : float
        How long it rests, and goes for the arm then, again and again [s].

    """

    hand: str = 'right hand'
    home: tuple[float, float, float] = (0.42, -0.27, -0.14)
    speed: float = 1.5
    waits: float = 2.0
    pursues: float = 1.5

    def __post_init__(self) -> None:
        """Validate."""
        _require('speed', self.speed, 'm/s', 0.0)
        _require('waits', self.waits, 's', SHORTEST)
        _require('pursues', self.pursues, 's', SHORTEST)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A tracker loses a part of the wearer from one time to another [s]."""

    part: str
    begin: float
    end: float

    def __post_init__(self) -> None:
        """Validate."""
        _require_spans(f'loss of {self.part}', [(self.begin, self.end)])


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracker:
    """
    What is seen of the wearer.

    Parameters
    ----------
    rate : float
        Frames a second [1/s].
    age : (float, float)
        How old a frame is that comes: from, to [s].
    loss : float
        The share of frames that never come [-].
    loses : tuple of Loss
    keep_lost : float
        How long a lost part stays where it was before the arm stops [s].

    """

    rate: float = 60.0
    age: Pair = (0.01, 0.03)
    loss: float = 0.0
    loses: tuple[Loss, ...] = ()
    keep_lost: float = 2.0

    def __post_init__(self) -> None:
        """Validate."""
        _require('tracker.rate', self.rate, '1/s', SHORTEST, 1.0 / SHORTEST)
        _require_spans('age', [self.age])
        _require('loss', self.loss, '-', 0.0, 1.0)
        _require('keep_lost', self.keep_lost, 's', 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """The planner: how long its answers take, from, to, and when there are none, from, to [s]."""

    latency: Pair = (0.003, 0.05)
    dead: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        """Validate."""
        _require_spans('latency', [self.latency])
        _require_spans('dead', self.dead)


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """
    The node in which the monitor runs.

    Parameters
    ----------
    deciding : (float, float)
        How long a decision takes: from, to [s].
    stands_still : tuple of (float, float)
        From when to when the host does nothing [s].

    """

    deciding: Pair = (0.0002, 0.0015)
    stands_still: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        """Validate."""
        _require_spans('deciding', [self.deciding])
        _require_spans('stands_still', self.stands_still)


@dataclass(frozen=True, slots=True, kw_only=True)
class Execution:
    """
    A controller and an arm.

    Parameters
    ----------
    version : str
        Of joint_trajectory_controller.
    period : float
        Of its cycle [s].
    delay : float
        `controller_delay`, as the planner knows it: at least the longest way of a message, and
        the lag [s].
    lag : float
        Of the arm behind its command [s].
    transport : (float, float)
        How long a message takes: from, to [s].
    rejects : tuple of (float, float)
        From when to when it rejects all messages [s].

    """

    version: str = '4.42'
    period: float = 0.01
    delay: float = 0.02
    lag: float = 0.01
    transport: Pair = (0.001, 0.009)
    rejects: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        """Validate."""
        versions = [one.value for one in ControllerVersion]
        if self.version not in versions:
            known = ', '.join(versions)
            raise OptionsError(f'version: {shown(self.version)}, expected one of {known}')
        _require('controller.period', self.period, 's', SHORTEST)
        _require('delay', self.delay, 's', 0.0)
        _require('lag', self.lag, 's', 0.0)
        _require_spans('transport', [self.transport])
        _require_spans('rejects', self.rejects)


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """
    What is assumed and allowed.

    Parameters
    ----------
    contact_speed : float
        [m/s].
    stop_acceleration, stop_jerk : float
        Of stops [rad/s^2, rad/s^3].

    """

    contact_speed: float = 0.1
    stop_acceleration: float = 4.0
    stop_jerk: float = 40.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Requests:
    """
    Targets, drawn from a box low in front of the wearer, where his hands work.

    Parameters
    ----------
    pause : float
        From a target that was reached or given up to the next one [s].
    gives_up : float
        A target is given up so long after it was asked for [s].
    replaced : float
        The share of targets that the next one replaces while the arm moves [-].
    lowest, highest : tuple of three float
        Corners of the box [m].

    """

    pause: float = 1.0
    gives_up: float = 10.0
    replaced: float = 0.0
    lowest: tuple[float, float, float] = (0.8, -0.6, -0.6)
    highest: tuple[float, float, float] = (1.6, 0.6, 0.0)

    def __post_init__(self) -> None:
        """Validate."""
        _require('pause', self.pause, 's', 0.0)
        _require('gives_up', self.gives_up, 's', 0.0)
        _require('replaced', self.replaced, '-', 0.0, 1.0)
        pairs = zip(self.lowest, self.highest, strict=True)
        if any(low > high for low, high in pairs):
            raise OptionsError(
                f'lowest: {shown(self.lowest)}, expected at most highest {shown(self.highest)} [m]'
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """
    All of it; the same scenario has the same course.

    Parameters
    ----------
    about : str
        What is rehearsed.
    seed : int
        >= 0.
    seconds : float
        How long, in virtual time [s].

    """

    about: str = ''
    seed: int = 0
    seconds: float = 60.0
    recorded: Recorded | None = None
    intercepting: Intercepting | None = None
    tracker: Tracker = field(default_factory=Tracker)
    planner: Answers = field(default_factory=Answers)
    node: Node = field(default_factory=Node)
    controller: Execution = field(default_factory=Execution)
    separation: Proof = field(default_factory=Proof)
    requests: Requests = field(default_factory=Requests)
    folder: Path = Path()

    def __post_init__(self) -> None:
        """Require one wearer."""
        if (self.recorded is None) == (self.intercepting is None):
            raise OptionsError('scenario: expected either recorded or intercepting, one wearer')
        if self.seed < 0:
            raise OptionsError(f'seed: {self.seed}, expected a whole number >= 0')
        _require('seconds', self.seconds, 's', SHORTEST)


def load_scenario(path: str | Path) -> Scenario:
    """
    Return the scenario of a file; what it does not say is as in `Scenario`.

    Raises
    ------
    OptionsError
        An unknown name, or a value of another kind.

    """
    with naming_file(path, OptionsError):
        data = load_yaml(path)
        if not isinstance(data, Mapping):
            raise OptionsError(f'{shown(data)}, expected a mapping, as in config/scenarios')
        found: Scenario = _read(Scenario, {'folder': str(Path(path).parent), **data}, 'scenario')
        return found


def _read(kind: Any, value: Any, name: str) -> Any:
    """Return a value of a kind: a number, a text, a tuple of such, or a group of named ones."""
    options = [option for option in get_args(kind) if option is not type(None)]
    origin = get_origin(kind)
    if origin is not tuple and options:
        return _read(options[0], value, name)
    if origin is tuple:
        items = sequence(value, name, OptionsError)
        if options[-1] is Ellipsis:
            return tuple(_read(options[0], item, f'{name} {k}') for k, item in enumerate(items, 1))
        if len(items) != len(options):
            raise OptionsError(f'{name}: {shown(value)}, expected {len(options)} numbers')
        pairs = zip(options, items, strict=True)
        return tuple(_read(option, item, name) for option, item in pairs)
    if kind is float:
        # Its unit, and its range, are those of the field.
        return number(value, name, 'SI', OptionsError)
    if kind is int:
        return whole(value, name, OptionsError)
    if kind is str:
        return text(value, name, OptionsError)
    if kind is Path:
        return Path(value)
    hints = get_type_hints(kind)
    names = [one.name for one in fields(kind)]
    # All have defaults but those of a loss.
    wanted = names if kind is Loss else []
    given = mapping({} if value is None else value, name, wanted, OptionsError, names)
    return kind(**{key: _read(hints[key], item, key) for key, item in given.items()})
