# Copyright 2026 The rrth_planner authors
# SPDX-License-Identifier: Apache-2.0
"""Forward kinematics written out for one arm: its constants are known to the compiler."""

import hashlib
import math
import sys
from types import ModuleType
from typing import Any

from numba.core.types import float64, int64
from rrth_planner.kernels.jit import first_class, kernel, OUT_VEC, VEC
from rrth_planner.kernels.layout import (
    A,
    BAR_SIZE,
    BODY,
    COS_ALPHA,
    D,
    ENDS,
    FIRST_PAIR,
    FRAME,
    FRAME_SIZE,
    FRAMES,
    KIND,
    LINK,
    N_BARS,
    NO_BAR,
    OFFSET,
    PRISMATIC,
    RADIUS,
    RADIUS_A,
    RADIUS_D,
    REACH,
    REVOLUTE,
    SIN_ALPHA,
)

# Sines and cosines nearer than this to 0 or 1 are rounding of a right angle.
ROUNDING = 1e-15
# A number known to the compiler, or the name of a variable, perhaps with a minus in front.
Term = float | str

HEADER = '''"""Points of one arm, written out from its Denavit-Hartenberg rows."""

from numba.core.types import float64, int64
from rrth_planner.kernels import scratch
from rrth_planner.kernels.jit import kernel, OUT_VEC, VEC
from rrth_planner.kernels.kinematics.trigonometry import sine_cosine


@kernel(int64(VEC, float64, OUT_VEC, int64))
def chain(q, ray_length, points, at):
    angles, sines, cosines = scratch.floats({room}), scratch.floats({room}), scratch.floats({room})
'''

# All angles at once: the compiler makes vectors of them.
ALL_ANGLES = """    for i in range({room}):
        sines[i], cosines[i] = sine_cosine(angles[i])
"""


@kernel(int64(VEC, float64, OUT_VEC, int64), is_inner=True)
def no_chain(q, ray_length, points, at):
    """Stand in for the chain where the robot is a point: it has no bars."""
    return 0


NO_CHAIN = first_class(no_chain)
_COMPILED: dict[str, Any] = {}


class _Source:
    """Lines of a straight-line program that leaves out what is 0, 1 or constant."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.n_names = 0

    def let(self, expression: str) -> str:
        """Return the name of a new variable with that value."""
        self.n_names += 1
        name = f'v{self.n_names}'
        self.lines.append(f'    {name} = {expression}')
        return name

    def total(self, *products: tuple[Term, Term]) -> Term:
        """Return the sum of some products."""
        constant, parts = 0.0, []
        for left, right in products:
            if isinstance(left, float) and isinstance(right, float):
                constant += left * right
            elif isinstance(left, float) or isinstance(right, float):
                factor, name = (left, right) if isinstance(left, float) else (right, left)
                if factor != 0.0:
                    plain = {1.0: f'{name}', -1.0: f'-({name})'}
                    parts.append(plain.get(float(factor), f'{factor!r} * {name}'))
            else:
                parts.append(f'{left} * {right}')
        if not parts:
            return constant
        if constant != 0.0:
            parts.append(repr(constant))
        if len(parts) == 1 and parts[0].isidentifier():
            return parts[0]
        return self.let(' + '.join(parts))


def _snapped(value: float) -> float:
    for exact in (0.0, 1.0, -1.0):
        if abs(value - exact) < ROUNDING:
            return exact
    return value


def _turned(sine: Term, cosine: Term, quarters: int) -> tuple[Term, Term]:
    """Return sine and cosine of an angle that is some quarter turns further on."""
    for _ in range(quarters % 4):
        sine, cosine = cosine, f'-{sine}' if isinstance(sine, str) else -sine
        cosine = cosine.removeprefix('--') if isinstance(cosine, str) else cosine
    return sine, cosine


def chain_source(rows: Any) -> str:
    """
    Return the text of the module whose kernel `chain` writes the bars of an arm.

    rows: `robot` as in `layout`; Craig's T = Rx(alpha) Tx(a) Rz(theta) Tz(d) each.
    The kernel `chain(q, ray_length, points, at)` writes BAR_SIZE numbers a bar from points[at] on,
    in the order of their rows: its start in the arm's base frame, half its length (only where
    there are pairs, which need it), its end, and its radius [m]; then FRAME_SIZE numbers for each
    link whose frame a pair of bars needs: its origin [m] and its axes. It returns the number of
    bars that are checked against boxes.
    """
    source = _Source()
    dof = (rows.shape[1] - REACH) // 2
    dh, sizes = rows[: dof + 1], rows[dof + 1]
    first_pair = int(sizes[FIRST_PAIR])
    bars, pairs = rows[dof + 2 : first_pair], rows[first_pair:]
    # The bars that are offsets, in the order of the rows.
    offsets = [k for k, bar in enumerate(bars) if bar[LINK] == NO_BAR]
    slots = {int(pair[BODY]): int(pair[FRAME]) for pair in pairs if pair[FRAME] >= 0.0}
    p: list[Term] = [0.0, 0.0, 0.0]
    x: list[Term] = [1.0, 0.0, 0.0]
    y: list[Term] = [0.0, 1.0, 0.0]
    z: list[Term] = [0.0, 0.0, 1.0]
    angles: list[str] = []

    def write(at: int, *values: Term) -> None:
        for k, value in enumerate(values):
            source.lines.append(f'    points[at + {at + k}] = {value}')

    def write_bar(n: int, start: list[Term], end: list[Term], length: Term, radius: float) -> None:
        write(BAR_SIZE * n, *start)
        write(BAR_SIZE * n + 4, *end, radius)
        if len(pairs):
            is_known = isinstance(length, float)
            half = 0.5 * abs(length) if is_known else f'0.5 * abs({length})'
            write(BAR_SIZE * n + 3, half)

    def write_offset(start: list[Term], length: Term, radius: float) -> None:
        write_bar(offsets.pop(0), start, p, length, radius)

    def write_link(link: int) -> None:
        """Write the capsules of a link, and its frame where it is needed."""
        for n, bar in enumerate(bars):
            if int(bar[LINK]) == link:
                ends = [
                    [
                        source.total(
                            (1.0, p[k]),
                            (float(c[0]), x[k]),
                            (float(c[1]), y[k]),
                            (float(c[2]), z[k]),
                        )
                        for k in range(3)
                    ]
                    for c in (bar[ENDS : ENDS + 3], bar[ENDS + 3 : ENDS + 6])
                ]
                length = math.dist(bar[ENDS : ENDS + 3], bar[ENDS + 3 : ENDS + 6])
                write_bar(n, ends[0], ends[1], length, float(bar[RADIUS]))
        if link in slots:
            write(int(sizes[FRAMES]) + FRAME_SIZE * slots[link], *p, *x, *y, *z)

    write_link(0)
    for i, row in enumerate(dh):
        is_last = i == len(dh) - 1
        start = p
        p = [source.total((1.0, p[k]), (float(row[A]), x[k])) for k in range(3)]
        if row[RADIUS_A] != NO_BAR:
            write_offset(start, float(row[A]), float(row[RADIUS_A]))
        ca, sa = _snapped(float(row[COS_ALPHA])), _snapped(float(row[SIN_ALPHA]))
        m = [source.total((ca, y[k]), (sa, z[k])) for k in range(3)]
        z = [source.total((ca, z[k]), (-sa, y[k])) for k in range(3)]
        quarters = float(row[OFFSET]) / (0.5 * math.pi)
        is_square = abs(quarters - round(quarters)) < 1e-14
        sine: Term
        cosine: Term
        if not is_last and row[KIND] == REVOLUTE:
            n = len(angles)
            shift = '' if is_square else f' + {float(row[OFFSET])!r}'
            angles.append(f'q[{i}]{shift}')
            source.lines.append(f'    s{i}, c{i} = sines[{n}], cosines[{n}]')
            sine, cosine = _turned(f's{i}', f'c{i}', round(quarters) if is_square else 0)
        elif is_square:
            sine, cosine = _turned(0.0, 1.0, round(quarters))
        else:
            sine, cosine = math.sin(row[OFFSET]), math.cos(row[OFFSET])
        minus = -sine if isinstance(sine, float) else sine[1:] if sine[0] == '-' else f'-{sine}'
        x, y = (
            [source.total((cosine, x[k]), (sine, m[k])) for k in range(3)],
            [source.total((cosine, m[k]), (minus, x[k])) for k in range(3)],
        )
        d: Term = float(row[D])
        if is_last:
            write_link(i + 1)
            d = 'ray_length'
        elif row[KIND] == PRISMATIC:
            d = source.let(f'q[{i}] + {d!r}')
        start = p
        p = [source.total((1.0, p[k]), (d, z[k])) for k in range(3)]
        if row[RADIUS_D] != NO_BAR:
            write_offset(start, d, float(row[RADIUS_D]))
        if not is_last:
            write_link(i + 1)
    # Whole vectors of the machine, the rest of the last one filled with zeros.
    room = -(-max(1, len(angles)) // 4) * 4
    angles += ['0.0'] * (room - len(angles))
    given = ''.join(f'    angles[{n}] = {angle}\n' for n, angle in enumerate(angles))
    return (
        HEADER.format(room=room)
        + given
        + ALL_ANGLES.format(room=room)
        + '\n'.join([*source.lines, f'    return {int(sizes[N_BARS])}', ''])
    )


def chain_of(rows: Any) -> Any:
    """
    Return the compiled `chain` of an arm, kept from process to process.

    rows: as in `chain_source`. The text is never read from a file: it would be run as it is.
    """
    text = chain_source(rows)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    if digest not in _COMPILED:
        # What is kept of a kernel looks its module up by name.
        module = ModuleType(f'rrth_planner.kernels.chain_{digest}')
        sys.modules[module.__name__] = module
        exec(compile(text, f'<chain_{digest}>', 'exec'), vars(module))  # noqa: S102
        _COMPILED[digest] = first_class(module.chain, chain_of, rows)
    return _COMPILED[digest]
