# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Files that are there whole or not at all: written beside their place, then moved there."""

from collections.abc import Callable
import os
from pathlib import Path
import uuid


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """
    Have a file written beside its place, under a name that no pattern matches, then move it there.

    Raises
    ------
    OSError
        A file that cannot be written; what stood in its place before is as it was.

    """
    # It begins and ends otherwise, so that neither 'incident-*' nor '*.yaml' finds it.
    fresh = path.with_name(f'.{path.name}.{uuid.uuid4().hex[:8]}')
    try:
        write(fresh)
        with fresh.open('rb') as file:
            os.fsync(file.fileno())
        os.replace(fresh, path)
    finally:
        fresh.unlink(missing_ok=True)
