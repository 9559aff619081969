"""Sine and cosine in kernels: two polynomials, without a call and without a branch.

    n = round(2x/pi),    r + t = x - n pi/2,    z = r^2,    |r| <= pi/4
    sin(r + t) = r + (r z S(z) + t),    cos(r + t) = w + (z^2 C(z) + ((1 - w) - z/2) - r t),    w = 1 - z/2

and n modulo 4 says which of the two is the sine of x, and with which sign. S and C, of degree 5, minimise the largest
relative error for |r| <= pi/4, each coefficient rounded before the next is fitted; that leaves 3.9e-18 and 9.0e-20.

Relative errors, rounding included: at most 0.56 and 0.63 times 2.2e-16 for 0 < x < pi/2, and no larger at both ends,
because pi/2 is subtracted in two parts and t is the rounding error of r; without t they are 0.76 and 0.96. Elsewhere
the absolute error is at most 1.1e-16 for |x| < 1e12. Beyond 1e15 the spacing of doubles is too coarse for angles: both
results stay below 1.01 in size and have no meaning. NaN and infinities give NaN.

The C library is as accurate, and as fast for one number, but LLVM does not vectorise a loop over tops that calls it: a
step of 32 takes a third of the time with the polynomials (`benchmarks/sines.py`). The operations are the same in it and
outside of it, and so are the bits. Source: Muller, Elementary Functions, chapters 3, 5 and 11.
"""

import math
from typing import Any

import numpy as np

from symtop.core.jit_functions import fused

SINE = (
    -0.1666666666666663, 0.00833333333332184, -0.00019841269829358203, 2.7557313538206325e-06, -2.5050734298833298e-08,
    1.5895424920929918e-10,
)  # fmt: skip
COSINE = (
    0.041666666666666595, -0.0013888888888873422, 2.480158728908732e-05, -2.755731424937183e-07, 2.087571063268065e-09,
    -1.1359056871745034e-11,
)  # fmt: skip
TO_QUADRANTS = 0.6366197723675814  # 2/pi
QUARTER, QUARTER_LOW = 1.5707963267948966, 6.123233995736766e-17  # pi/2
UNITS, FOURS = 6755399441055744.0, 27021597764222976.0  # 1.5 2^52, 1.5 2^54: adding one rounds to a multiple of 1, of 4
DIAGONAL = 0.7071067811865476


def sincos(x: Any) -> Any:
    """Sine and cosine of an angle: in compiled code by `polynomials`, in Python by `math` or NumPy."""
    if isinstance(x, float):  # NumPy takes ten times as long for one number
        return math.sin(x), math.cos(x)
    return np.sin(x), np.cos(x)


def polynomials(x: float) -> tuple[float, float]:
    """Sine and cosine of a double. Terms are added in pairs, of which the second does not wait for the first."""
    n = fused(x, TO_QUADRANTS, UNITS) - UNITS
    near = fused(-n, QUARTER, x)
    r = fused(-n, QUARTER_LOW, near)
    t = fused(-n, QUARTER_LOW, near - r)
    z = r * r
    z2 = z * z
    tail = fused(fused(SINE[5], z, SINE[4]), z2, fused(SINE[3], z, SINE[2]))
    odd = r + fused(r * z, fused(tail, z2, fused(SINE[1], z, SINE[0])), t)
    tail = fused(fused(COSINE[5], z, COSINE[4]), z2, fused(COSINE[3], z, COSINE[2]))
    w = fused(-0.5, z, 1.0)
    even = w + fused(z2, fused(tail, z2, fused(COSINE[1], z, COSINE[0])), fused(-r, t, fused(-0.5, z, 1.0 - w)))
    inexact = abs(r) > 1.0  # n has not digits enough: |x| is beyond 1e15
    odd, even = (DIAGONAL if inexact else odd), (DIAGONAL if inexact else even)
    quadrant = n - ((n + FOURS) - FOURS)  # -2 to 2
    swap, opposite = abs(quadrant) == 1.0, abs(quadrant) == 2.0
    sine, cosine = (even if swap else odd), (odd if swap else even)
    return (-sine if opposite or quadrant == -1.0 else sine, -cosine if opposite or quadrant == 1.0 else cosine)
