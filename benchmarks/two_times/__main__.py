# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""
Take a course through real nodes, and the same one in virtual time, and compare the decisions.

In virtual time bodies, joint positions and checks come when they came, and plans take as long as
they took; all else is the rehearsal's.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
import tempfile

import rclpy
from tqdm import tqdm

from benchmarks.two_times.comparison import compared
from benchmarks.two_times.real import course_of
from benchmarks.two_times.virtual import again

MOST_SHOWN = 20


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print what was found, and return 1 where less than nearly all is the same."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--requests', type=int, default=100, help='how many (default 100)')
    parser.add_argument('--seed', type=int, default=0, help='of the targets (default 0)')
    options = parser.parse_args(arguments)
    rclpy.init()
    with (
        tempfile.TemporaryDirectory() as folder,
        tqdm(total=options.requests, file=sys.stderr, disable=None) as bar,
    ):
        course = course_of(Path(folder), options.requests, options.seed, lambda: bar.update())
    rclpy.shutdown()
    found = compared(course, *again(course))
    print(f'answers with the same code: {found.n_same_answers} of {found.n_answers}')
    print(
        f'motions that begin: {found.n_same_motions} of {found.n_motions} the same, '
        f'{found.farthest:.2g} rad apart at most'
    )
    print(f'bodies and ticks with the same decision: {found.n_same_checks} of {found.n_checks}')
    print('\n'.join(found.differences[:MOST_SHOWN]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
