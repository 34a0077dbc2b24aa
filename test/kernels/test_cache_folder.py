# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Where compiled kernels cannot be kept they stay in memory, with one warning."""

import os
import subprocess
import sys

import pytest

COMPILE = """
import numpy as np
from numba import float64
from rrth_planner.kernels import jit
@jit.kernel(float64(float64))
def twice(x):
    return 2.0 * x
@jit.kernel(float64(float64))
def thrice(x):
    return 3.0 * x
assert (twice(2.0), thrice(2.0)) == (4.0, 6.0)
"""
# As on a full disk: files can be made, but hold nothing.
FULL_DISK = """
import errno, os
import numba.core.caching as caching
from contextlib import contextmanager
@contextmanager
def full(self, path):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    yield
caching.IndexDataCacheFile._open_for_write = full
"""


def run(code, folder, tmp_path):
    """Return the lines that a script writes to stderr; it lies in a file, as numba asks."""
    script = tmp_path / 'script.py'
    script.write_text(code, encoding='utf-8')
    paths = os.pathsep.join(sys.path)
    ended = subprocess.run(
        [sys.executable, str(script)],
        env=os.environ | {'RRTH_CACHE_DIR': str(folder), 'PYTHONPATH': paths},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stderr.splitlines()


def warnings_in(lines):
    """Return the lines that are warnings."""
    return [line for line in lines if 'Warning' in line]


pytestmark = pytest.mark.skipif(
    os.environ.get('NUMBA_DISABLE_JIT', '0') != '0', reason='nothing is compiled'
)


def test_a_writable_folder_is_used_without_a_word(tmp_path):
    folder = tmp_path / 'cache'
    assert not warnings_in(run(COMPILE, folder, tmp_path))
    kept = [file.name for file in folder.rglob('*.nb*')]
    assert any('twice' in name for name in kept)
    assert any('thrice' in name for name in kept)


@pytest.mark.parametrize('where', ['below a file', '/proc'])
def test_a_folder_that_cannot_be_made_is_warned_of_once(tmp_path, where):
    folder = '/proc/nothing/here'
    if where == 'below a file':
        (tmp_path / 'file').touch()
        folder = tmp_path / 'file' / 'cache'
    elif not os.path.isdir('/proc/self'):
        pytest.skip('no /proc here')
    (line,) = warnings_in(run(COMPILE, folder, tmp_path))
    assert 'compiled kernels are not kept: ' in line
    assert str(folder) in line
    assert '(environment variable RRTH_CACHE_DIR)' in line


def test_a_full_disk_is_warned_of_once(tmp_path):
    (line,) = warnings_in(run(FULL_DISK + COMPILE, tmp_path / 'cache', tmp_path))
    assert 'compiled kernels are not kept: ' in line
    assert 'No space left on device' in line


def test_files_of_the_cache_that_were_cut_short_are_compiled_again(tmp_path):
    folder = tmp_path / 'cache'
    run(COMPILE, folder, tmp_path)
    for file in folder.rglob('*.nb*'):
        file.write_bytes(file.read_bytes()[:20])
    assert len(warnings_in(run(COMPILE, folder, tmp_path))) <= 1


def test_the_kinematics_of_an_arm_need_no_folder_either(tmp_path):
    code = """
import errno, os, pathlib
def full(self, *args, **kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
pathlib.Path.write_text = full
from rrth_planner.kernels import chain, jit
file = chain._kept('chain_of_a_test', 'text')
assert file is None and jit.cache_folder() is None
"""
    folder = tmp_path / 'cache'
    (line,) = warnings_in(run(code, folder, tmp_path))
    assert 'No space left on device' in line
    assert not list(folder.rglob('chain_of_a_test*'))


def test_what_was_loaded_has_no_module_until_other_code_is_compiled_against_it(tmp_path):
    ask = """
from numba import njit
(loaded,) = (result.library for result in twice.overloads.values())
print(loaded._shared_module is None, file=sys.stderr)
again = njit(lambda x: twice(x) + 1.0)
assert again(2.0) == 5.0
print(loaded._shared_module is None, file=sys.stderr)
"""
    folder, code = tmp_path / 'cache', f'import sys\n{COMPILE}{ask}'
    assert run(code, folder, tmp_path) == ['False', 'False']
    assert run(code, folder, tmp_path) == ['True', 'False']
