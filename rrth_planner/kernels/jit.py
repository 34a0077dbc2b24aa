# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Argument types and the one decorator of the compiled kernels."""

from collections.abc import Callable
import contextlib
import functools
import hashlib
from importlib import import_module
import logging
import os
from pathlib import Path
from pickle import PicklingError
import sys
from typing import Any, NamedTuple
import warnings

import numba
from numba import config, njit, types
from numba.core import cgutils
from numba.core.registry import CPUDispatcher
from numba.core.types import float64, int32, int64
from numba.experimental.function_type import _get_wrapper_address
from numba.extending import intrinsic
import numpy as np
from rrth_planner.kernels.kept_code import (
    calling_by_name,
    KeptCode,
    private_folder,
    use_slim_libraries,
)
from rrth_planner.kernels.type_resolution import resolving_once

# Read-only types accept writable arrays too, and the compiler rejects writes to them:
# a signature distinguishes inputs (VEC, MAT) from outputs (OUT_...). Edge checks take what
# describes a world as single arguments: in a tuple it costs them 6 to 16 ns more a call.
VEC = types.Array(float64, 1, 'C', readonly=True)
MAT = types.Array(float64, 2, 'C', readonly=True)
READ_INTS = types.Array(int64, 1, 'C', readonly=True)
OUT_VEC = types.Array(float64, 1, 'C')
OUT_MAT = types.Array(float64, 2, 'C')
CUBE = types.Array(float64, 3, 'C', readonly=True)
OUT_CUBE = types.Array(float64, 3, 'C')
CUBES = types.Array(float64, 4, 'C', readonly=True)
OUT_CUBES = types.Array(float64, 4, 'C')
OUT_INTS = types.Array(int64, 1, 'C')
OUT_INT_MAT = types.Array(int64, 2, 'C')
OUT_INT_CUBE = types.Array(int64, 3, 'C')
RNG = types.Array(types.uint64, 1, 'C')
OUT_POOL = types.Array(int32, 1, 'C')

# An arm's forward kinematics: (q, ray_length, points, at) -> number of bars (`generated_fk.py`).
CHAIN = types.FunctionType(int64(VEC, float64, OUT_VEC, int64))

# The seam between planning and geometry: (q_from, q_to, resolution, chain, robot, obstacles)
# -> is the straight edge between the two configurations free?
EDGE_CHECK = types.FunctionType(types.boolean(VEC, VEC, float64, CHAIN, MAT, MAT))

# A second one: (q, chain, robot, obstacles) -> radius of a ball of joint space round q that is
# free [rad].
FREE_RADIUS = types.FunctionType(float64(VEC, CHAIN, MAT, MAT))

# Contacts of an edge with obstacles: (q_from, q_to, chain, robot, obstacles, contacts) -> how many
# rows of `contacts` were written (`edge_contacts.py`).
CONTACTS = types.FunctionType(int64(VEC, VEC, CHAIN, MAT, MAT, OUT_MAT))


class Space(NamedTuple):
    """A world as searches hand it on; from Python all its arrays are read-only."""

    functions: Any
    resolution: float
    robot: Any
    obstacles: Any
    bounds: Any


SPACE = types.NamedTuple([READ_INTS, float64, MAT, MAT, MAT], Space)


class Arm(NamedTuple):
    """An arm as kernels that Python calls take it: address of its chain, rows, joints per bar."""

    chain: Any
    robot: Any
    joints: Any


class Body(NamedTuple):
    """
    A wearer as he was seen.

    boxes (m, 15), allowed (m,) and T_arm_base (4, 4) as for `boxes.rows_of`; by how much each box
    is grown at time t: the least of its lines g + w t, growths and speeds (m, n) [m, m/s].
    """

    boxes: Any
    allowed: Any
    T_arm_base: Any
    growths: Any
    speeds: Any


class Points(NamedTuple):
    """
    The points of a motion.

    times (n,) [s], n > 1; positions, velocities and accelerations (n, dof).
    """

    times: Any
    positions: Any
    velocities: Any
    accelerations: Any


# As `Space`: from Python all their arrays are read-only.
ARM = types.NamedTuple([int64, MAT, READ_INTS], Arm)
BODY = types.NamedTuple([MAT, READ_INTS, MAT, MAT, MAT], Body)
POINTS = types.NamedTuple([VEC, MAT, MAT, MAT], Points)

# A third: (space, path, n, how) -> number of waypoints of the path, made shorter in place; how:
# settings of its own.
SHORTEN = types.FunctionType(int64(SPACE, OUT_MAT, int64, VEC))

# A fourth: (edge check, resolution, chain, robot, obstacles, bounds, target, path, n, finest) ->
# by how much the path got shorter as its last waypoint moved along the goal manifold.
SLIDE = types.FunctionType(
    float64(EDGE_CHECK, float64, CHAIN, MAT, MAT, MAT, VEC, OUT_MAT, int64, float64)
)

# How an arm aims: (robot, bounds, target, q_near, ratios, first, n_draws, longest, candidates,
# reaches) -> how many candidates no farther from q_near than `longest` it wrote, of the draws from
# `first` on; `ratios` has an entry for each joint that is drawn.
CANDIDATES = types.FunctionType(
    int64(MAT, MAT, VEC, VEC, VEC, int64, int64, float64, OUT_MAT, OUT_VEC)
)

# Only kernels of these types are called through addresses, which takes code of its own.
SEAMS = [
    seam.signature
    for seam in (CHAIN, EDGE_CHECK, FREE_RADIUS, CONTACTS, SHORTEN, SLIDE, CANDIDATES)
]

# Entries of `functions`, by which a world hands its seams to the kernels that Python calls: to
# hand over the functions themselves takes 4 us each, a great part of a plan.
EDGE_CHECK_AT, CHAIN_AT, FREE_RADIUS_AT, CONTACTS_AT = range(4)

# Entries of `sizes`: nodes of the tree of the start and of that of the goals, pairs of nodes where
# they meet, and how many goals the second tree begins with.
N_START, N_GOAL, N_MEETINGS, N_GOALS = range(4)

# What a kernel makes arrays with that are freed again, unlike those of `scratch`.
ARRAY_MAKERS = {'arange', 'array', 'copy', 'empty', 'empty_like', 'full', 'ones', 'zeros'}

# The file that marks the cache of all kernels of the planner as complete.
COMPLETE = 'complete'

FOLDER = Path(__file__).parent
_LOGGER = logging.getLogger('rrth_planner')


def _cache_folder() -> Path | None:
    """Return the folder of the compiled code, or None where none can be kept."""
    # A kernel of another file may be part of what is kept, so all sources name the folder.
    digest = hashlib.sha256(f'{numba.__version__} {sys.implementation.cache_tag}'.encode())
    for source in sorted(FOLDER.rglob('*.py')):
        digest.update(source.read_bytes())
    root = os.environ.get('RRTH_CACHE_DIR') or os.path.join(
        os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache'),
        'rrth_planner',
    )
    folder = Path(root) / f'kernels-{digest.hexdigest()[:16]}'
    try:
        return private_folder(folder)
    except OSError as problem:
        _warn_once(folder, problem)
        return None


def _warn_once(folder: Path | None, problem: Exception) -> None:
    global _has_warned
    if not _has_warned:
        _has_warned = True
        warnings.warn(
            f'compiled kernels are not kept: {folder}: {problem}; expected a folder of your own '
            'with room for them, to which nobody else can write (chmod go-w, or another one: '
            'environment variable RRTH_CACHE_DIR)',
            RuntimeWarning,
            stacklevel=3,
        )


_has_warned = _has_announced = False
_folder = _cache_folder()
use_slim_libraries()


def cache_folder() -> Path | None:
    """Return the folder of the compiled code, or None where none can be kept."""
    return _folder


def _give_up(problem: OSError) -> None:
    """Keep no more code, since the folder turned out not to take any: warned about once."""
    global _folder
    _warn_once(_folder, problem)
    _folder = None


def is_compiled() -> bool:
    """Return whether the planner's kernels have all been compiled, and kept, before."""
    return _folder is not None and (_folder / COMPLETE).exists()


def mark_compiled() -> None:
    """Keep in mind that the planner's kernels are all compiled."""
    if _folder is not None:
        with contextlib.suppress(OSError):
            (_folder / COMPLETE).touch(mode=0o600)


def compiling_notice() -> str:
    """
    Return, once a process, what to say before kernels are compiled; after that, nothing.

    Who says it, a node or a command, says it in its own way; otherwise the logger `rrth_planner`
    warns of it when it begins, since its caller is about to wait.
    """
    global _has_announced
    if _has_announced:
        return ''
    _has_announced = True
    how_often = 'at every start' if _folder is None else 'once for this machine'
    return f'compiling kernels, {how_often}: takes up to two minutes'


def _announce(function: Callable[..., Any]) -> None:
    """Log that kernels are compiled; that of a new arm, or of a test, is no matter of minutes."""
    if FOLDER in Path(function.__code__.co_filename).parents and (notice := compiling_notice()):
        _LOGGER.warning(notice)


def kernel(
    signature: Any,
    is_inner: bool = False,
    is_inlined: bool = False,
    is_short: bool = False,
    is_exact: bool = False,
) -> Callable[[Callable[..., Any]], Any]:
    """
    Return a decorator that compiles a kernel for one signature, and keeps the result.

    is_inner: only other kernels call it, so what Python would call it through is not made.
    is_inlined: it is also written out where it is called, for the few whose call costs as much as
    what they do; the compiler itself takes only the smallest. is_short: other threads wait while
    it runs, which takes less time than to get hold of the interpreter once more after it.
    is_exact: each operation rounds by itself, as it does in numpy.
    """
    # No `nnan`: a NaN must fail every comparison, and so never be certified.
    options = {
        'nogil': not is_short,
        'error_model': 'numpy',
        'forceinline': is_inlined,
        'fastmath': set() if is_exact else {'contract', 'arcp', 'nsz'},
        'no_cfunc_wrapper': signature not in SEAMS,
        'no_cpython_wrapper': is_inner,
        # Rewrites fuse expressions of whole arrays and prune branches on constants; kernels need
        # neither.
        'no_rewrites': True,
    }

    def decorate(function: Callable[..., Any]) -> Any:
        # References are counted only where there are arrays to be freed; a kernel that makes one
        # in another way than these does not compile, and none is handed one by another.
        if _has_arrays(signature.return_type):
            raise TypeError(
                f'{function.__name__}: returns an array, which its caller may not free'
            )
        makes_arrays = not ARRAY_MAKERS.isdisjoint(function.__code__.co_names)
        compiled = njit(**options, _nrt=makes_arrays)(function)
        if not config.DISABLE_JIT:
            if _folder is None:
                _announce(function)
            else:
                compiled._cache = KeptCode(function, is_inlined, _folder, _announce, _give_up)
            with calling_by_name(), resolving_once():
                compiled.compile(signature)
            compiled.disable_compile()
            if is_inner:
                compiled.__class__ = _InnerKernel
        return compiled

    return decorate


def _has_arrays(kind: Any) -> bool:
    """Return whether values of a type are arrays, or hold some."""
    if isinstance(kind, types.BaseTuple):
        return any(map(_has_arrays, kind))
    return isinstance(kind, types.Array)


class _InnerKernel(CPUDispatcher):
    """A kernel that only other kernels call: there is nothing by which Python could."""

    def __call__(self, *_: Any) -> None:
        """Raise TypeError, where a call would end the process."""
        raise TypeError(f'{self.__qualname__} is called by other kernels only')


class FirstClass:
    """
    A kernel to be handed to other kernels, its type and address looked up once.

    numba looks both up anew at each call that passes the bare kernel, which costs more (70 us)
    than most plans spend in the call. Its copies are itself, and in another process it is the
    kernel of the same name: an address means nothing there, and a bare kernel would be compiled
    anew, with all that it calls. made_by: what returns a kernel that no module has, and from what.
    """

    def __init__(self, compiled: Any, made_by: tuple[Any, ...] = ()) -> None:
        self.compiled, self._made_by = compiled, made_by
        (self._signature,) = compiled.nopython_signatures
        # Of the compiled code, for `functions`.
        self.address = int(_get_wrapper_address(compiled, self._signature))
        # Where numba looks for the type of a value.
        self._numba_type_ = types.FunctionType(self._signature)

    def __wrapper_address__(self) -> int:
        """Return the address of the compiled code, as numba's protocol asks."""
        return self.address

    def signature(self) -> Any:
        """Return the signature, as numba's protocol asks."""
        return self._signature

    def __call__(self, *arguments: Any) -> Any:
        """Call the kernel from Python."""
        return self.compiled(*arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        """Be copied and sent by name."""
        if self._made_by:
            made_by, *arguments = self._made_by
            return made_by, tuple(arguments)
        module, name = self.compiled.__module__, self.compiled.__qualname__
        if '<locals>' in name:
            raise PicklingError(f'kernel {name}: of a function, expected one of a module')
        return _seam_named, (module, name)


_SEAMS: dict[Any, FirstClass] = {}


def first_class(compiled: Any, *made_by: Any) -> Any:
    """
    Return a kernel, of the type of a seam, in the form in which others are handed it.

    made_by: a function, and arguments for which it returns the kernel, where no module has it.
    """
    if config.DISABLE_JIT:
        return compiled
    if compiled not in _SEAMS:
        _SEAMS[compiled] = FirstClass(compiled, made_by)
    return _SEAMS[compiled]


def _seam_named(module: str, name: str) -> Any:
    """Return the kernel of a module in the form in which others are handed it."""
    return first_class(getattr(import_module(module), name))


def address(seam: Any) -> Any:
    """Return the address of one compiled seam."""
    return seam if config.DISABLE_JIT else seam.__wrapper_address__()


# Most worlds have the same ones.
@functools.lru_cache(maxsize=64)
def addresses(*seams: Any) -> Any:
    """Return what `functions` holds: the addresses of compiled seams."""
    if config.DISABLE_JIT:
        return seams
    found = np.array([address(seam) for seam in seams], dtype=np.int64)
    found.setflags(write=False)
    return found


def _fused(a: Any, b: Any, c: Any) -> Any:
    return a * b + c


def _fused_type(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """Return the type of a fused multiplication, and how it is made."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return float64(float64, float64, float64), generate


# a b + c within a kernel, rounded once.
fused = _fused if config.DISABLE_JIT else intrinsic(_fused_type)


def _from_address(seam: Any) -> Any:
    """Return what makes a seam of its address, within a kernel."""
    if config.DISABLE_JIT:
        return lambda function: function

    def typed(typing_context: Any, where: Any) -> Any:
        """Return the type of the seam and how it is made."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            made = cgutils.create_struct_proxy(seam)(context, builder)
            pointer = builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))
            # The first is called through, the others never; numba 0.61 has given all new names.
            called, *others = made._datamodel._fields
            setattr(made, called, pointer)
            for other in others:
                setattr(made, other, pointer.type(None))
            return made._getvalue()

        return seam(int64), generate

    return intrinsic(typed)


as_edge_check, as_chain = _from_address(EDGE_CHECK), _from_address(CHAIN)
as_free_radius, as_contacts = _from_address(FREE_RADIUS), _from_address(CONTACTS)
as_shorten, as_slide = _from_address(SHORTEN), _from_address(SLIDE)
as_candidates = _from_address(CANDIDATES)
