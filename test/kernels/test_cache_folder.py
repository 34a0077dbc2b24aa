# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels are code: kept where nobody else can write, taken back only if whole."""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from rrth_planner.kernels.jit import cache_folder
from rrth_planner.kernels.kept_code import private_folder, read_whole, write_whole
from rrth_planner.kernels.search.elastic_band import relax

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
def full(*args):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
os.replace = full
"""


# The kinematics of an arm of one joint and one link, of that length.
CHAIN = """
import sys
import numpy as np
from rrth_planner.kernels import layout
from rrth_planner.kernels.kinematics.generated_fk import chain_of
from rrth_planner.kernels.kept_code import KeptCode
compiled = []
save = KeptCode.save_overload
def note(self, signature, result):
    compiled.append(self._function.__name__)
    save(self, signature, result)
KeptCode.save_overload = note
rows = np.zeros((4, layout.REACH + 2))
rows[:2, layout.COS_ALPHA] = 1.0
rows[:2, [layout.RADIUS_A, layout.RADIUS_D]] = layout.NO_BAR
rows[1, [layout.A, layout.RADIUS_A]] = LENGTH, 0.0
rows[2, [layout.N_BARS, layout.STRIDE, layout.FRAMES, layout.FIRST_PAIR]] = 1, 8, 8, 4
rows[3, layout.LINK] = layout.NO_BAR
points = np.zeros(12)
chain_of(rows)(np.zeros(1), 0.0, points, 0)
print(points[4], *compiled, file=sys.stderr)
"""

# The planner's own kernels, of which these take little time.
OWN = """
import sys
import rrth_planner.kernels.kinematics.trigonometry
print('done', file=sys.stderr)
"""
# A kernel that is kept, and another one that calls it once there is a file `more`.
CALLER = """
import os, sys
from pathlib import Path
from numba import float64
import numpy as np
from rrth_planner.kernels import jit
@jit.kernel(float64(float64))
def root_sum(x):
    return (x + x) ** 0.5 if x > 0.0 else -1.0
assert root_sum(8.0) == 4.0 and root_sum(-8.0) == -1.0
@jit.kernel(jit.CHAIN.signature)
def count(q, ray_length, points, at):
    return at + q.shape[0]
if Path(os.environ['RRTH_CACHE_DIR'], 'more').exists():
    @jit.kernel(float64(float64))
    def again(x):
        return 1.0 + root_sum(x)
    assert again(8.0) == 5.0
    seam = jit.first_class(count)
    assert seam(np.zeros(3), 1.0, np.zeros(3), 4) == 7 and seam.address
print('scipy.linalg' in sys.modules, file=sys.stderr)
"""
# A kernel that another one calls by its name, though it is short, that one, and code of others.
NAMED = """
import os, sys
from pathlib import Path
from numba import float64, njit
from rrth_planner.kernels import jit, kept_code
is_copied = Path(os.environ['RRTH_CACHE_DIR'], 'copied').exists()
kept_code.LONGEST_COPIED = 10**9 if is_copied else 0
compiled = []
save = kept_code.KeptCode.save_overload
def note(self, signature, result):
    compiled.append(self._function.__name__)
    save(self, signature, result)
kept_code.KeptCode.save_overload = note
@jit.kernel(float64(float64), is_inner=True)
def half(x):
    return 0.5 * x
@jit.kernel(float64(float64))
def quarter(x):
    return 0.5 * half(x)
def names(function):
    return len(function.overloads[float64,].library.calls)
other = njit(lambda x: quarter(x) + half(x))
assert quarter(8.0) == 2.0 and other(8.0) == 6.0 and not names(other)
print(names(quarter), *compiled, file=sys.stderr)
"""
# What both processes of a planner load.
PLANNER = """
import sys
import rrth_planner.execution.warm_up
import rrth_planner.pipeline.in_process_planner
print([m for m in ('numba.np.linalg', 'scipy.linalg') if m in sys.modules], file=sys.stderr)
"""
SILENT = "import logging; logging.getLogger('rrth_planner').setLevel(logging.ERROR)"

# What processes for one script each are forked from: all that it has loaded they need not load,
# and nothing of the planner is among it.
FORK_SERVER = """
import json, os, runpy, signal, sys, traceback
import numba
for line in sys.stdin:
    script, folder, told = json.loads(line)
    if child := os.fork():
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
        continue
    code = 1
    try:
        signal.alarm(120)
        os.dup2(os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), 2)
        os.environ['RRTH_CACHE_DIR'] = folder
        runpy.run_path(script, run_name='__main__')
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)
"""
# Half of the time of a script that compiles is the compiler's own start.
WARM = 'numba.njit(lambda x: 2.0 * x)(1.0)'


def in_process(code, folder, tmp_path, **variables):
    """Return the lines that a script writes to stderr; it lies in a file, as numba asks."""
    script = tmp_path / 'script.py'
    script.write_text(code, encoding='utf-8')
    ended = subprocess.run(
        [sys.executable, str(script)],
        env=environment() | {'RRTH_CACHE_DIR': str(folder)} | variables,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stderr.splitlines()


def environment():
    """Return the environment of a process that finds what this one finds."""
    return os.environ | {'PYTHONPATH': os.pathsep.join(sys.path)}


@contextmanager
def fork_server(code):
    """Give what `in_process` is, for scripts that do not mind what a process has loaded before."""

    def forked(code, folder, tmp_path):
        script, told = tmp_path / 'script.py', tmp_path / 'told.txt'
        script.write_text(code, encoding='utf-8')
        print(json.dumps([str(script), str(folder), str(told)]), file=server.stdin, flush=True)
        ended, lines = server.stdout.readline().strip(), told.read_text(encoding='utf-8')
        assert ended == '0', lines
        return lines.splitlines()

    with subprocess.Popen(
        [sys.executable, '-c', code],
        env=environment(),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as server:
        yield forked


@pytest.fixture(scope='module', name='run')
def _run() -> Iterator[object]:
    """Give what runs a script where the compiler has been used before."""
    with fork_server(FORK_SERVER.replace('import numba\n', f'import numba\n{WARM}\n')) as run:
        yield run


@pytest.fixture(scope='module', name='run_cold')
def _run_cold() -> Iterator[object]:
    """Give what runs a script where numba is loaded, but has compiled nothing."""
    with fork_server(FORK_SERVER) as run:
        yield run


@pytest.fixture(scope='module', name='first_time')
def _first_time(tmp_path_factory: pytest.TempPathFactory) -> tuple[object, list[str]]:
    """Give a folder as `COMPILE` leaves it that is run for the first time, and what it wrote."""
    place = tmp_path_factory.mktemp('first')
    folder = place / 'new' / 'cache'
    return folder, in_process(COMPILE, folder, place)


@pytest.fixture(name='filled')
def _filled(tmp_path: object, first_time: tuple[object, list[str]]) -> object:
    """Give a folder of this test's own, as `COMPILE` leaves it."""
    folder = tmp_path / 'above' / 'cache'
    shutil.copytree(first_time[0].parent, folder.parent)
    return folder


def warnings_in(lines):
    """Return the lines that are warnings."""
    return [line for line in lines if 'Warning' in line]


pytestmark = pytest.mark.skipif(
    os.environ.get('NUMBA_DISABLE_JIT', '0') != '0', reason='nothing is compiled'
)


def code_in(folder):
    """Return the files of compiled kernels in a folder."""
    return sorted(folder.rglob('*.code'))


def test_a_folder_of_ones_own_is_used_without_a_word(first_time):
    folder, lines = first_time
    assert not warnings_in(lines)
    first, second = code_in(folder)
    assert (first.name.split('-')[0], second.name.split('-')[0]) == (
        '__main__.thrice',
        '__main__.twice',
    )
    for made in (folder.parent, folder, first.parent):
        assert made.stat().st_mode & 0o777 == 0o700
    assert first.stat().st_mode & 0o777 == 0o600


def test_a_kept_kernel_is_called_by_one_that_is_compiled_later(tmp_path, run_cold):
    folder = tmp_path / 'cache'
    assert run_cold(CALLER, folder, tmp_path) == ['True']
    assert run_cold(CALLER, folder, tmp_path) == ['False']
    (folder / 'more').touch()
    assert run_cold(CALLER, folder, tmp_path) == ['True']
    assert len(code_in(folder)) == 3
    assert run_cold(CALLER, folder, tmp_path) == ['False']


def test_a_long_kernel_is_called_by_name_and_never_one_that_is_not_there(tmp_path, run):
    folder = tmp_path / 'cache'
    assert run(NAMED, folder, tmp_path) == ['1 half quarter']
    assert run(NAMED, folder, tmp_path) == ['1']
    (half,) = folder.rglob('*half*.code')
    half.unlink()
    # The same name as before, whichever process compiles it.
    assert run(NAMED, folder, tmp_path) == ['1 half']
    half.unlink()
    (folder / 'copied').touch()
    assert run(NAMED, folder, tmp_path) == ['0 half quarter']


def test_a_kernel_that_only_kernels_call_is_not_called_from_python():
    with pytest.raises(TypeError, match='relax is called by other kernels only'):
        relax(np.zeros((3, 4)), 3, np.zeros(1), 0.5, np.zeros((1, 4)))


def test_a_planner_whose_kernels_are_kept_loads_nothing_of_the_compiler(tmp_path):
    kept = cache_folder().parent
    # They may not be kept yet the first time.
    loaded = in_process(SILENT + PLANNER, kept, tmp_path)
    assert loaded == ['[]'] or in_process(SILENT + PLANNER, kept, tmp_path) == ['[]']


def test_that_kernels_are_compiled_is_logged_once_a_machine(tmp_path, run):
    told = 'compiling kernels, once for this machine: takes up to two minutes'
    assert run(OWN, tmp_path / 'cache', tmp_path) == [told, 'done']
    assert run(OWN, tmp_path / 'cache', tmp_path) == ['done']
    assert run(SILENT + OWN, tmp_path / 'other', tmp_path) == ['done']
    *_, line, done = run(OWN, '/proc/nothing/here', tmp_path)
    assert (line, done) == (told.replace('once for this machine', 'at every start'), 'done')


@pytest.mark.parametrize('where', ['below a file', '/proc'])
def test_a_folder_that_cannot_be_made_is_warned_of_once(tmp_path, run, where):
    folder = '/proc/nothing/here'
    if where == 'below a file':
        (tmp_path / 'file').touch()
        folder = tmp_path / 'file' / 'cache'
    elif not os.path.isdir('/proc/self'):
        pytest.skip('no /proc here')
    (line,) = warnings_in(run(COMPILE, folder, tmp_path))
    assert 'compiled kernels are not kept: ' in line
    assert str(folder) in line
    assert 'environment variable RRTH_CACHE_DIR' in line


def test_a_full_disk_is_warned_of_once(tmp_path, run):
    folder = tmp_path / 'cache'
    (line,) = warnings_in(run(FULL_DISK + COMPILE, folder, tmp_path))
    assert 'compiled kernels are not kept: ' in line
    assert 'No space left on device' in line
    # Nor is anything left behind.
    assert not [file for file in folder.rglob('*') if file.is_file()]


@pytest.mark.parametrize('open_place', ['cache', 'above'])
def test_a_folder_that_others_can_write_to_is_warned_of_and_not_used(
    tmp_path, run, filled, open_place
):
    folder, above = filled, filled.parent
    (kernels,) = folder.iterdir()
    (kernels if open_place == 'cache' else above).chmod(0o770)
    before = {file: file.stat().st_mtime_ns for file in code_in(folder)}
    for file in before:
        file.unlink()
    (line,) = warnings_in(run(COMPILE, folder, tmp_path))
    place = kernels if open_place == 'cache' else above
    assert f'others can write to {place} (mode 0770)' in line
    assert 'chmod go-w' in line
    assert not code_in(folder)


def test_a_folder_is_private_if_nobody_else_can_write_to_it_or_exchange_it(tmp_path):
    assert private_folder(tmp_path / 'a' / 'b') == (tmp_path / 'a' / 'b').resolve()
    # Others cannot rename what is not theirs where they may only add to a folder, as in /tmp.
    (tmp_path / 'a').chmod(0o1777)
    private_folder(tmp_path / 'a' / 'b')
    (tmp_path / 'a').chmod(0o777)
    with pytest.raises(OSError, match='others can write to .*/a '):
        private_folder(tmp_path / 'a' / 'b')
    (tmp_path / 'a').chmod(0o755)
    for mode in (0o720, 0o702, 0o1777):
        (tmp_path / 'a' / 'b').chmod(mode)
        with pytest.raises(OSError, match='others can write to .*/b '):
            private_folder(tmp_path / 'a' / 'b')


def test_a_folder_is_judged_by_where_links_lead_to(tmp_path):
    (tmp_path / 'open').mkdir()
    (tmp_path / 'open').chmod(0o777)
    (tmp_path / 'open' / 'mine').mkdir(mode=0o700)
    (tmp_path / 'link').symlink_to(tmp_path / 'open' / 'mine')
    with pytest.raises(OSError, match='others can write to .*/open '):
        private_folder(tmp_path / 'link')
    (tmp_path / 'open').chmod(0o755)
    assert private_folder(tmp_path / 'link').name == 'mine'
    (tmp_path / 'nowhere').symlink_to(tmp_path / 'missing' / 'cache')
    with pytest.raises(OSError):
        private_folder(tmp_path / 'nowhere')


def test_what_belongs_to_another_user_is_not_used(tmp_path, monkeypatch):
    folder = private_folder(tmp_path / 'kernels')
    write_whole(folder / 'kernel', b'code')
    me = os.geteuid()
    monkeypatch.setattr(os, 'geteuid', lambda: me + 1)
    assert read_whole(folder / 'kernel') is None
    with pytest.raises(OSError, match=f'{folder} belongs to user {me}'):
        private_folder(folder)


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can give a folder to another user')
def test_the_folders_above_may_belong_to_root_but_to_no_third_user(tmp_path, monkeypatch):
    folder = private_folder(tmp_path / 'above' / 'kernels')
    os.chown(folder, 12345, -1)
    monkeypatch.setattr(os, 'geteuid', lambda: 12345)
    assert private_folder(folder) == folder
    os.chown(folder.parent, 12346, -1)
    with pytest.raises(OSError, match=f'{folder.parent} belongs to user 12346'):
        private_folder(folder)


def test_a_file_is_taken_back_only_if_it_is_whole_and_written_by_nobody_else(tmp_path):
    file, data = tmp_path / 'kernel', bytes(range(256)) * 40
    write_whole(file, data)
    assert read_whole(file) == data
    whole = file.read_bytes()
    for n in (0, 1, 31, 32, 33, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:n])
        assert read_whole(file) is None
        flipped = bytearray(whole)
        flipped[n] ^= 1
        file.write_bytes(flipped)
        assert read_whole(file) is None
    file.write_bytes(whole + b'0')
    assert read_whole(file) is None
    file.write_bytes(whole)
    assert read_whole(file) == data
    for mode in (0o620, 0o602):
        file.chmod(mode)
        assert read_whole(file) is None
    file.unlink()
    assert read_whole(file) is None
    write_whole(tmp_path / 'other', data)
    file.symlink_to(tmp_path / 'other')
    assert read_whole(file) is None
    write_whole(file, data)
    assert read_whole(file) == data
    assert not file.is_symlink()


DAMAGES = {
    'cut': lambda content: content[: len(content) // 2],
    'empty': lambda content: b'',
    'rotten': lambda content: content[:5000] + bytes([content[5000] ^ 4]) + content[5001:],
    'another file': lambda content: b'all of it is something else',
}


@pytest.mark.parametrize('damage', DAMAGES)
def test_damaged_code_is_made_anew_without_a_word(tmp_path, run, filled, damage):
    before = {file: file.read_bytes() for file in code_in(filled)}
    for file, content in before.items():
        file.write_bytes(DAMAGES[damage](content))
    assert not run(COMPILE, filled, tmp_path)
    assert list(before) == code_in(filled)
    for file in before:
        assert read_whole(file) is not None


def test_code_of_other_versions_of_what_it_is_made_of_is_made_anew(tmp_path, run, filled):
    for file in code_in(filled):
        write_whole(file, b'cno_such_module\nname\n.')
    assert not run(COMPILE, filled, tmp_path)
    assert all(b'no_such_module' not in file.read_bytes() for file in code_in(filled))


def test_an_edited_kernel_is_compiled_anew(tmp_path, run, filled):
    edited = COMPILE.replace('2.0 * x', '2.0 + x').replace('3.0 * x', 'x - 3.0')
    run(edited.replace('(4.0, 6.0)', '(4.0, -1.0)'), filled, tmp_path)
    assert len(code_in(filled)) == 4


def test_code_that_checks_bounds_is_other_code(tmp_path, filled):
    # The script is the same.
    in_process(COMPILE, filled, tmp_path, NUMBA_BOUNDSCHECK='1')
    assert len(code_in(filled)) == 4


def test_the_kinematics_of_an_arm_are_kept_as_code_and_never_read_as_text(tmp_path, run):
    folder = tmp_path / 'cache'
    short, long = CHAIN.replace('LENGTH', '0.25'), CHAIN.replace('LENGTH', '0.75')
    assert run(short, folder, tmp_path)[-1].split()[0] == '0.25'
    (line,) = run(short, folder, tmp_path)
    assert line == '0.25', 'compiled again'
    assert run(long, folder, tmp_path) == ['0.75 chain']
    assert not list(folder.rglob('*.py'))


def test_the_kinematics_of_an_arm_need_no_folder_either(tmp_path, run):
    (tmp_path / 'file').touch()
    line = run(CHAIN.replace('LENGTH', '0.25'), tmp_path / 'file' / 'cache', tmp_path)[-1]
    assert line.split() == ['0.25']


def test_what_was_loaded_has_no_module_until_other_code_is_compiled_against_it(tmp_path, run):
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
