# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Validation of the entries of files: each has the expected type, or is rejected."""

from collections.abc import Collection, Mapping
import math
from typing import Any

import numpy as np
from rrth_planner.model.arrays import float_number
from rrth_planner.model.errors import RrthError, shown


def mapping(
    value: Any,
    name: str,
    wanted: Collection[str],
    error: type[RrthError],
    optional: Collection[str] = (),
) -> dict[str, Any]:
    """
    Return a mapping with all wanted entries, optional ones, and no others.

    Anything else raises an error of the given type in which it is called `name`; likewise below.
    """
    if not isinstance(value, Mapping):
        raise error(f'{name}: {shown(value)}, expected a mapping with {", ".join(wanted)}')
    missing = [key for key in wanted if key not in value]
    if missing:
        raise error(f'{name}: no {", ".join(missing)}, expected {", ".join(wanted)}')
    known = [*wanted, *optional]
    # An unknown key, e.g. a misspelt radius, must not be ignored silently.
    unknown = [str(key) for key in value if key not in known]
    if unknown:
        raise error(f'{name}: {", ".join(unknown)}, expected only {", ".join(known)}')
    return dict(value)


def sequence(value: Any, name: str, error: type[RrthError]) -> list[Any]:
    """Return a list, or raise."""
    if not isinstance(value, list):
        raise error(f'{name}: {shown(value)}, expected a list')
    return value


def number(value: Any, name: str, unit: str, error: type[RrthError]) -> float:
    """Return a finite number, or raise; true and "1" are none."""
    found = float_number(value, name, unit, error=error)
    if not math.isfinite(found):
        raise error(f'{name}: {shown(value)}, expected a number [{unit}]')
    return found


def whole(value: Any, name: str, error: type[RrthError]) -> int:
    """Return a whole number, or raise."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise error(f'{name}: {shown(value)}, expected a whole number')
    return int(value)


def text(value: Any, name: str, error: type[RrthError]) -> str:
    """Return a text, or raise."""
    if not isinstance(value, str):
        raise error(f'{name}: {shown(value)}, expected a text')
    return value
