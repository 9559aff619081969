"""The power series of a step compared with that of the motion, which gives the order of a method from one step.

One step of h from a generic point z of the true motion ends at Y(h), the motion at y(h). Both are analytic in h, and

    Y(h) - y(h) = sum_k c_k h^k,        order p  <=>  c_0 = ... = c_p = 0  <=>  the order conditions up to p hold.

Y - y is sampled at Chebyshev points of [-H, H] and fitted by the polynomial of least degree that leaves only noise. The
interval is [0, H] if a solver makes no step backwards, or if its steps backwards are another function of h, so that no
polynomial fits both. The defect of a term is |c_k| / |y_k|, y_k the same term of the motion: the relative defect of an
order condition. Slopes do not show a small defect: with a coefficient that is off by 3e-8 a fourth-order method has
slope 4.03 in double precision, and here the h^3 term is off by 1e-8 with a noise of 1e-13.

Data carried from step to step in a run are not seen in one step; `step_map.restart_gap` detects such methods.
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

NODES = 40  # an even number, so that no step has length zero
WIDEST_STEP = 0.16  # nutations: the largest H that is tried
STEP_RATIO, TRIES = 0.6, 7  # ratio of one H to the one before; number of them
DEGREES = range(4, 25)  # of the polynomials that are tried
LEAST_POWER = 6  # least degree of the series
DEGREES_MORE = 2  # higher degrees of a second fit: its difference is an uncertainty of a term, as is the scatter
RESIDUAL_RATIO = 1.25  # times the least residual: the polynomial of least degree with a residual below this is taken
CLEAN_RESIDUAL = 3e-14  # a residual below this does not improve with a smaller H
ROUGH_RESIDUAL, LESS_RESIDUAL = 1e-12, 0.01  # above the first [0, H] is tried; used if less by the second, a factor
SAMPLE_ROUNDING = 2e-16  # rounding error of a sample
SURE_DEFECT = 10.0  # times the noise: a larger defect of a term counts
SMALL_DEFECT = 1e-10  # a smaller defect does not: difference quotients in a step leave 1e-11, coefficients 1e-12
SHARP_NOISE = 1e-3  # relative: a term with more noise is not resolved


class Series(NamedTuple):
    """The terms of the series of a step compared with those of the motion."""

    width: float  # H
    defect: Array  # |c_k| / |y_k|, k = 0 ...
    noise: Array  # uncertainty of each defect
    backward: bool  # were steps of -h taken?
    chart: str

    @property
    def resolved(self) -> int:
        """The highest power up to which every term is known to better than `SHARP_NOISE`."""
        return int(np.argmin([*(self.noise < SHARP_NOISE), False])) - 1

    @property
    def order(self) -> int:
        """The power up to which the terms agree with those of the motion, at most `resolved`."""
        wrong = self.defect > np.maximum(SMALL_DEFECT, SURE_DEFECT * self.noise)
        return min(int(np.argmax([*wrong, True])) - 1, self.resolved)

    @property
    def is_exact(self) -> bool:
        """Is there a first wrong term, which fixes the order? Otherwise the order may be higher."""
        return self.order < self.resolved

    def worst(self, power: int) -> float:
        """The largest defect of the terms up to h^power that are resolved."""
        return float(np.max(self.defect[: min(power, self.resolved) + 1], initial=0.0))

    def least(self, power: int) -> float:
        """The least defect of the h^power term, or of the last term, that counts."""
        return max(SMALL_DEFECT, SURE_DEFECT * float(self.noise[min(power, self.noise.size - 1)]))

    def words(self, power: int) -> str:
        """A clause on whether the series has the order `power`."""
        order, note = min(power, self.order), "" if self.backward else " (a step of -h is not taken)"
        if order < min(power, self.resolved):
            return f"{self.wrong_term()}, in the {self.chart} chart{note}"
        return f"a step has the motion's terms up to h^{order} to {max(self.worst(order), 1e-16):.0e}{note}"

    def wrong_term(self) -> str:
        """A clause on the first term that differs from that of the motion; there must be one."""
        term = self.order + 1
        return f"the h^{term} term of a step is off by {self.defect[term]:.1e} of itself (noise {self.noise[term]:.0e})"


def step_series(step: StepMap, start: Angles, period: float) -> Series:
    """The series of a step from `start`, a point of a motion of that nutation period; SymtopError if all steps fail."""
    z, before = step.point(start), step.at(start)
    return compared(lambda h: aligned(step.chart, step.image(z, h), before), step.motion(start), period, step.chart)


def compared(
    image: Callable[[float], Array], motion: Callable[[float], Array], period: float, chart: str = ""
) -> Series:
    """The series of the function `image` of h compared with that of `motion`, both (n,) in one chart, of size one."""
    fit = functools.partial(_best_fit, image, motion, period, chart, backward=False)
    try:
        scatter, series = fit(backward=True)
    except SymtopError:
        return fit()[1]
    if scatter > ROUGH_RESIDUAL:
        with contextlib.suppress(SymtopError):
            series = forward[1] if (forward := fit())[0] < LESS_RESIDUAL * scatter else series
    return series


def _best_fit(image: Any, motion: Any, period: float, chart: str, *, backward: bool) -> tuple[float, Series]:
    """The scatter and the series of the fit with least scatter among narrower and narrower intervals."""
    width, best = WIDEST_STEP * period, None
    refusal = SymtopError("no step succeeds")
    for _ in range(TRIES):
        try:
            trial = _fit(image, motion, width, chart, backward=backward)
        except SymtopError as error:
            refusal = error
        else:
            if best is None or trial[0] < 0.5 * best[0]:
                best = trial
            if best[0] < CLEAN_RESIDUAL:
                break
        width *= STEP_RATIO
    if best is None:
        raise refusal
    return best


def _fit(
    image: Callable[[float], Array], motion: Callable[[float], Array], width: float, chart: str, *, backward: bool
) -> tuple[float, Series]:
    """The scatter and the series of a fit over [-width, width], or over [0, width]."""
    nodes = np.cos(math.pi * (np.arange(NODES) + 0.5) / NODES)
    points = nodes if backward else 0.5 * (nodes + 1.0)
    exact = np.stack([motion(width * float(point)) for point in points])
    error = np.stack([image(width * float(point)) for point in points]) - exact
    with np.errstate(over="ignore"):
        squares = error * error  # the fits need finite squares
    if not np.isfinite(squares).all():
        raise SymtopError("a step is not finite")
    scatter, degree = _degree(nodes, error)
    power = max(degree, LEAST_POWER)
    fits = (chebyshev.chebfit(nodes, error, degree) for degree in (power, power + DEGREES_MORE))
    terms, finer = (_monomials(fit, backward=backward) for fit in fits)
    _, exact_degree = _degree(nodes, exact)
    true = _monomials(chebyshev.chebfit(nodes, exact, max(exact_degree, power)), backward=backward)[: power + 1]
    size = np.maximum(np.max(np.abs(true), axis=1), np.finfo(float).tiny)
    size[0] = 1.0
    change = np.max(np.abs(finer[: power + 1] - terms), axis=1)
    weights = np.full(power + 1, 2.0 / NODES)
    weights[0] = 1.0 / NODES
    grown = np.sqrt((_to_powers(power, backward=backward) ** 2) @ weights)  # of each power, by a scatter of one
    uncertainty = np.maximum(scatter * grown, change)
    return scatter, Series(width, np.max(np.abs(terms), axis=1) / size, uncertainty / size, backward, chart)


def _degree(nodes: Array, values: Array) -> tuple[float, int]:
    """The least residual of a fit (root mean square of the worst component), and the least degree that reaches it."""
    rows = []
    for degree in DEGREES:
        residual = values - chebyshev.chebval(nodes, chebyshev.chebfit(nodes, values, degree)).T
        rows.append(float(np.max(np.sqrt(np.sum(residual * residual, axis=0) / (nodes.size - degree - 1)))))
    smallest = max(min(rows), SAMPLE_ROUNDING)
    index = next(k for k, row in enumerate(rows) if row <= RESIDUAL_RATIO * smallest)
    return max(rows[index], SAMPLE_ROUNDING), DEGREES[index]


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
