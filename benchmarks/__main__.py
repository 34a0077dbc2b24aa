# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Starts the benchmarks, or says what they miss: `./run exec python -m benchmarks`."""

from collections.abc import Callable
from importlib.util import find_spec
import sys

NEEDED = ('pyarrow', 'tqdm', 'psutil', 'matplotlib', 'fcl')
MISSING = """{}: not installed, and the benchmarks cannot run without; install what they need by
    ./run exec python -m pip install -r requirements/benchmark.txt"""


def main(find: Callable[[str], object] = find_spec) -> int:
    """Run the benchmarks unless a library is missing."""
    missing = [name for name in NEEDED if find(name) is None]
    if missing:
        print(MISSING.format(', '.join(missing)), file=sys.stderr)
        return 2
    from benchmarks.planners.main import main as run

    return run()


if __name__ == '__main__':
    sys.exit(main())
