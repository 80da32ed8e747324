"""Neighbours' quantities as cache lines of eight numbers, eight particles at a time.

A gather of eight scattered numbers costs this machine's kind as much as eight loads and more; a particle's eight numbers lie
side by side here, come with one load, and eight such loads are transposed in registers. Sums over neighbours read what the
transposition leaves in a small contiguous buffer, and the compiler vectorises them without a gather.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...records import FloatArray

WIDTH = 8  # numbers a line, and particles a transposition
ROOM = 64  # neighbours a buffer holds of each number

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_INDEX = ir.IntType(64)


def make_lines(count: int) -> FloatArray:
    """Lines for ``count`` particles, zeroed, on cache-line boundaries; (count · 8,)."""
    raw = np.zeros(WIDTH * (count + 1))
    skip = -(raw.ctypes.data // 8) % WIDTH
    return raw[skip : skip + WIDTH * count]


def make_rows(rows: int, count: int) -> FloatArray:
    """Rows of at least ``count`` numbers, zeroed, each beginning on a cache-line boundary: a vector that straddles two lines
    costs twice."""
    lines = -(-count // WIDTH)
    return make_lines(rows * lines).reshape(rows, lines * WIDTH)


def _shuffle(builder, a, b, mask):
    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), mask))


def _transpose(builder, rows):
    """Eight vectors of eight: rows to columns, in three rounds of exchanges."""
    for lower, upper, distance in (
        ([0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15], 1),
        ([0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15], 2),
        ([0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15], 4),
    ):
        rows = list(rows)
        for k in range(WIDTH):
            if not k & distance:
                a, b = rows[k], rows[k + distance]
                rows[k] = _shuffle(builder, a, b, lower)
                rows[k + distance] = _shuffle(builder, a, b, upper)
    return rows


def _data(context, builder, kind, value):
    return context.make_array(kind)(context, builder, value).data


def _vector_at(builder, pointer, index):
    return builder.bitcast(builder.gep(pointer, [index]), _VECTOR.as_pointer())


def _make_reader(wanted: int):
    @intrinsic
    def read(typing, lines, neighbour, first, buffer, at):
        signature = types.void(lines, neighbour, first, buffer, at)

        def generate(context, builder, signature, args):
            kinds = signature.args
            source, near, target = (_data(context, builder, kinds[k], args[k]) for k in (0, 1, 3))
            rows = []
            for lane in range(WIDTH):
                place = builder.add(args[2], ir.Constant(_INDEX, lane))
                start = builder.zext(builder.load(builder.gep(near, [place])), _INDEX)
                rows.append(builder.load(_vector_at(builder, source, start), align=64))
            for field, column in enumerate(_transpose(builder, rows)[:wanted]):
                place = builder.add(args[4], ir.Constant(_INDEX, field * ROOM))
                builder.store(column, _vector_at(builder, target, place), align=8)
            return context.get_dummy_value()

        return signature, generate

    return read


read_five = _make_reader(5)
read_eight = _make_reader(8)


@intrinsic
def _write_lines(typing, lines, first, a, b, c, d, e, f, g, h):
    """Numbers ``first`` to ``first + 7`` of eight rows into the lines of these particles."""
    signature = types.void(lines, first, a, b, c, d, e, f, g, h)

    def generate(context, builder, signature, args):
        target = _data(context, builder, signature.args[0], args[0])
        rows = []
        for kind, value in zip(signature.args[2:], args[2:], strict=True):
            row = _data(context, builder, kind, value)
            rows.append(builder.load(_vector_at(builder, row, args[1]), align=8))
        start = builder.shl(args[1], ir.Constant(_INDEX, 3))
        for lane, column in enumerate(_transpose(builder, rows)):
            place = builder.add(start, ir.Constant(_INDEX, lane * WIDTH))
            builder.store(column, _vector_at(builder, target, place), align=64)
        return context.get_dummy_value()

    return signature, generate


write_lines: Any = _write_lines  # numba passes the first argument, which no type says
