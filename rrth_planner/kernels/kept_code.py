# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels as files: code, which is run as it is found, so nobody else may write it."""

from collections.abc import Callable
import contextlib
import functools
import hashlib
import os
from pathlib import Path
import pickle
import stat
import tempfile
from typing import Any

from numba import config
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary, ll
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
DIGEST_SIZE = hashlib.sha256().digest_size


def private_folder(path: Path) -> Path:
    """
    Return a folder, made if it is not there, to which nobody but this user can write.

    Nor can anybody put another one in its place: the folders above it belong to this user or to
    root, and others cannot write to them, or, as in /tmp, only move what is their own. Raises
    OSError where there is no such folder, and none can be made.
    """
    _make(path)
    # What a link leads to may be changed later; where it leads to now is known.
    folder = path.resolve(strict=True)
    for place in (folder, *folder.parents):
        info = place.stat()
        if info.st_uid != os.geteuid() and (place == folder or info.st_uid != 0):
            raise PermissionError(f'{place} belongs to user {info.st_uid}')
        is_sticky = place != folder and info.st_mode & stat.S_ISVTX
        if info.st_mode & OTHERS_WRITE and not is_sticky:
            mode = stat.S_IMODE(info.st_mode)
            raise PermissionError(f'others can write to {place} (mode {mode:04o})')
    if not os.access(folder, os.W_OK):
        raise PermissionError('not writable')
    return folder


def _make(folder: Path) -> None:
    """Make a folder, and those above it that are not there, for this user only."""
    if not folder.is_dir():
        _make(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def read_whole(file: Path) -> bytes | None:
    """Return what `write_whole` wrote; None where that is not there, damaged or another user's."""
    try:
        with open(file, 'rb', opener=_open_file) as stream:
            info, content = os.fstat(stream.fileno()), stream.read()
    except OSError:
        return None
    digest, data = content[:DIGEST_SIZE], content[DIGEST_SIZE:]
    # What others left there before the folder was this user's alone.
    is_own = info.st_uid == os.geteuid() and not info.st_mode & OTHERS_WRITE
    return data if is_own and hashlib.sha256(data).digest() == digest else None


def _open_file(file: str, flags: int) -> int:
    return os.open(file, flags | os.O_NOFOLLOW)


def write_whole(file: Path, data: bytes) -> None:
    """Write a file that only this user can read, at once or not at all, with its digest."""
    descriptor, draft = tempfile.mkstemp(prefix=f'{file.name}.', dir=file.parent)
    try:
        with open(descriptor, 'wb') as stream:
            stream.write(hashlib.sha256(data).digest())
            stream.write(data)
        os.replace(draft, file)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(draft)
        raise


class KeptCode(NullCache):
    """
    The file with the code of one kernel, by numba's protocol of a cache.

    numba's own cache trusts its files: a truncated one crashes the program, a changed one changes
    what it does. The folder is private, and another one for each state of the sources of all
    kernels: that a kernel of another file has changed is not seen here. `miss` is called with a
    function whose code is missing, before it is compiled, `give_up` with an OSError that prevented
    the code from being written.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        folder: Path,
        miss: Callable[[Callable[..., Any]], None],
        give_up: Callable[[OSError], None],
    ) -> None:
        self._function, self._folder = function, folder
        self._miss, self._give_up = miss, give_up

    def _file(self, signature: Any, codegen: Any) -> Path:
        """Return the file of the code for one signature and processor."""
        function = self._function
        closure = dumps(tuple(cell.cell_contents for cell in function.__closure__ or ()))
        # Code that checks bounds is other code.
        key = (signature, codegen.magic_tuple(), config.BOUNDSCHECK, _source(function), closure)
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        name = f'{function.__module__}.{function.__qualname__}'.replace('<', '').replace('>', '')
        return self._folder / f'{name}-{digest}.code'

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the code for a signature; None where it is to be compiled."""
        # Of all that a context is made of, code that is compiled already needs the runtime only.
        rtsys.initialize(context)
        data = read_whole(self._file(signature, context.codegen()))
        # What is whole may be of other versions of what it is made of.
        with contextlib.suppress(Exception):
            if data is not None:
                return CompileResult._rebuild(context, *pickle.loads(data))
        self._miss(self._function)
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the code for a signature."""
        if result.library.has_dynamic_globals:
            return
        file = self._file(signature, result.codegen)
        try:
            write_whole(file, dumps(result._reduce()))
        except OSError as problem:
            self._give_up(problem)


def _source(function: Callable[..., Any]) -> tuple[Any, ...]:
    """Return a key of a function and of the state of its source."""
    code = function.__code__
    generated = (code.co_code, code.co_consts, code.co_names)
    return code.co_firstlineno, _digest(code.co_filename) or generated


@functools.cache
def _digest(file: str) -> str:
    """Return the digest of a file, '' where there is none: the source was generated."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:
        return ''


class SlimLibrary(JITCodeLibrary):
    """
    The code of a kernel that is loaded, and its module once others are compiled against it.

    numba itself unpacks the module of each kernel that it loads, looks through all its symbols,
    and keeps it. A process that plans and never compiles anything would spend a second of its
    start on that, and 45 of 235 MB.
    """

    _bitcode: bytes | None = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != 'object':
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        code, library._bitcode = data
        codegen._engine._ee.add_object_file(ll.ObjectFileRef.from_data(code))
        library._finalized = True
        return library

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function of this library, 0 where it is not there."""
        if self._bitcode is None:
            return super().get_pointer_to_function(name)
        return self._codegen._engine.get_function_address(name)

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None and self._bitcode is not None:
            self._shared_module = ll.parse_bitcode(self._bitcode)
        return super()._get_module_for_linking()


def use_slim_libraries() -> None:
    """Have numba load all further code of this process so."""
    cpu_target.target_context.codegen()._library_class = SlimLibrary
