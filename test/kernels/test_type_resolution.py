# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""The overloads of functions are looked up once for the kernels, and are those of numba."""

import operator

import numba
from numba import types
from numba.extending import overload
import numpy as np
import pytest
from rrth_planner.kernels import type_resolution
from rrth_planner.kernels.type_resolution import resolving_once

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason='nothing is compiled')
FLOATS = types.Array(types.float64, 1, 'C')
INTS = types.Array(types.int64, 1, 'C')


def products(a, b):
    return a * b + b * a - a * b


def lengths(a, b):
    total = 0.0
    for k in range(len(a)):
        total += np.sqrt(a[k] * a[k] + b[0]) + abs(a[-1]) - max(a[k], 2)
    return total, min(len(b), 3), a[0] > b[1] or not b[0]


def pieces(a, b):
    pair = (a[1:], b[:2])
    first, second = pair
    out = np.empty(2)
    out[0], out[1] = first[0] // 2, second[1] % 3
    out[:1] += 1
    return out[0], pair[1][0], -(out[1] ** 2), 1 << b[0], int(a[0]) & b[1]


def lists(a, b):
    numbers = [a[0]]
    numbers.append(b[0])
    names = ['x', 'y']
    return len(numbers) + len(names) + numbers[-1]


CASES = [
    (products, (types.float64, types.float64), (2.0, 3.0)),
    (products, (types.int64, types.float64), (2, 3.0)),
    (lengths, (FLOATS, INTS), (np.array([1.0, 4.0]), np.array([2, 3]))),
    (pieces, (FLOATS, INTS), (np.array([5.0, 7.0]), np.array([2, 4]))),
    (lists, (FLOATS, INTS), (np.array([5.0, 7.0]), np.array([2, 4]))),
]


def compiled(function, signature, **options):
    dispatcher = numba.njit(**options)(function)
    dispatcher.compile(signature)
    return dispatcher


def types_of(dispatcher, signature):
    annotation = dispatcher.overloads[signature].type_annotation
    calls = {str(call): str(found) for call, found in annotation.calltypes.items()}
    return {name: str(kind) for name, kind in annotation.typemap.items()}, calls


@pytest.mark.parametrize('options', [{}, {'error_model': 'numpy', 'nogil': True}])
@pytest.mark.parametrize(('function', 'signature', 'values'), CASES)
def test_types_and_results_are_those_of_numba(function, signature, values, options):
    expected = compiled(function, signature, **options)
    # Another time finds what the first one did.
    for _ in range(2):
        with resolving_once():
            found = compiled(function, signature, **options)
        assert types_of(found, signature) == types_of(expected, signature)
        assert found(*values) == expected(*values) == pytest.approx(function(*values))


def test_an_operator_is_looked_up_once_for_the_same_types_and_options(monkeypatch):
    search, searched = type_resolution._search, []

    def recorded(function, context, args, kws):
        searched.append((function.typing_key, tuple(args)))
        return search(function, context, args, kws)

    monkeypatch.setattr(type_resolution, '_search', recorded)
    monkeypatch.setattr(type_resolution, '_found', {})
    signature = types.float64, types.float64
    with resolving_once():
        compiled(products, signature)
        compiled(products, signature)
        assert searched.count((operator.mul, signature)) == 1
        compiled(products, signature, error_model='numpy')
    assert searched.count((operator.mul, signature)) == 2


def test_numba_looks_up_by_itself_afterwards_whatever_happened():
    before = types.Function.get_call_type

    def wrong(a):
        return a.nothing

    with pytest.raises(numba.TypingError), resolving_once():
        assert types.Function.get_call_type is not before
        compiled(wrong, (types.float64,))
    assert types.Function.get_call_type is before


def ratio(a, b):
    """Stand for a function of numpy that numba has as an overload."""


@overload(ratio)
def _ratio_overload(a, b):
    return lambda a, b: a / b


def test_a_kernel_keeps_its_options_whatever_was_compiled_with_others_before():
    def divided(a, b):
        return ratio(a, b)

    signature = types.float64, types.float64
    for _ in range(2):
        with resolving_once():
            found = compiled(divided, signature, error_model='numpy')
        assert found(1.0, 0.0) == np.inf
        # This one raises an error instead, and leaves its implementation where numba looks.
        with pytest.raises(ZeroDivisionError):
            compiled(divided, signature, error_model='python')(1.0, 0.0)
