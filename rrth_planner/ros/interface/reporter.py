# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Report the outcomes of requests and the state of the monitor: log and diagnostics."""

from dataclasses import replace
from pathlib import Path
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rrth_planner.execution.body_motion import BodyMotion, RAISED, SHARE
from rrth_planner.execution.separation_status import NO_PROMISE, SeparationState, SeparationStatus
from rrth_planner.model.body_reach import lines_shown
from rrth_planner.model.errors import one_line
from rrth_planner.model.separation import governing_reach, SeparationRules
from rrth_planner.model.status import ErrorCode
from rrth_planner.requests.outcome import Outcome
from rrth_planner.ros.interface.figures import Figures
from rrth_planner.ros.interface.inputs import Inputs
from rrth_planner.ros.interface.parameters import in_effect, PlannerParameters
from rrth_planner.ros.interface.separation_status import LEVELS, separation_to_msg
from rrth_planner.ros.messages.answer import FIGURES, figures_shown
from rrth_planner.ros.messages.body import WearerBody
from rrth_planner.ros.messages.diagnostics import GIVEN_UP_KEY, REQUEST_KEY, status_to_msg
from rrth_planner.ros.middleware.qos import LATCHED

# Diagnostics are published at least this often [s].
DIAGNOSTICS_PERIOD = 1.0
# From the best level to the worst.
SEVERITY = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.STALE,
    DiagnosticStatus.ERROR,
)
# Warnings of parts that got further than assumed are logged at most this often [s].
WARNING_PERIOD = 5.0
# A rate is published again once it has changed by so much [-].
RATE_STEP = 0.05
# The diagnostics name the reach of so many boxes.
MOST_BOXES = 100
# Number of lost parts that are remembered as reported.
MOST_NAMED = 1000
# Changes are published at most this often; the last one always is [s].
SHORTEST_PERIOD = 0.1
# The figures of a plan that is not known.
UNKNOWN = {key: 'nan' for key, _ in FIGURES.values()} | {'seed': '-1', 'waypoints': '0'}


class Reporter:
    """Publish `/diagnostics` every second and on change, and log each request once."""

    def __init__(self, node: Node, inputs: Inputs, parameters: PlannerParameters) -> None:
        """Advertise `/diagnostics`; the owner keeps `self.parameters` up to date."""
        self._given = parameters
        # How the last request ended, how many did, and how many of those with a motion.
        self.last: Outcome | None = None
        self.n_requests = self.n_solved = 0
        self._node, self._inputs = node, inputs
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # The state of the monitor, its reason, and the level of that.
        self.monitor_state, self.monitor_level = ('no motion', ''), DiagnosticStatus.OK
        # Level and sentence while the arm has not followed what it was given; else OK.
        self._unfollowed = (DiagnosticStatus.OK, '')
        # The number of the request whose motion was commanded last, and why its goal is not
        # pursued any more before the arm has arrived.
        self._request, self._given_up = 0, ''
        self._remaining_motion_checks, self._stops_published = Figures(), Figures()
        self._body_ages = Figures()
        self._n_incidents, self._last_incident = 0, ''
        self._separation, self._commitments = SeparationStatus(), Figures()
        # What is in the pointing ray of an arm that waits to begin; empty: nothing.
        self._box_in_ray = ''
        self._body: BodyMotion | None = None
        self._state: Publisher | None = None
        self._published_state, self._published_trouble = self._separation, self._unfollowed
        if parameters.execution.separation is not None:
            self._state = node.create_publisher(DiagnosticStatus, '~/state', LATCHED)
            self._publish_state()
        self._published = -SHORTEST_PERIOD
        self._is_changed = False
        self._named: set[tuple[str, int]] = set()
        self._n_publishers = 0
        # Not the node's clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers = [
            node.create_timer(DIAGNOSTICS_PERIOD, self._publish, clock=steady),
            node.create_timer(SHORTEST_PERIOD, self._publish_changes, clock=steady),
        ]

    @property
    def parameters(self) -> PlannerParameters:
        """Of what begins now; without separation beside a body that stands still (`auto`)."""
        return in_effect(self._given, self._inputs.source)

    @parameters.setter
    def parameters(self, given: PlannerParameters) -> None:
        self._given = given

    def remaining_motion_checked(self, elapsed: float) -> None:
        """Count a check of the remaining motion against a new body, and its time [s]."""
        self._remaining_motion_checks.add(elapsed)

    def stop_published(self, elapsed: float) -> None:
        """Count a fail-safe stop, and how long after the body's arrival it was published [s]."""
        self._stops_published.add(elapsed)

    def body_used(self, age: float) -> None:
        """Count a decision, to publish a motion or to go on with one, by the body's age [s]."""
        self._body_ages.add(age)

    def commitment_published(self, elapsed: float) -> None:
        """Count a published commitment, and what it took to find and prove it [s]."""
        self._commitments.add(elapsed)

    def body_observed(self, body: BodyMotion) -> None:
        """Keep what is known of the wearer, and log which parts got further than assumed."""
        self._body = body
        if body.further:
            named = ', '.join(f'{one_line(name)} by {100 * x:.1f} cm' for name, x in body.further)
            self._node.get_logger().warning(
                f'further than assumed: {named}; for {RAISED:g} s {SHARE:g} times that is added '
                'to how far it may get',
                throttle_duration_sec=WARNING_PERIOD,
            )

    def separation_status(self, status: SeparationStatus) -> None:
        """Publish how the running motion is executed, where that has changed."""
        self._separation = status
        self._publish_changed_state()

    @property
    def _shown_state(self) -> SeparationStatus:
        """What `~/state` says; the first body of a stream is not yet taken for one that stands."""
        is_known = self._inputs.source.time_until_known(time.monotonic()) <= 0.0
        if self.parameters.stands_still and is_known:
            return SeparationStatus(SeparationState.UNSEPARATED, NO_PROMISE)
        box = self._box_in_ray
        if not box or self._separation.state is SeparationState.FAULT:
            return self._separation
        cause = f'the arm waits until {box} is out of its pointing ray'
        return SeparationStatus(SeparationState.PROTECTIVE_STOP, cause, 0.0, 'pointing ray', box)

    def _publish_changed_state(self) -> None:
        status, before = self._shown_state, self._published_state
        if (status.state, status.cause) != (before.state, before.cause):
            self.publish_soon()
        elif abs(status.rate - before.rate) < RATE_STEP:
            return
        self._publish_state()

    def _publish_state(self) -> None:
        status, trouble = self._shown_state, self._trouble()
        if self._state is not None:
            name = f'{self._node.get_fully_qualified_name().lstrip("/")}: separation'
            self._state.publish(separation_to_msg(name, status, trouble))
        self._published_state, self._published_trouble = status, trouble

    def _trouble(self) -> tuple[bytes, str]:
        """Return level and sentence of what is wrong with the execution of the last motion."""
        monitored = self.monitor_level, self.monitor_state[1]
        return max(self._unfollowed, monitored, key=lambda found: found[0])

    def unfollowed(self, level: bytes, sentence: str) -> None:
        """Publish that the arm does not follow what it is given, or, with OK, that it does."""
        self._unfollowed = level, sentence
        if sentence:
            self._node.get_logger().warning(sentence)
        self.publish_soon()
        if self._trouble() != self._published_trouble:
            self._publish_state()

    def pursued(self, request: int) -> None:
        """Publish that the arm pursues the goal of a request, by its number."""
        self._request, self._given_up = request, ''
        self.publish_soon()

    def given_up(self, why: str) -> None:
        """Publish that the goal of that request is not pursued any more."""
        self._given_up = one_line(why)
        self._node.get_logger().warning(f'goal of answer {self._request} given up: {why}')
        self._publish()

    def ray_blocked_by(self, box: str) -> None:
        """Publish what an arm at rest waits for to leave its pointing ray; empty: nothing."""
        self._box_in_ray = box
        self._publish_changed_state()

    def nothing_runs(self) -> None:
        """Publish that no motion is executed, and none will be without a request."""
        is_fault = self._separation.state is SeparationState.FAULT
        if not is_fault and self._separation != SeparationStatus():
            self.separation_status(SeparationStatus())

    def incident(self, file: Path | None) -> None:
        """Count an incident, and keep the name of its file if there is one."""
        self._n_incidents += 1
        self._last_incident = '' if file is None else str(file)

    def publish_soon(self) -> None:
        """Publish the diagnostics within a tenth of a second."""
        self._is_changed = True

    def publish(self) -> None:
        """Publish the diagnostics now, or, where the last ones are too recent, soon."""
        self._is_changed = True
        self._publish_change()

    def _publish_change(self) -> None:
        if self._is_changed and time.monotonic() - self._published >= SHORTEST_PERIOD:
            self._publish()

    def _publish_changes(self) -> None:
        self._publish_changed_state()
        self._publish_change()
        # Here only, in the node's own thread: an older state must not be the last one.
        if self._trouble() != self._published_trouble:
            self._publish_state()

    def _publish(self) -> None:
        self._published, self._is_changed = time.monotonic(), False
        now = self._node.get_clock().now()
        self._warn_of_lost(now.nanoseconds * 1e-9)
        self._warn_of_publishers()
        msg = DiagnosticArray(status=[self._status(now.nanoseconds * 1e-9)])
        msg.header.stamp = now.to_msg()
        self._publisher.publish(msg)

    def _status(self, now: float) -> DiagnosticStatus:
        last, body = self.last, self._inputs.body.value.at(now)
        monitor, reason = self.monitor_state
        values: dict[str, object] = {
            'last code': '' if last is None else f'{last.code.name} ({last.code.value})',
            'last sentence': '' if last is None else last.sentence,
            'requests': self.n_requests,
            'solved': self.n_solved,
            **UNKNOWN,
            **figures_shown({} if last is None else last.answer.figures),
            'boxes': body.n_boxes,
            'publishers of the body': self._n_publishers,
            'subscribers of motions': self._node.count_subscribers('joint_trajectory'),
            'lost parts': body.lost_names(),
            'allowed contacts': '; '.join(map(': '.join, self.parameters.arm.allowed)),
            'monitor': monitor,
            'last stop': reason,
            REQUEST_KEY: self._request,
            GIVEN_UP_KEY: self._given_up,
            'age of body at decisions': self._body_ages,
            'remaining motion checks': self._remaining_motion_checks,
            'fail-safe stops': self._stops_published,
            'incidents': self._n_incidents,
            'last incident': self._last_incident,
        }
        if self._state is not None:
            values |= self._separation_values(now)
        for name, topic in self._inputs.all.items():
            values[f'age of {name} [s]'] = f'{topic.age(now):.3f}'
            values[f'good messages, {name}'] = topic.n_good
            values[f'rejected messages, {name}'] = topic.n_rejected
            values[f'last rejection, {name}'] = topic.rejection or ''
        level, message = summary(now, self._inputs, self.parameters, last)
        monitored = self.monitor_level, self.monitor_state[1]
        separated = LEVELS[self._published_state.state], self._published_state.text
        found = [(level, message), monitored, separated]
        if self._unfollowed[1]:
            # Of the same level it is the first to be mended.
            found.insert(0, self._unfollowed)
        level, message = max(found, key=lambda one: SEVERITY.index(one[0]))
        name = f'{self._node.get_fully_qualified_name().lstrip("/")}: planning'
        return status_to_msg(name, level, message, values)

    def _separation_values(self, now: float) -> dict[str, object]:
        """Return what is known of separation at a time [s]."""
        status, body = self._published_state, self._body
        separation = self.parameters.execution.separation
        n_seen, n_further = (0, 0) if body is None else (body.n_seen, body.n_further)
        return {
            'separation': status.state.name,
            'cause': status.cause,
            'rate [-]': f'{status.rate:.3f}',
            'commitments': self._commitments,
            'reach [m]': ''
            if body is None or separation is None
            else reach_shown(body, now, separation.rules),
            'sights of parts': n_seen,
            'further than assumed': f'{n_further} ({n_further / max(n_seen, 1):.2%})',
        }

    def _warn_of_lost(self, now: float) -> None:
        """Log each lost part once."""
        lost = self._inputs.body.value.at(now).lost
        new = [(key, part) for key, part in lost if key not in self._named]
        if new:
            if len(self._named) > MOST_NAMED:
                self._named = {key for key, _ in lost}
            self._named.update(key for key, _ in new)
            names = WearerBody(lost=tuple(new)).lost_names()
            self._node.get_logger().warning(
                f'{self._inputs.body.topic}: lifetime of {names} expired, or a body left it out: '
                'no new motion until published again or deleted'
            )

    def _warn_of_publishers(self) -> None:
        """Log where the body comes from several publishers, which may be meant, or a mistake."""
        topic, before = self._inputs.body.topic, self._n_publishers
        self._n_publishers = n = self._node.count_publishers(topic)
        if n > max(before, 1):
            self._node.get_logger().warning(
                f'{topic} has {n} publishers: for each marker the last edit counts, whoever sends '
                'it'
            )

    def reject(self, code: ErrorCode, sentence: str) -> None:
        """Log and publish the rejection of a request."""
        self.conclude(Outcome(code, sentence))

    def conclude(self, outcome: Outcome) -> None:
        """Log and publish how a request ended."""
        self.last = outcome
        self.n_requests += 1
        self.n_solved += outcome.code is ErrorCode.SUCCESS
        self._announce(outcome)

    def revise(self, code: ErrorCode, sentence: str) -> None:
        """Log and publish what became of the last request."""
        self.last = replace(self.last or Outcome(code, ''), code=code, sentence=sentence)
        self._announce(self.last)

    def _announce(self, outcome: Outcome) -> None:
        logger = self._node.get_logger()
        # Three calls: rclpy raises where one line of code logs at changing severities.
        if outcome.code is ErrorCode.SUCCESS:
            logger.info(outcome.text)
        elif outcome.code is ErrorCode.FAILURE:
            logger.error(outcome.text)
        else:
            logger.warning(outcome.text)
        self.publish()


def reach_shown(body: BodyMotion, now: float, rules: SeparationRules) -> str:
    """Return how far each box may get from a time on [s], and by which words of the rules."""
    shown, boxes = [], body.scene.boxes
    raised = np.where(now <= body.until, body.raised, 0.0)
    for box, further in zip(boxes[:MOST_BOXES], raised, strict=False):
        words, lines = governing_reach(rules, box.name)
        why = words if further == 0.0 else f'{words}, raised by {100 * further:.0f} cm'
        shown.append(f'"{box.name}" {lines_shown(lines)} ({why})')
    rest = len(boxes) - len(shown)
    return '; '.join(shown + ([f'{rest} more'] if rest else []))


def summary(
    now: float, inputs: Inputs, parameters: PlannerParameters, last: Outcome | None
) -> tuple[bytes, str]:
    """Return level and message of the planner's diagnostics at a time [s]."""
    if last is not None and last.code is ErrorCode.FAILURE:
        return DiagnosticStatus.ERROR, last.text
    timeouts = ((inputs.body, parameters.body_timeout), (inputs.joints, parameters.joint_timeout))
    for topic, timeout in timeouts:
        if timeout > 0.0 and topic.measured is not None and topic.age(now) > timeout:
            return DiagnosticStatus.STALE, f'{topic.topic} is {topic.age(now):.3f} s old'
    rejected = [topic for topic in inputs.all.values() if topic.is_last_rejected]
    if rejected:
        return DiagnosticStatus.WARN, f'{rejected[0].topic} rejected: {rejected[0].rejection}'
    missing = [topic.topic for topic in inputs.all.values() if topic.measured is None]
    if missing:
        return DiagnosticStatus.WARN, f'waiting for {", ".join(missing)}'
    if last is not None and last.code is not ErrorCode.SUCCESS:
        return DiagnosticStatus.WARN, last.text
    if parameters.stands_still:
        return DiagnosticStatus.WARN, NO_PROMISE
    return DiagnosticStatus.OK, 'ready' if last is None else one_line(last.sentence)
