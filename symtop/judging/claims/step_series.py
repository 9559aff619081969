"""The power series of a step beside that of the motion: the order of a method without a run.

One step of h from a generic point z of the true motion ends at Y(h), the motion at y(h). Both are analytic in h, and

    Y(h) - y(h) = sum_k c_k h^k,        order p  <=>  c_0 = ... = c_p = 0  <=>  the order conditions up to p hold.

Y - y is sampled at Chebyshev points of [-H, H] and fitted by the polynomial that leaves only noise. The points are of
[0, H] where a solver makes no step backwards, or one of another function, which no polynomial fits together with the
steps forwards. The defect of a term is |c_k| / |y_k|, y_k the same term of the motion: what an order condition is off
by, relative to itself. Slopes do not see a small defect: a coefficient of a fourth-order method that is off by 3e-8 has
slope 4.03 in double precision, and here the h^3 term is off by 1e-8 with a noise of 1e-13.

What a run carries from step to step is not seen in one step from a start; `step_map.restart_gap` tells such methods.
Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, III.1 (the elementary differentials of a step).
"""

import contextlib
import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from symtop.core.errors import SymtopError
from symtop.measure.step_map import StepMap, aligned
from symtop.model.charts import Array
from symtop.model.top import Angles

NODES = 40  # an even number: no step of length zero
WIDEST = 0.16  # of a nutation: the largest H that is tried
NARROWER, TRIES = 0.6, 7
DEGREES = range(4, 25)
LEAST_POWER = 6  # of the powers of h that are shown
FURTHER = 2  # degrees more: by what they change a term is in doubt, as by the scatter
NOISE = 1.25  # times the least: the polynomial of least degree whose residual is as small as this is taken
CLEAN = 3e-14  # of a residual: nothing is gained with a smaller H
ROUGH, SMOOTH = 1e-12, 0.01  # of a residual: beyond the one, and so much smaller forwards, -h is another function
SAMPLE_ROUNDING = 2e-16  # of a sample
SURE = 10.0  # times its noise: a term is there
AGREES = 1e-10  # a smaller defect is none: difference quotients in a step leave 1e-11, coefficients 1e-12
SHARP = 1e-3  # of a term of the motion: a noise beyond it says nothing about the term


class Series(NamedTuple):
    """The terms of a step beside those of the motion."""

    width: float  # H
    defect: Array  # |c_k| / |y_k|, k = 0 ...
    noise: Array  # what the samples leave in doubt of each
    backward: bool  # were steps of -h taken?
    chart: str

    @property
    def resolved(self) -> int:
        """The highest power up to which every term can be told from none."""
        return int(np.argmin([*(self.noise < SHARP), False])) - 1

    @property
    def order(self) -> int:
        """The power up to which the terms are those of the motion, at most `resolved`."""
        wrong = self.defect > np.maximum(AGREES, SURE * self.noise)
        return min(int(np.argmax([*wrong, True])) - 1, self.resolved)

    @property
    def is_exact(self) -> bool:
        """Is the order known, by a first term that is not the motion's? Else it may be higher."""
        return self.order < self.resolved

    def worst(self, power: int) -> float:
        """The largest defect of the terms up to h^power that are resolved."""
        return float(np.max(self.defect[: min(power, self.resolved) + 1], initial=0.0))

    def least(self, power: int) -> float:
        """The least defect of the h^power term, or of the last one that is there, that is told from none."""
        return max(AGREES, SURE * float(self.noise[min(power, self.noise.size - 1)]))

    def words(self, power: int) -> str:
        """What it says of the order `power`."""
        agreed, ahead = min(power, self.order), "" if self.backward else " (a step of -h is not taken)"
        if agreed < min(power, self.resolved):
            return f"{self.wrong_term()}, in the {self.chart} chart{ahead}"
        return f"a step has the motion's terms up to h^{agreed} to {max(self.worst(agreed), 1e-16):.0e}{ahead}"

    def wrong_term(self) -> str:
        """The first term that is not the motion's, if there is one."""
        term = self.order + 1
        return f"the h^{term} term of a step is off by {self.defect[term]:.1e} of itself (noise {self.noise[term]:.0e})"


def step_series(step: StepMap, start: Angles, period: float) -> Series:
    """The series of a step from a point of a motion with that nutation period; SymtopError if no step succeeds."""
    z, before = step.point(start), step.at(start)
    return compared(lambda h: aligned(step.chart, step.image(z, h), before), step.motion(start), period, step.chart)


def compared(
    image: Callable[[float], Array], motion: Callable[[float], Array], period: float, chart: str = ""
) -> Series:
    """The series of one function of h beside that of another, both (n,) of one chart and of order one."""
    ahead = functools.partial(_narrowed, image, motion, period, chart, backward=False)
    try:
        scatter, series = ahead(backward=True)
    except SymtopError:
        return ahead()[1]
    if scatter > ROUGH:
        with contextlib.suppress(SymtopError):
            series = forward[1] if (forward := ahead())[0] < SMOOTH * scatter else series
    return series


def _narrowed(image: Any, motion: Any, period: float, chart: str, *, backward: bool) -> tuple[float, Series]:
    """The fit of the least noise that narrower intervals give, and its noise."""
    width, best = WIDEST * period, None
    refusal = SymtopError("no step succeeds")
    for _ in range(TRIES):
        try:
            fitted = _fitted(image, motion, width, chart, backward=backward)
        except SymtopError as error:
            refusal = error
        else:
            if best is None or fitted[0] < 0.5 * best[0]:
                best = fitted
            if best[0] < CLEAN:
                break
        width *= NARROWER
    if best is None:
        raise refusal
    return best


def _fitted(
    image: Callable[[float], Array], motion: Callable[[float], Array], width: float, chart: str, *, backward: bool
) -> tuple[float, Series]:
    """The noise of a fit over [-width, width], or [0, width], and the series that it finds."""
    nodes = np.cos(math.pi * (np.arange(NODES) + 0.5) / NODES)
    places = nodes if backward else 0.5 * (nodes + 1.0)
    exact = np.stack([motion(width * float(place)) for place in places])
    error = np.stack([image(width * float(place)) for place in places]) - exact
    with np.errstate(over="ignore"):
        squares = error * error  # as the fits need them
    if not np.isfinite(squares).all():
        raise SymtopError("a step is not finite")
    scatter, degree = _degree(nodes, error)
    power = max(degree, LEAST_POWER)
    fits = (chebyshev.chebfit(nodes, error, one) for one in (power, power + FURTHER))
    terms, finer = (_monomials(fit, backward=backward) for fit in fits)
    _, top = _degree(nodes, exact)
    true = _monomials(chebyshev.chebfit(nodes, exact, max(top, power)), backward=backward)[: power + 1]
    size = np.maximum(np.max(np.abs(true), axis=1), np.finfo(float).tiny)
    size[0] = 1.0
    moved = np.max(np.abs(finer[: power + 1] - terms), axis=1)
    weights = np.full(power + 1, 2.0 / NODES)
    weights[0] = 1.0 / NODES
    grown = np.sqrt((_to_powers(power, backward=backward) ** 2) @ weights)  # what a scatter of one makes of each power
    doubt = np.maximum(scatter * grown, moved)
    return scatter, Series(width, np.max(np.abs(terms), axis=1) / size, doubt / size, backward, chart)


def _degree(nodes: Array, values: Array) -> tuple[float, int]:
    """The residual (root mean square of the worst component) and the least degree of a polynomial that leaves it."""
    rows = []
    for degree in DEGREES:
        rest = values - chebyshev.chebval(nodes, chebyshev.chebfit(nodes, values, degree)).T
        rows.append(float(np.max(np.sqrt(np.sum(rest * rest, axis=0) / (nodes.size - degree - 1)))))
    least = max(min(rows), SAMPLE_ROUNDING)
    place = next(k for k, row in enumerate(rows) if row <= NOISE * least)
    return max(rows[place], SAMPLE_ROUNDING), DEGREES[place]


def _monomials(coefficients: Any, *, backward: bool) -> Array:
    """Coefficients of the powers of h/H, shape (degree + 1, n), from those of Chebyshev's polynomials."""
    powers: Array = _to_powers(coefficients.shape[0] - 1, backward=backward) @ coefficients
    return powers


@functools.cache
def _to_powers(degree: int, *, backward: bool) -> Array:
    """The matrix from Chebyshev coefficients to powers of h/H."""
    columns = []
    for k in range(degree + 1):
        powers = chebyshev.cheb2poly(np.eye(degree + 1)[k])
        if not backward:  # x = 2 s - 1
            powers = np.polynomial.Polynomial(powers)(np.polynomial.Polynomial([-1.0, 2.0])).coef
        columns.append(np.pad(powers, (0, degree + 1 - len(powers))))
    matrix = np.stack(columns, axis=1)
    matrix.flags.writeable = False
    return matrix
