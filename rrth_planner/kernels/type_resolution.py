# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Which overload of a function numba takes for which types, looked up once for all kernels."""

from collections.abc import Iterator
import contextlib
from typing import Any

from numba import types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.targetconfig import ConfigStack

# Types of arguments that are complete in themselves, unlike a list of items not known yet.
PLAIN = types.Number, types.Boolean, types.Array, types.BaseTuple, types.NoneType, types.SliceType

_search = types.Function.get_call_type
# By function, types and options: the function, kept alive so that its id is not reused, its
# signature, and the implementation of that.
_found: dict[tuple[Any, ...], tuple[Any, Any, Any]] = {}
# Sets of options of kernels, numbered, since they take long to compare; then the set met last,
# with its number.
_numbers: dict[Any, int] = {}
_met: tuple[Any, int] = None, -1


@contextlib.contextmanager
def resolving_once() -> Iterator[None]:
    """
    Have what this thread compiles meanwhile find the overloads that were found before.

    numba tries all overloads of an operator, some fifty of them, wherever a kernel has it, which
    is a sixth of all compiling.
    """
    with global_compiler_lock:
        before = types.Function.get_call_type
        types.Function.get_call_type = _call_type
        try:
            yield
        finally:
            types.Function.get_call_type = before


def _call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature of a function for types of arguments, as numba would."""
    global _met
    if kws or not all(isinstance(arg, PLAIN) for arg in args):
        return _search(function, context, args, kws)
    # An overload that is written in Python is compiled for each set of options.
    options = ConfigStack.top_or_none()
    if options is not _met[0]:
        _met = options, _numbers.setdefault(options, len(_numbers))
    key = id(function), tuple(args), _met[1]
    if key not in _found:
        signature = _search(function, context, args, kws)
        _found[key] = function, signature, function._impl_keys[signature.args]
    _, signature, implementation = _found[key]
    # Where numba looks for it; a kernel with other options may have left its own there.
    function._impl_keys[signature.args] = implementation
    return signature
