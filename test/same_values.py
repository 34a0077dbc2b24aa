# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What two values have in common: to the bit, and whether they can be changed."""

from collections.abc import Sequence
import dataclasses

import numpy as np


def parts_of(value):
    """Return the parts of a value by their names; of what has none, nothing."""
    if dataclasses.is_dataclass(value):
        return {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    if isinstance(value, dict):
        return value
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return dict(enumerate(value))
    return {}


def differences(one, other, name='value'):
    """Yield the names of the parts in which two values differ: numbers to the bit, NaN is NaN."""
    if type(one) is not type(other):
        yield f'{name}: {type(one).__name__}, {type(other).__name__}'
    elif isinstance(one, np.ndarray):
        is_same = one.dtype == other.dtype and one.shape == other.shape
        if not is_same or one.tobytes() != other.tobytes():
            yield name
    elif parts := parts_of(one):
        others = parts_of(other)
        if parts.keys() != others.keys():
            yield name
            return
        for key, part in parts.items():
            yield from differences(part, others[key], f'{name}.{key}')
    elif one is not other and one != other and not (one != one and other != other):
        yield name


def writable(value, name='value'):
    """Yield the names of the arrays within a value that can be written to."""
    if isinstance(value, np.ndarray) and value.flags.writeable:
        yield name
    for key, part in parts_of(value).items():
        yield from writable(part, f'{name}.{key}')


def values_within(value):
    """Yield a value and all dataclasses within it."""
    if dataclasses.is_dataclass(value):
        yield value
    for part in parts_of(value).values():
        yield from values_within(part)
