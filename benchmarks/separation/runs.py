# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Independent runs, one after the other or in processes beside each other, with a bar for them."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
import functools
import multiprocessing
import os
import sys
from typing import TypeVar

from tqdm import tqdm

T = TypeVar('T')
# A process each is enough: threads of products of small matrices only wait for each other.
ONE_THREAD = {'OPENBLAS_NUM_THREADS': '1', 'OMP_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1'}


def each(
    run: Callable[..., T], items: Sequence[object], jobs: int, what: str, *given: object
) -> list[T]:
    """Return run(*given, item) of each item, in their order, by so many processes."""
    one = functools.partial(run, *given)
    bar = functools.partial(
        tqdm, total=len(items), desc=what, file=sys.stderr, leave=False, disable=None
    )
    if jobs == 1:
        return list(bar(map(one, items)))
    # They read it where they begin.
    os.environ.update(ONE_THREAD)
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context('spawn')) as pool:
        return list(bar(pool.map(one, items)))
