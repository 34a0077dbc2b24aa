# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Scratch arrays on the stack of a kernel: they cost nothing, and end with the call."""

from typing import Any

from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic
import numpy as np
from rrth_planner.kernels.jit import OUT_INTS, OUT_POOL, OUT_VEC


def _on_stack(array: Any) -> Any:
    """Return what makes an array of that type and of a size known to the compiler."""

    def typed(typing_context: Any, size: Any) -> Any:
        """Return the array type and how the array is made."""
        if not isinstance(size, types.IntegerLiteral):
            return None

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            item = context.get_data_type(array.dtype)
            data = cgutils.alloca_once(builder, item, size=size.literal_value)
            made = context.make_array(array)(context, builder)
            width = context.get_constant(types.intp, context.get_abi_sizeof(item))
            context.populate_array(
                made,
                data=builder.bitcast(data, made.data.type),
                shape=[context.get_constant(types.intp, size.literal_value)],
                strides=[width],
                itemsize=width,
                meminfo=None,
            )
            return made._getvalue()

        return array(size), generate

    return intrinsic(prefer_literal=True)(typed)


if config.DISABLE_JIT:

    def floats(size: int) -> Any:
        """Return room for so many floating-point numbers."""
        return np.empty(size)

    def ints(size: int) -> Any:
        """Return room for so many integers of 32 bits."""
        return np.empty(size, np.int32)

else:
    floats, ints, longs = _on_stack(OUT_VEC), _on_stack(OUT_POOL), _on_stack(OUT_INTS)
