# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts of a simulated arm with its wearer as diagnostics, one status a pair of parts."""

from collections.abc import Iterable

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rrth_planner.ros.messages.diagnostics import status_to_msg
from rrth_planner.simulation.contacts import ContactEvent

# A key that is read again.
GREATEST_FORCE = 'greatest force [N]'


def contacts_to_msg(
    going: Iterable[ContactEvent], ended: Iterable[ContactEvent], stamp: Time
) -> DiagnosticArray:
    """Return the contacts that last, WARN, and those that have just ended, OK."""
    msg = DiagnosticArray()
    msg.header.stamp = stamp
    msg.status = [
        *(_status(event, DiagnosticStatus.WARN) for event in going),
        *(_status(event, DiagnosticStatus.OK) for event in ended),
    ]
    return msg


def _status(event: ContactEvent, level: bytes) -> DiagnosticStatus:
    first, now = event.first, event.now
    what = 'in contact' if level == DiagnosticStatus.WARN else 'contact has ended'
    values = {
        'force [N]': f'{now.force:.2f}',
        GREATEST_FORCE: f'{event.greatest_force:.2f}',
        'speed at contact [m/s]': f'{first.speed:.4f}',
        'approach at contact [m/s]': f'{first.approach:.4f}',
        'greatest speed [m/s]': f'{event.greatest_speed:.4f}',
        'depth [m]': f'{now.depth:.5f}',
        'duration [s]': f'{event.last - event.begin:.3f}',
        'place [m]': ' '.join(f'{x:.4f}' for x in now.place),
    }
    sentence = f'{what}: {event.greatest_force:.1f} N at most, {first.speed:.2f} m/s when it began'
    return status_to_msg(f'{first.bar}: {first.part}', level, sentence, values)
