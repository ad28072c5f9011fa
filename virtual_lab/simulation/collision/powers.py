"""Powers of many numbers at once: log2 and exp2 as polynomials that compilers can vectorize.

``x^a = exp2(a log2 x)``. A mathematics library processes one number per call, but these functions
consist of a dozen multiply-adds on numbers in registers. Their error is a thousandth of the
stepping error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.extending import intrinsic
from numpy.polynomial import Chebyshev, Polynomial
from numpy.typing import NDArray

from virtual_lab.units import INNER

COMPILES = not config.DISABLE_JIT  # type: ignore[attr-defined]
# Reassociation is off because it would cancel the additions that round a number. These functions
# have no cache, because the cache of the calling kernel contains their compiled code.
SIMD: dict[str, Any] = {"fastmath": {"contract", "nsz"}, "error_model": "numpy", **INNER}
ROUND = 1.5 * 2.0**52  # addend that leaves the nearest integer in the low bits
ROUND_BITS = np.uint64(0x4338000000000000)
ONE_BITS = np.uint64(1023 << 52)
HALF_ROOT_BITS = np.uint64(0x3FE6A09E667F3BCD)  # sqrt(1/2)
FRACTION = np.uint64(52)


def _fit(f: Callable[[NDArray[np.float64]], Any], low: float, high: float, degree: int) -> Any:
    return tuple(Chebyshev.interpolate(f, degree, domain=[low, high]).convert(kind=Polynomial).coef)


LOG2 = _fit(lambda x: np.log1p(x) / (x * np.log(2)), 0.5**0.5 - 1, 2**0.5 - 1, 11)
EXP2 = _fit(np.exp2, -0.5, 0.5, 7)


def _as_bits(context: Any, x: Any) -> Any:
    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.uint64(types.float64), generate


def _as_float(context: Any, x: Any) -> Any:
    def generate(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.uint64), generate


def _widen(context: Any) -> Any:
    """Let the loops of the calling function use the widest vector registers.

    By default compilers use only half the width of AVX-512. The full width is faster, in spite of
    a lower clock rate.
    """

    def generate(context: Any, builder: Any, _: Any, __: Any) -> Any:
        # This bypasses the library's list of attributes, which lacks target attributes.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), generate


_bits: Any = intrinsic(_as_bits)
_float: Any = intrinsic(_as_float)
wide: Any = intrinsic(_widen)
if not COMPILES:  # in Python, integers in arrays wrap around silently, as in registers
    _bits = lambda x: np.array([x], np.float64).view(np.uint64)  # noqa: E731
    _float = lambda bits: bits.view(np.float64)[0]  # noqa: E731
    wide = lambda: None  # noqa: E731


@njit(**SIMD)
def log2(x: float) -> float:
    """Return log2(x) of a positive normal number `x`, with an absolute error of at most 6e-11.

    Other numbers (0, negative, inf, NaN) give a wrong result, not an error.
    """
    exponent = (_bits(x) + (ONE_BITS - HALF_ROOT_BITS)) >> FRACTION
    m = _float(_bits(x) + ONE_BITS - (exponent << FRACTION)) - 1.0
    p = 0.0
    for i in range(len(LOG2)):
        p = p * m + LOG2[len(LOG2) - 1 - i]
    return float(m * p + (_float(ROUND_BITS + exponent) - (ROUND + 1023.0)))


@njit(**SIMD)
def exp2(y: float) -> float:
    """Return 2^y for -1000 < y < 1000, with a relative error of at most 6e-11.

    NaN, or a `y` outside this range, may give a wrong result, not an error.
    """
    rounded = y + ROUND
    f = y - (rounded - ROUND)
    p = 0.0
    for i in range(len(EXP2)):
        p = p * f + EXP2[len(EXP2) - 1 - i]
    return float(_float(_bits(p) + (_bits(rounded) << FRACTION)))
