"""The planar quartic oscillator, with its exact map: between the harmonic oscillator and the top.

    x'' = (2 sigma |x|^2 + 3 b) x,      E = |x'|^2/2 - 3 b |x|^2/2 - sigma |x|^4/2,      J = Im(conj(x) x'),   x complex

sigma = 0 is the harmonic oscillator in a plane. sigma = kappa and -kappa, with the b of
`symtop.methods.lagrangian.oscillators`, are the two half-angle functions of a top. Four maps, three of them of one
form, Z_{n+1} + Z_{n-1} = 2 f(|Z_n|^2) Z_n:

    stormer-verlet    f = 1 + h^2 (3 b/2 + sigma s)                                          x_n = Z_n
    mcmillan          f = (1 + 3 b h^2/2)/(1 - sigma h^2 s), integrable at any step          x_n = Z_n
    exact-discrete    f = A/(1 + B s) (`symtop.methods.lagrangian.exact_discrete`)           x_n = exp(i n delta) Z_n
    midpoint          x_{n+1} = x_n + h v,  v = x'_n + h F((x_n + x_{n+1})/2)/2

The discrete Lagrangian of the first three is r (|Z1 - Z0|^2/2 - (V(Z0) + V(Z1))/2) with dV/ds = 1 - f. With sigma = 0
the exact one has B = delta = 0, A = cos w h and r = w/sin w h, w^2 = -3 b:

    L_d = w ((|x0|^2 + |x1|^2) cos w h - 2 Re(conj(x0) x1))/(2 sin w h),

the exact discrete Lagrangian that textbooks give. All differ from it by h^2 in A and B and by h^3 in delta.

wp(t) = sigma |x|^2 + b for every E and J, with g2 = 12 b^2 - 8 sigma E and g3 = 8 b (sigma E - b^2) + 4 sigma^2 J^2.
The reference is a Taylor series in fixed point with 96 fractional bits, for lengths and times near 1, without elliptic
functions.
Sources: McMillan, in Topics in Modern Physics (1971) 219; Suris, The Problem of Integrable Discretization (2003);
Marsden and West, Acta Numerica 10 (2001) 357, part 1.6 (exact discrete Lagrangian).
"""

import cmath
import functools
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from symtop.methods.lagrangian.oscillators import on_oscillators, one_oscillator
from symtop.model.charts import Array
from symtop.model.exact.elliptic import differences, half_period, roots
from symtop.model.scenes import Scene

BITS, ORDER, PER_PERIOD = 96, 20, 48  # of the reference series: its terms fall by 10 an order, to 1e-20
REAL = 1e-7  # a root counts as real if its imaginary part over its size is below this
LOST = 1e3  # a length far above that of any motion here: a path ends where it exceeds this


class Quartic(NamedTuple):
    """An oscillator and its start; sigma and b in 1/time^2."""

    sigma: float
    b: float
    position: complex
    velocity: complex

    @property
    def momentum(self) -> float:
        """J."""
        return (self.position.conjugate() * self.velocity).imag

    @property
    def invariants(self) -> tuple[float, float]:
        """g2 and g3."""
        s = abs(self.position) ** 2
        energy = 0.5 * abs(self.velocity) ** 2 - 0.5 * (3.0 * self.b + self.sigma * s) * s
        shift = self.sigma * energy - self.b**2
        return 4.0 * self.b**2 - 8.0 * shift, 8.0 * self.b * shift + 4.0 * (self.sigma * self.momentum) ** 2

    @property
    def period(self) -> float:
        """T, after which |x| comes back."""
        return 2.0 * half_period(roots(*self.invariants))

    def slope(self, s: float) -> float:
        """x''/x at |x|^2 = s."""
        return 2.0 * self.sigma * s + 3.0 * self.b


class Map(NamedTuple):
    """Z_{n+1} + Z_{n-1} = 2 A Z_n/(1 + B s_n), x_n = exp(i n delta) Z_n, p = r (Z_1 - A Z_0/(1 + B s_0))."""

    lift: float  # A - 1
    B: float
    r: float
    delta: float

    def kick(self, s: float) -> float:
        """A/(1 + B s) - 1."""
        return (self.lift - self.B * s) / (1.0 + self.B * s)


def of_top(scene: Scene) -> tuple[Quartic, Quartic]:
    """The two oscillators of a top."""
    par, s = on_oscillators(scene.top, scene.start)
    first, second = complex(s[0], s[1]), complex(s[2], s[3])
    return (
        Quartic(par.kappa, par.b1, first, complex(s[4], s[5])),
        Quartic(-par.kappa, par.b2, second, complex(s[6], s[7])),
    )


def exact(oscillator: Quartic, h: float) -> Map:
    """The map whose steps are the true motion, for 0 < h < T/2."""
    g2, g3 = oscillator.invariants
    above = differences(roots(g2, g3), h)
    aD, D, delta = one_oscillator(above, g2, g3, oscillator.sigma, oscillator.b, oscillator.momentum)
    return Map(aD / D, -oscillator.sigma / D, math.sqrt(D), delta)


def mcmillan(oscillator: Quartic, h: float) -> Map:
    """McMillan's map, the limit of the exact one for small steps: A and B to order h^2, and no turn."""
    return Map(1.5 * oscillator.b * h * h, -oscillator.sigma * h * h, 1.0 / h, 0.0)


def _explicit(rule: Map, kick: Callable[[float], float], oscillator: Quartic, steps: int) -> Array:
    """x_0 ... of a map of the common form, with f - 1 as the kick; the start's p follows from x' by B."""
    x, v = oscillator.position, oscillator.velocity
    s = abs(x) ** 2
    p = v - rule.B * (x.conjugate() * v).real / (1.0 + rule.B * s) * x
    path = np.full(steps + 1, np.nan + 0j)
    path[0] = x
    ahead = p / rule.r + kick(s) * x  # summed as increments, which rounds less than positions do
    for n in range(1, steps + 1):
        x += ahead
        if not abs(x) < LOST:
            break
        path[n] = x * cmath.exp(1j * n * rule.delta)
        ahead += 2.0 * kick(abs(x) ** 2) * x
    return path


def _implicit(oscillator: Quartic, h: float, steps: int) -> Array:
    """x_0 ... of the midpoint rule: its middle y is a multiple of c = x + h x'/2, and |y|^2 solves a cubic equation."""
    x, v = oscillator.position, oscillator.velocity
    path, quarter = np.empty(steps + 1, complex), 0.25 * h * h
    path[0] = x
    for n in range(1, steps + 1):
        c = x + 0.5 * h * v
        bend, middle = 2.0 * oscillator.sigma * quarter, 1.0 - 3.0 * oscillator.b * quarter
        roots = np.roots([bend * bend, -2.0 * middle * bend, middle * middle, -(abs(c) ** 2)])
        s = min(root.real for root in roots if abs(root.imag) <= REAL * abs(root))  # the one of small steps
        y = c / (1.0 - quarter * oscillator.slope(s))
        kick = h * oscillator.slope(s) * y
        x, v = 2.0 * y - x, v + kick
        path[n] = x
    return path


def discrete_path(oscillator: Quartic, method: str, h: float, steps: int) -> Array:
    """Positions after 0, 1, ... steps by one of the four maps, complex."""
    if method == "midpoint":
        return _implicit(oscillator, h, steps)
    if method == "stormer-verlet":
        return _explicit(Map(0.0, 0.0, 1.0 / h, 0.0), lambda s: 0.5 * h * h * oscillator.slope(s), oscillator, steps)
    rule = (exact if method == "exact-discrete" else mcmillan)(oscillator, h)
    return _explicit(rule, rule.kick, oscillator, steps)


def discrete_lagrangian(rule: Map, first: Any, second: Any) -> Any:
    """L_d of two positions Z, arrays of shape (2,); analytic, so that a complex step differentiates it."""
    s = [np.sum(z * z) for z in (first, second)]
    A, B = 1.0 + rule.lift, rule.B
    V = [value - (A / B * np.log(1.0 + B * value) if B else A * value) for value in s]
    return rule.r * (0.5 * np.sum((second - first) ** 2) - 0.5 * (V[0] + V[1]))


def true_path(oscillator: Quartic, times: Sequence[float] | Array) -> Array:
    """Positions at increasing times by Taylor series in fixed point, complex."""
    stride = _fixed(oscillator.period) // PER_PERIOD  # the unit of time of a series
    pulls = tuple(n * _fixed(pull) * stride**2 >> 2 * BITS for n, pull in ((2, oscillator.sigma), (3, oscillator.b)))
    x, v = ([_fixed(z.real), _fixed(z.imag)] for z in (oscillator.position, oscillator.velocity))
    terms, t0, path = _terms(pulls, x, [part * stride >> BITS for part in v]), 0, []
    for t in map(_fixed, map(float, times)):
        while t - t0 > stride:
            terms = _terms(pulls, *([sum(n**k * a for n, a in enumerate(part)) for part in terms] for k in (0, 1)))
            t0 += stride
        after = ((t - t0) << BITS) // stride
        path.append(complex(*(math.ldexp(_sum(part, after), -BITS) for part in terms)))
    return np.array(path)


def _fixed(value: float) -> int:
    return int(math.ldexp(value, BITS))


def _terms(pulls: Sequence[int], x: Sequence[int], v: Sequence[int]) -> tuple[list[int], list[int]]:
    """x_n of x(t) = sum x_n t^n, real and imaginary, from 2 sigma and 3 b."""
    real, imaginary, squares = [x[0], v[0]], [x[1], v[1]], []
    for n in range(ORDER - 1):
        backward = [part[n::-1] for part in (real, imaginary)]
        squares.append(_product(real, backward[0]) + _product(imaginary, backward[1]))
        for part, row in zip((real, imaginary), backward, strict=True):
            force = pulls[0] * _product(squares, row) + pulls[1] * row[0]
            part.append((force >> BITS) // ((n + 1) * (n + 2)))
    return real, imaginary


def _product(first: Sequence[int], second: Sequence[int]) -> int:
    """The sum of products, as long as the shorter one."""
    return sum(map(operator.mul, first, second)) >> BITS


def _sum(terms: Sequence[int], t: int) -> int:
    """The polynomial at t, by Horner's rule."""
    return functools.reduce(lambda total, term: (total * t >> BITS) + term, reversed(terms))
