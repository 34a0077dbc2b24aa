# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels as files: code, which is run as it is found, so nobody else may write it."""

from collections.abc import Callable, Iterator
import contextlib
import functools
import hashlib
import itertools
import os
from pathlib import Path
import pickle
import stat
import tempfile
from typing import Any, ClassVar
from weakref import WeakValueDictionary

from numba import config
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary, ll
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
DIGEST_SIZE = hashlib.sha256().digest_size
# Longer kernels are called by name [lines of LLVM's text, most of them an instruction]: the
# compiler would inline hardly any of them, since it counts 5 each and inlines up to 275.
LONGEST_COPIED = 200


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
    the code from being written. is_inlined: its callers are given a copy, however long it is.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        is_inlined: bool,
        folder: Path,
        miss: Callable[[Callable[..., Any]], None],
        give_up: Callable[[OSError], None],
    ) -> None:
        self._function, self._is_inlined, self._folder = function, is_inlined, folder
        self._miss, self._give_up = miss, give_up

    def _key(self, signature: Any, codegen: Any) -> str:
        """Return 16 hexadecimal digits for the source, one signature and processor."""
        function = self._function
        closure = dumps(tuple(cell.cell_contents for cell in function.__closure__ or ()))
        # Code that checks bounds is other code.
        key = (signature, codegen.magic_tuple(), config.BOUNDSCHECK, _source(function), closure)
        return hashlib.sha256(repr(key).encode()).hexdigest()[:16]

    def _file(self, key: str) -> Path:
        function = self._function
        name = f'{function.__module__}.{function.__qualname__}'.replace('<', '').replace('>', '')
        return self._folder / f'{name}-{key}.code'

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the code for a signature; None where it is to be compiled."""
        # Of all that a context is made of, code that is compiled already needs the runtime only.
        rtsys.initialize(context)
        key = self._key(signature, context.codegen())
        data = read_whole(self._file(key))
        # What is whole may be of other versions of what it is made of.
        with contextlib.suppress(Exception):
            if data is not None:
                entry, calls, parts = pickle.loads(data)
                require_kernels(calls)
                result = CompileResult._rebuild(context, *parts)
                result.library.name_calls(entry, calls)
                return result
        self._miss(self._function)
        # Part of the name of the code, by which others call it: the same in all processes.
        FunctionIdentity._unique_ids = itertools.count(int(key, 16))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the code for a signature."""
        if result.library.has_dynamic_globals:
            return
        file = self._file(self._key(signature, result.codegen))
        library, entry = result.library, result.fndesc.llvm_func_name
        if self._is_inlined or not library.is_long(entry):
            entry = ''
        library.name_calls(entry, library.calls)
        try:
            write_whole(file, dumps((entry, library.calls, result._reduce())))
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
    The code of a kernel: long ones are called by name, and what is loaded is not unpacked.

    numba copies the code of a kernel into that of each other one which calls it, and optimizes
    and translates it there once more, which is a third of all compiling. It also unpacks the
    module of each kernel that it loads, looks through all its symbols, and keeps it: a process
    that plans and never compiles anything would spend a second of its start on that, and 45 of
    235 MB.
    """

    # Whether what is compiled now calls long kernels by name. The code of others gets copies: it
    # may be kept, and loaded where these kernels have other names.
    is_calling_by_name: ClassVar[bool] = False
    # The long kernels of this process by their names.
    _long: ClassVar[WeakValueDictionary[str, 'SlimLibrary']] = WeakValueDictionary()
    # Of code that was loaded.
    _bitcode: bytes | None = None

    def __init__(self, codegen: Any, name: str) -> None:
        """Begin with no code."""
        super().__init__(codegen, name)
        self._is_calling_by_name = self.is_calling_by_name
        # Its name, '' where callers get a copy; and the names that it calls.
        self.entry, self.calls = '', frozenset[str]()

    def is_long(self, function: str) -> bool:
        """Return whether a function of this library is to be called by name."""
        return str(self._final_module.get_function(function)).count('\n') > LONGEST_COPIED

    def name_calls(self, entry: str, calls: frozenset[str]) -> None:
        """Set by which name this kernel is called, '' for none, and which names it calls."""
        self.entry, self.calls = entry, calls
        if entry:
            self._long[entry] = self

    def _optimize_functions(self, ll_module: Any) -> None:
        """Do nothing: a module is optimized as a whole, once it contains all that it calls."""
        if self._is_calling_by_name:
            ll_module.data_layout = self._codegen._data_layout
        else:
            super()._optimize_functions(ll_module)

    def add_linking_library(self, library: Any) -> None:
        """Add what is called: by name, or its code, with that of all that it calls."""
        library._ensure_finalized()
        if isinstance(library, SlimLibrary):
            if self._is_calling_by_name:
                if library.entry:
                    self.calls |= {library.entry}
                    return
                self.calls |= library.calls
            else:
                for name in library.calls:
                    self.add_linking_library(self._long[name])
        super().add_linking_library(library)

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


@contextlib.contextmanager
def calling_by_name() -> Iterator[None]:
    """Have what this thread compiles meanwhile call long kernels by name."""
    with global_compiler_lock:
        before = SlimLibrary.is_calling_by_name
        SlimLibrary.is_calling_by_name = True
        try:
            yield
        finally:
            SlimLibrary.is_calling_by_name = before


def require_kernels(names: frozenset[str]) -> None:
    """Raise LookupError unless kernels are there: code that calls others ends the process."""
    if missing := names.difference(SlimLibrary._long):
        raise LookupError(f'kernels {sorted(missing)} are not loaded')


def use_slim_libraries() -> None:
    """
    Have numba load all further code of this process so.

    Once: what numba has unpickled it does not unpickle again, so kernels that are loaded a second
    time would be of the types of the first.
    """
    codegen = cpu_target.target_context.codegen()
    if codegen._library_class is not JITCodeLibrary:
        raise ImportError(
            'rrth_planner.kernels: imported a second time in this process, expected once, since '
            'compiled code is not loaded twice: leave rrth_planner.kernels and its modules in '
            'sys.modules, or start a new process'
        )
    codegen._library_class = SlimLibrary
