"""Eight numbers at a time: the one loop that compilers do not make vectors of by themselves.

They cannot know that what is written does not overlap what is read, and eight numbers are too
few to find out.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

__all__ = ["LANES", "add_row"]

LANES = 8


def _add_row(context: Any, target: Any, at: Any, source: Any, start: Any, weight: Any) -> Any:
    """Add ``weight * source[start : start + 8]`` to ``target[at : at + 8]``, float32, unchecked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.VectorType(ir.FloatType(), LANES)
        index = ir.IntType(32)

        def pointer(array: int, offset: int) -> Any:
            kind = signature.args[array]
            data = context.make_array(kind)(context, builder, arguments[array]).data
            return builder.bitcast(builder.gep(data, [arguments[offset]]), vector.as_pointer())

        to, of = pointer(0, 1), pointer(2, 3)
        blank = ir.Constant(vector, ir.Undefined)
        one = builder.insert_element(blank, arguments[4], ir.Constant(index, 0))
        mask = ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
        every = builder.shuffle_vector(one, blank, mask)
        product = builder.fmul(every, builder.load(of, align=4), flags=("contract",))
        total = builder.fadd(builder.load(to, align=4), product, flags=("contract",))
        builder.store(total, to, align=4)
        return context.get_dummy_value()

    line = types.Array(types.float32, 1, "C")
    return types.void(line, types.intp, line, types.intp, types.float32), generate


def _add_row_plainly(target: Any, at: int, source: Any, start: int, weight: Any) -> None:
    target[at : at + LANES] += weight * source[start : start + LANES]


compiles = not config.DISABLE_JIT  # type: ignore[attr-defined]
add_row: Any = intrinsic(_add_row) if compiles else _add_row_plainly
