# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""What searches ask of a space of configurations: free edges, and steps adapted to obstacles."""

from typing import Any

from numba import config, types
from numba.core.types import boolean, float64
from numba.extending import intrinsic
from rrth_planner.kernels.jit import (
    as_chain,
    as_edge_check,
    as_free_radius,
    CHAIN_AT,
    EDGE_CHECK_AT,
    FREE_RADIUS_AT,
    kernel,
    SPACE,
    VEC,
)

# Entries of the `settings` of every search, the options of its trees.
STEP, CLEARANCE_GAIN, BIAS, TWO_TREES = range(4)


def _borrowed(typing_context: Any, space: Any) -> Any:
    """Return the type of a borrowed space and how it is made."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        (made,) = arguments
        for i, kind in enumerate(space.types):
            if isinstance(kind, types.Array):
                member = builder.extract_value(made, i)
                array = context.make_array(kind)(context, builder, member)
                array.meminfo, array.parent = array.meminfo.type(None), array.parent.type(None)
                made = builder.insert_value(made, array._getvalue(), i)
        return made

    return space(space), generate


# The space that Python hands over, its references no longer counted, which takes 2 to 3 % of a
# plan: the caller keeps the arrays as long as the search runs.
borrowed = (lambda space: space) if config.DISABLE_JIT else intrinsic(_borrowed)


# Called with the tuple, it would cost an edge check 40 ns more.
@kernel(boolean(SPACE, VEC, VEC), is_inlined=True, is_inner=True)
def is_free(space, q_from, q_to):
    """Return whether the straight edge between two configurations is free."""
    is_edge_free = as_edge_check(space.functions[EDGE_CHECK_AT])
    chain = as_chain(space.functions[CHAIN_AT])
    return is_edge_free(q_from, q_to, space.resolution, chain, space.robot, space.obstacles)


@kernel(float64(SPACE, VEC, VEC), is_inner=True)
def adapted_step(space, settings, q):
    """
    Return the step from q: shorter where obstacles are near (after Cai, as the paper cites it).

    The clearance gain times the free radius, between a tenth of the step size and the step size; a
    gain of 0 leaves the step size as it is.
    """
    step_size = settings[STEP]
    if settings[CLEARANCE_GAIN] == 0.0:
        return step_size
    free_radius = as_free_radius(space.functions[FREE_RADIUS_AT])
    chain = as_chain(space.functions[CHAIN_AT])
    step = settings[CLEARANCE_GAIN] * free_radius(q, chain, space.robot, space.obstacles)
    return min(step_size, max(step, 0.1 * step_size))
